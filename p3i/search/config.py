"""The one record of options that the search takes: the Python API and the command line both read it.

Each field carries the sentence that documents it, so `p3i synth --help` and `help(SearchConfig)` cannot
differ. Imports neither torch nor numpy: `p3i synth --help` reads this file.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from p3i.errors import SketchError, UsageError
from p3i.grammar.ast import Program
from p3i.grammar.sketch import Sketch
from p3i.records import Spelt, check_focal

Structure = Literal["auto", "lattice", "circular", "hybrid"]
Extent = Literal["found", "image"]
Recipe = Literal["p3i", "paper"]

STRUCTURES: tuple[Structure, ...] = get_args(Structure)
FEWEST_OBJECTS = 4
"""Fewer objects fix neither camera nor pattern, as fewer points fix no homography."""
MOST_K1 = 0.4
"""Beyond this radial distortion no photo lens goes (p3i/interp/lens.py)."""

EXTENTS: tuple[Extent, ...] = get_args(Extent)
RECIPES: tuple[Recipe, ...] = get_args(Recipe)
OBJECTS: tuple[str, ...] = ("crossing", "field", "dark", "light")
"""The names that places of a lattice's cell have (p3i.vision.motif.named_places)."""
FEATURES: tuple[str, ...] = ("oriented", "rgb", "lite0", "alexnet")
"""The names of p3i.vision.features.EXTRACTORS, repeated here so that `--help` need not load torch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchConfig:
    """What to look for in a photo, and with which means.

    Raises UsageError for a value out of range. What depends on the photo (its mask, its focal by EXIF)
    belongs to the image, not here.
    """

    structure: Annotated[Structure, "The kind of pattern to look for; auto tries all kinds."] = "auto"
    features: Annotated[
        str | None,
        f"What parts of the photo are compared by: {', '.join(FEATURES)}, or several joined by +. "
        f"By default {FEATURES[0]}; with --recipe paper alexnet if there are --weights, else rgb.",
        Spelt(metavar="NAME"),
    ] = None
    weights: Annotated[Path | None, "A file with the weights of the features (alexnet needs one)."] = None
    focal_mm: Annotated[
        float | Literal["auto"] | None,
        "35 mm-equivalent focal length, or auto: estimated from the pattern where that fixes it. "
        "By default that of the photo's EXIF data, else 35.",
        Spelt("--focal", metavar="MM|auto"),
    ] = None
    lens: Annotated[
        float | Literal["auto"] | None,
        "Radial lens distortion k1 (below 0: barrel), none, or auto: told by the objects of the pattern that "
        "was found, where it pays. A sketch, a start and the paper's recipe take the photo as it is.",
        Spelt(metavar="K1|auto|none", none="none"),
    ] = "auto"
    extent: Annotated[
        Extent | None,
        "Draw the objects that were found, or let a lattice fill the whole image, as in the paper. "
        "By default found; with --recipe paper image.",
    ] = None
    sketch: Annotated[
        Sketch | None,
        "A program with holes to fill (??, ?name, ~start), instead of a search.",
        Spelt(metavar="FILE", read=str),
    ] = None
    start: Annotated[
        Program | None,
        "A program to refine: camera and Draw move, bounds and guards stay, no search.",
        Spelt(metavar="FILE", read=str),
    ] = None
    recipe: Annotated[
        Recipe,
        "How to search: p3i, or paper for the paper's own way, for comparison: equation 2 as printed, "
        "a grid of 2 units, gradient descent, and its own features and extent.",
    ] = "p3i"
    object: Annotated[
        str | None,
        "Which place of the cell is its object: where lines cross, the field between them, what is dark or "
        "light, or the place of this number (the circle, on a ring), as --top lists them. By default the "
        "likeliest.",
        Spelt(metavar="|".join((*OBJECTS, "N"))),
    ] = None
    exhaustive_s: Annotated[
        float | None,
        "Seconds for sketches that only the grid fills as well: single rows and spirals.",
        Spelt("--exhaustive", metavar="SECONDS"),
    ] = None
    strict: Annotated[bool, "Fit and print programs of the paper's Table 1 only."] = False
    seed: Annotated[
        int, "Seed of everything random; equal seeds give equal programs.", Spelt(metavar="N")
    ] = 0
    time_s: Annotated[
        float | None,
        "Seconds after which the best program so far is the answer; no limit by default.",
        Spelt("--time", metavar="SECONDS"),
    ] = None
    top: Annotated[int, "How many candidates to report, the best first.", Spelt(metavar="K")] = 1
    threads: Annotated[int, "Threads to compute with; one is fastest at these sizes.", Spelt(metavar="N")] = 1

    def __post_init__(self) -> None:
        _one_of("structure", self.structure, STRUCTURES)
        _one_of("recipe", self.recipe, RECIPES)
        parts = [part.strip() for part in self.features_used.split("+")]
        for part in parts:
            _one_of("features", part, FEATURES)
        _one_of("extent", self.extent_used, EXTENTS)
        self._check_asked()
        self._check_object()
        if isinstance(self.focal_mm, str):
            _one_of("the focal length, where no number,", self.focal_mm, ("auto",))
        else:
            check_focal(self.focal_mm)
        if isinstance(self.lens, str):
            _one_of("the lens, where no number,", self.lens, ("auto",))
        elif self.lens is not None and not abs(self.lens) < MOST_K1:
            raise UsageError(f"k1 of a lens lies between -{MOST_K1} and {MOST_K1}, not {self.lens:g}")
        if self.time_s is not None and not self.time_s > 0:
            raise UsageError(f"the time must be more than 0 seconds, not {self.time_s:g}")
        if self.top < 1:
            raise UsageError(f"the number of candidates must be at least 1, not {self.top}")
        if self.threads < 1:
            raise UsageError(f"the number of threads must be at least 1, not {self.threads}")
        if self.seed < 0:
            raise UsageError(f"a seed is a whole number from 0, not {self.seed}")
        if ("alexnet" in parts) != (self.weights is not None):
            raise UsageError("the features alexnet, and only they, need a file with weights (--weights FILE)")

    @property
    def features_used(self) -> str:
        """The features that were asked for, else those of the recipe."""
        if self.features is not None:
            return self.features
        if self.recipe == "paper":
            return "rgb" if self.weights is None else "alexnet"
        return FEATURES[0]

    @property
    def extent_used(self) -> Extent:
        """The extent that was asked for, else that of the recipe."""
        return self.extent or ("image" if self.recipe == "paper" else "found")

    def check_for_all(self) -> None:
        """Raise UsageError for an option that speaks of one pattern, where all of a photo are asked for."""
        named = self._ways_asked()
        named += ["extent image"] if self.extent == "image" else []
        named += ["top"] if self.top > 1 else []
        if named:
            raise UsageError(f"--{named[0]} speaks of one pattern, --all of every one: leave one out")

    def _ways_asked(self) -> list[str]:
        """The options that say how to search, as they are spelled."""
        said = {
            "sketch": self.sketch is not None,
            "start": self.start is not None,
            "recipe paper": self.recipe == "paper",
            "exhaustive": self.exhaustive_s is not None,
        }
        return [way for way, asked in said.items() if asked]

    def _check_asked(self) -> None:
        """What says how to search: a sketch, a start, a recipe, or nothing.

        No option is overruled or left unread in silence: what cannot be honoured beside it is refused.
        """
        asked = self._ways_asked()
        if len(asked) > 1:
            raise UsageError(f"--{asked[0]} and --{asked[1]} contradict each other: leave one out")
        if self.sketch is not None and not self.sketch.holes:
            mend = "write `??` for a number to be found, or give the program with --start to refine it whole"
            raise SketchError(place="the sketch", reason="nothing in it is left to be found", mend=mend)
        if self.exhaustive_s is not None and not self.exhaustive_s > 0:
            raise UsageError(f"the time must be more than 0 seconds, not {self.exhaustive_s:g}")
        how = asked[0] if asked else ""
        alone = {"sketch": ("auto",), "start": ("auto",), "recipe paper": ("auto", "lattice")}
        # Rows and spirals are what only the grid finds.
        alone |= {"exhaustive": ("auto", "lattice", "circular")}
        if self.structure not in alone.get(how, STRUCTURES):
            raise UsageError(f"--{how} and --structure {self.structure} contradict each other")
        if how in ("sketch", "start"):
            if self.extent == "image":
                raise UsageError(f"--{how} says itself which objects are drawn: leave out --extent image")
            if self.focal_mm == "auto":
                raise UsageError(
                    f"--{how} is fitted under one focal: give its number, or leave out --focal auto"
                )
            if isinstance(self.lens, float | int):
                raise UsageError(f"--{how} is fitted to the photo as it is: leave out --lens")
        if how == "recipe paper" and self.extent == "found":
            raise UsageError("--recipe paper fills the whole image: leave out --extent found")
        if how == "exhaustive" and self.strict:
            raise UsageError("--exhaustive walks sketches outside Table 1: leave out --strict")
        if self.extent == "image" and self.structure in ("circular", "hybrid"):
            raise UsageError(f"--extent image continues lattices only: leave it out for {self.structure}")

    def _check_object(self) -> None:
        """Which place of the cell is the object: a name or a number, where there is a cell to choose in."""
        if self.object is None:
            return
        if self.object not in OBJECTS and not (self.object.isdecimal() and int(self.object) > 0):
            raise UsageError(f"the object is {', '.join(OBJECTS)} or a number from 1, not {self.object!r}")
        asked = [way for way in self._ways_asked() if way != "exhaustive"]
        asked += ["strict"] if self.strict else []
        if asked:
            raise UsageError(f"--{asked[0]} says itself where the objects are: leave out --object")
        if self.structure == "hybrid" or (self.structure == "circular" and self.object in OBJECTS):
            raise UsageError(f"--object {self.object} is no place there: leave it out for {self.structure}")


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise UsageError(f"{name} is one of {', '.join(allowed)}, not {value!r}")

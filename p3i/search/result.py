"""What a search returns: a program or the reason why there is none, and the evidence for either.

Imports neither torch nor numpy.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, get_args

from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program

MOST_FALSE_ALARMS = 0.05
"""What is expected less often than this in a picture without a pattern is no chance."""
NEEDED_BITS = -math.log2(MOST_FALSE_ALARMS)
"""So many bits net make an answer."""
NEEDED = 0.13
"""The agreement that suffices where a person asked for a program."""

StructureFound = Literal["lattice", "circular", "hybrid"]
STRUCTURES: tuple[StructureFound, ...] = get_args(StructureFound)
"""In the order of Table 1, in which they are looked for."""
FocalSource = Literal["option", "header", "exif", "default", "pattern"]

FOCAL_REASONS: Mapping[FocalSource, str] = {
    "option": "given by the caller",
    "header": "taken from the program's header",
    "exif": "read from the photo's EXIF data",
    "default": "assumed, since nothing tells",
    "pattern": "estimated from the pattern",
}
"""Why a focal was used, where its finder says no more; completes "focal 35 mm, ..."."""


class StopReason(Enum):
    """Why a search ended. The value is the sentence that the user reads; an answer needs none.

    TIME_UP and INTERRUPTED may come with a program (the best so far) or without one; FOUND always comes
    with one, the others never do. `synthesize` turns a KeyboardInterrupt into INTERRUPTED.
    """

    FOUND = ""
    TIME_UP = "the time was up before the search had ended"
    INTERRUPTED = "interrupted before the search had ended"
    NO_PATTERN = "no regular pattern"
    OUT_OF_SIGHT = "no regular pattern: most objects of what was found would lie outside the picture"
    NO_FIT = "the sketch does not fit this photo"
    OUTSIDE_TABLE_1 = "the pattern that was found cannot be written in the paper's Table 1, as strict asks"
    NO_SUCH_OBJECT = "the cell of what was found has no such place"
    TOO_SMALL = "the picture is too small to hold a pattern"
    FLAT = "the picture has too little contrast to hold a pattern"
    TOO_LITTLE_KNOWN = "too few pixels of the picture are known (the rest is masked or transparent)"


@dataclass(frozen=True, slots=True)
class Reading:
    """A place of a lattice's or a ring's cell that may be its object.

    `name` is what is there, `crossing`, `field`, `dark` or `light`, else its rank, from 1; `probability` that
    it is the object; `steps` how many of i and of j it lies from the objects that are drawn, 0 for these;
    `radius` how many times as far from the centre of a ring.
    """

    name: str
    probability: float
    steps: tuple[float, float]
    radius: float = 1.0

    @property
    def drawn(self) -> bool:
        """Whether the program draws this one."""
        return self.steps == (0.0, 0.0) and self.radius == 1

    @property
    def phrase(self) -> str:
        """What is there, in words that follow "objects on"."""
        if self.radius != 1:
            return f"the circle of {self.radius:.2f} times its radius"
        return _PHRASES.get(self.name, f"place {self.name} of the cell")


_PHRASES: Mapping[str, str] = {
    "crossing": "the crossings",
    "field": "the fields",
    "dark": "the dark places",
    "light": "the light places",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One program that the search weighed, with its own focal; the rest as in SynthesisResult.

    `reading` is the place of the cell that the objects are on, None for others. `same_lattice`: it is
    the answer's lattice or ring, its objects on another place of the cell.
    """

    program: Program
    score: float
    structure: StructureFound
    agreement: float | None = None
    bits: float | None = None
    focal_mm: float = 35.0
    focal_source: FocalSource = "default"
    focal_reason: str = ""
    false_alarms: float | None = None
    reading: Reading | None = None
    same_lattice: bool = False
    upright: bool = False

    @property
    def title(self) -> str:
        """What it is, for people: "lattice, score 0.3500", "the same lattice, objects on the fields, ..."."""
        same = "the same lattice" if self.structure == "lattice" else "the same ring"
        parts = [same if self.same_lattice else self.structure]
        if self.reading is not None:
            parts.append(f"objects on {self.reading.phrase} ({self.reading.probability:.2f})")
        return ", ".join([*parts, f"score {self.score:.2f}"])

    def record(self) -> dict[str, Any]:
        """The candidate as JSON has it."""
        return {
            "program": format_program(self.program),
            "structure": self.structure,
            **_object_facts(self.reading),
            "same_lattice": self.same_lattice,
            "focal": self.focal_mm,
            "score": _rounded(self.score),
            "agreement": _rounded(self.agreement),
            "bits": _rounded(self.bits, 1),
            "false_alarms": self.false_alarms,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Other:
    """Another pattern on the photo, beside the answer's: what would be an answer by itself.

    `center` is the middle of its `objects`, (x, y) in pixels, `region` as in SynthesisResult.
    """

    structure: StructureFound
    center: tuple[float, float]
    region: tuple[tuple[float, float], ...]
    objects: int
    score: float

    def record(self) -> dict[str, Any]:
        """The pattern as JSON has it."""
        return {
            "structure": self.structure,
            "center": [round(value, 1) for value in self.center],
            "region": [[round(x, 1), round(y, 1)] for x, y in self.region],
            "objects": self.objects,
            "score": _rounded(self.score),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisResult:
    """The answer for one photo.

    `score` is how likely the answer is right: of answers that say 0.9, nine in ten are (docs/search.md).
    `agreement` is how well the objects predict each other, 0 to 1, and `bits` what the program explains of
    the photo less what it costs: both are evidence for the answer.
    `program` is None where nothing convinced; then there is no score, `agreement` and `bits` are the best
    that were seen, if any. `needed` is the agreement that what a person asked for must reach, None for
    others, which need bits. `false_alarms` is the number of finds as good as this one that are expected in a
    picture without a pattern, None where a person asked for it and where there is no program. `margin_bits`
    is the lead over the best candidate of another meaning, and `margin` its share of the bits, 0 to 1.
    `centers` are the objects of `program` on the photo: (x, y) in pixels, pixel centres at whole numbers,
    and the loop indices (i, j). `focal_mm` is the focal that `program` is told with, and `focal_reason` says
    why, for people; without a program it is the one assumed. `candidates` are in order, the best first, at
    most `SearchConfig.top`.
    `absent` is how many of them the photo does not show, as `p3i points` tells; None without a program.
    `lens_k1` is the radial distortion of the photo that `program` holds on (docs/geometry.md), None where it
    was seen as a pinhole camera's; `centers` lie on the photo as it is. `region` is the part of the photo
    where the program holds: a convex polygon around the cells of its objects, (x, y) in pixels.
    `pose_sigma_deg` is how well the tilt is known, in degrees: the standard deviation of the angle of the
    plane's normal; None without a program.
    `mirrored` is the other tilt, (rx, ry) in degrees, that a ring's objects fit about as well, None where the
    two can be told apart.
    `readings` are the places of the cell that may be its object, the likeliest first; empty where there is no
    choice. With StopReason.NO_SUCH_OBJECT they are what the cell offers in place of the one asked for.
    `others` are further patterns that the search met beside the answer's, the most worth first: not all that
    there are, which `p3i.synth_all` looks for.
    `window` is the rectangle (x, y, width, height) of photo pixels that was looked at closer: the box of a
    region of interest, or the part that the search chose; None for all of it.
    `upright`: the objects of a ring keep their direction, as a wheel's gondolas do, and do not turn with it.
    `least_period_px` of a photo that was refused: what repeats more closely than so many pixels was too small
    to be seen, since the photo is looked at reduced; None where nothing was.
    `notes` are sentences for the user about the answer, such as the distance of a strict fit to the free.
    """

    program: Program | None
    stop: StopReason
    structure: StructureFound | None = None
    score: float | None = None
    agreement: float | None = None
    bits: float | None = None
    margin: float | None = None
    margin_bits: float | None = None
    needed: float | None = None
    false_alarms: float | None = None
    candidates: tuple[Candidate, ...] = ()
    centers: tuple[tuple[float, float, int, int], ...] = ()
    focal_mm: float = 35.0
    focal_source: FocalSource = "default"
    focal_reason: str = ""
    absent: int | None = None
    lens_k1: float | None = None
    region: tuple[tuple[float, float], ...] = ()
    features: str = ""
    seed: int = 0
    pose_sigma_deg: float | None = None
    readings: tuple[Reading, ...] = ()
    mirrored: tuple[float, float] | None = None
    others: tuple[Other, ...] = ()
    window: tuple[int, int, int, int] | None = None
    upright: bool = False
    least_period_px: int | None = None
    notes: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Why the search ended, as a sentence with its numbers; empty where there is nothing to explain."""
        why = self.stop.value
        if (
            self.stop in (StopReason.NO_PATTERN, StopReason.NO_FIT)
            and self.agreement is not None
            and self.needed is not None
        ):
            why = f"{why} (best {self.agreement:.2f}, needs {self.needed:.2f})"
        elif self.stop is StopReason.NO_PATTERN and self.bits is not None:
            why = f"{why} (the best found is worth {self.bits:.0f} bits, an answer {NEEDED_BITS:.1f})"
        if self.stop is StopReason.NO_SUCH_OBJECT:
            return f"{why} (it offers {', '.join(reading.name for reading in self.readings)})"
        if self.least_period_px is None or self.program is not None:
            return why
        return f"{why}; repeats of less than {self.least_period_px} pixels are not seen: --roi looks closer"

    @property
    def reading(self) -> Reading | None:
        """The place of the cell that the objects of `program` are on; None where there is no choice."""
        return next((one for one in self.readings if one.drawn and self.program is not None), None)

    def record(self, *, image: str | None = None, seconds: float | None = None) -> dict[str, Any]:
        """The answer as JSON has it, a line of `p3i synth --format jsonl`; its keys in the documented order.

        `image` is the photo's name and `seconds` what the search took, where they are known. `centers` are
        pixels, to a hundredth; `program` is the canonical text in the layout "python", whatever was printed
        elsewhere. With more than one candidate asked for, `candidates` lists them, the best first.
        Raises ValueError for a result without a program, or a program without a canvas.
        """
        program = self.program
        if program is None or program.header is None or program.header.canvas is None:
            raise ValueError("only a program with a canvas can be recorded")
        width, height = program.header.canvas
        camera: dict[str, Any] = {
            "rx": program.camera.rx_deg,
            "ry": program.camera.ry_deg,
            "focal": self.focal_mm,
            "focal_from": self.focal_source,
            "focal_reason": self.focal_reason,
        }
        if self.lens_k1 is not None:
            camera["lens_k1"] = self.lens_k1
        if self.mirrored is not None:
            camera["mirrored"] = list(self.mirrored)
        if self.pose_sigma_deg is not None:
            camera["pose_sigma_deg"] = self.pose_sigma_deg
        record: dict[str, Any] = {
            "image": image,
            "width": width,
            "height": height,
            "program": format_program(program),
            "structure": self.structure,
            **_object_facts(self.reading),
            "camera": camera,
            "centers": [[round(x, 2), round(y, 2), i, j] for x, y, i, j in self.centers],
            "region": [[round(x, 1), round(y, 1)] for x, y in self.region],
            "score": _rounded(self.score),
            "agreement": _rounded(self.agreement),
            "bits": _rounded(self.bits, 1),
            "margin": _rounded(self.margin),
            "margin_bits": _rounded(self.margin_bits, 1),
            "false_alarms": self.false_alarms,
            "absent": self.absent,
            "seconds": None if seconds is None else round(seconds, 3),
            "features": self.features,
            "seed": self.seed,
        }
        if self.upright:
            record["upright"] = True
        if self.window is not None:
            record["window"] = list(self.window)
        if self.others:
            record["others"] = [other.record() for other in self.others]
        if len(self.candidates) > 1:
            record["candidates"] = [candidate.record() for candidate in self.candidates]
        return record


def _object_facts(reading: Reading | None) -> dict[str, Any]:
    """Which place of the cell is the object, and how surely, as JSON has it."""
    return {
        "object": None if reading is None else reading.name,
        "object_confidence": None if reading is None else _rounded(reading.probability),
    }


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(value, digits)

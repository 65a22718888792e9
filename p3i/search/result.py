"""What a search returns: a program or the reason why there is none, and the evidence for either.

Imports neither torch nor numpy.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program

NEEDED = 0.13
"""The score that suffices for an answer (docs/benchmarks.md says what it was calibrated on)."""

StructureFound = Literal["lattice", "circular", "hybrid"]
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
    COSTS_MORE = "no regular pattern: what repeats is less than the program takes to write"
    OUT_OF_SIGHT = "no regular pattern: most objects of what was found would lie outside the picture"
    NO_FIT = "the sketch does not fit this photo"
    OUTSIDE_TABLE_1 = "the pattern that was found cannot be written in the paper's Table 1, as strict asks"
    TOO_SMALL = "the picture is too small to hold a pattern"
    FLAT = "the picture has too little contrast to hold a pattern"
    TOO_LITTLE_KNOWN = "too few pixels of the picture are known (the rest is masked or transparent)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One program that the search weighed, with its normalised score (docs/search.md) and its own focal.

    `false_alarms` as in SynthesisResult.
    """

    program: Program
    score: float
    structure: StructureFound
    focal_mm: float = 35.0
    focal_source: FocalSource = "default"
    focal_reason: str = ""
    false_alarms: float | None = None

    def record(self) -> dict[str, Any]:
        """The candidate as JSON has it."""
        return {
            "program": format_program(self.program),
            "structure": self.structure,
            "focal": self.focal_mm,
            "score": _rounded(self.score),
            "false_alarms": self.false_alarms,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisResult:
    """The answer for one photo.

    `program` is None where nothing convinced; then `score` is the best that was seen, if any, and
    `needed` what it should have reached. `needed` is None for an answer with a lower score (docs/search.md):
    one that `false_alarms` convinced of. `false_alarms` is the number of finds as good as this one that are
    expected in a picture without a pattern, None where a person asked for it and where there is no program.
    `margin` is the lead over the best candidate of another meaning.
    `centers` are the objects of `program` on the photo: (x, y) in pixels, pixel centres at whole numbers,
    and the loop indices (i, j). `focal_mm` is the focal that `program` is told with, and `focal_reason` says
    why, for people; without a program it is the one assumed. `candidates` are in order, the best first, at
    most `SearchConfig.top`.
    `lens_k1` is the radial distortion of the photo that `program` holds on (docs/geometry.md), None where it
    was seen as a pinhole camera's; `centers` lie on the photo as it is. `region` is the part of the photo
    where the program holds: a convex polygon around the cells of its objects, (x, y) in pixels.
    `pose_sigma_deg` is how well the tilt is known, in degrees: the standard deviation of the angle of the
    plane's normal; None without a program.
    `mirrored` is the other tilt, (rx, ry) in degrees, that a ring's objects fit about as well, None where the
    two can be told apart.
    `notes` are sentences for the user about the answer, such as the distance of a strict fit to the free.
    """

    program: Program | None
    stop: StopReason
    structure: StructureFound | None = None
    score: float | None = None
    margin: float | None = None
    needed: float | None = None
    false_alarms: float | None = None
    candidates: tuple[Candidate, ...] = ()
    centers: tuple[tuple[float, float, int, int], ...] = ()
    focal_mm: float = 35.0
    focal_source: FocalSource = "default"
    focal_reason: str = ""
    lens_k1: float | None = None
    region: tuple[tuple[float, float], ...] = ()
    features: str = ""
    seed: int = 0
    pose_sigma_deg: float | None = None
    mirrored: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """Why the search ended, as a sentence with its numbers; empty where there is nothing to explain."""
        if (
            self.stop in (StopReason.NO_PATTERN, StopReason.NO_FIT)
            and self.score is not None
            and self.needed is not None
        ):
            return f"{self.stop.value} (best {self.score:.2f}, needs {self.needed:.2f})"
        return self.stop.value

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
            "camera": camera,
            "centers": [[round(x, 2), round(y, 2), i, j] for x, y, i, j in self.centers],
            "region": [[round(x, 1), round(y, 1)] for x, y in self.region],
            "score": _rounded(self.score),
            "margin": _rounded(self.margin),
            "false_alarms": self.false_alarms,
            "seconds": None if seconds is None else round(seconds, 3),
            "features": self.features,
            "seed": self.seed,
        }
        if len(self.candidates) > 1:
            record["candidates"] = [candidate.record() for candidate in self.candidates]
        return record


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)

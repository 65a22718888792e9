"""What a search finds: a finished program, and what it is worth."""

from dataclasses import dataclass

from p3i.grammar.ast import Program
from p3i.search.result import Other, Reading, StructureFound


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """A finished program for the photo.

    `score` says how sure it is (0..1, comparable between photos), `worth` how much of this photo it explains
    (comparable between programs for one photo). `focal_mm` is the focal that the program is told with, None
    where it is the one assumed; then `focal_reason` may say why no other was found. `lens_k1` is the radial
    distortion of the photo that the program holds on (p3i/interp/lens.py), None for a pinhole camera.
    `readings` are the places of the cell that may be its object, the likeliest first.
    `others` are the patterns beside this one that were met on the way to it. `covered` is the share of the
    picture that a ring's objects fill. `upright`: these do not turn with it (look/upright.py).
    """

    program: Program
    structure: StructureFound
    score: float
    worth: float
    notes: tuple[str, ...] = ()
    focal_mm: float | None = None
    focal_reason: str = ""
    lens_k1: float | None = None
    readings: tuple[Reading, ...] = ()
    others: tuple[Other, ...] = ()
    covered: float = 1.0
    upright: bool = False

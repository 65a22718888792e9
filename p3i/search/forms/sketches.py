"""Which sketches a search takes up, and in which order: one for each shape that a proposer can write.

Each is the fullest of its shape, with a phase and all guards: what a filling leaves at 0 costs nothing, and
is not written. Sketches that another contains in another spelling are left out: x and y have the same form,
and the radius and the angle of a curve are one number in both. Structures come in the order of Table 1, not
of length alone: a ring is shorter than a lattice, but looking for one costs more, and where a lattice leaves
no room none is looked for.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

from p3i.grammar.ast import Polar, Program
from p3i.grammar.sketch import Sketch
from p3i.interp.unroll import nest
from p3i.search.config import SearchConfig
from p3i.search.forms.filling import whole_program_sketch
from p3i.search.forms.length import NUMBER_BITS, production_bits
from p3i.search.forms.spelled import LATTICE, curve, spelled
from p3i.search.result import StructureFound

Shape = Literal["lattice", "row", "ring", "arc", "spiral", "rings in rings", "fan", "rings in a row", "any"]
"""What a sketch draws, however it is spelled; `any` is a person's own."""

WALKED_SHAPES: tuple[Shape, ...] = ("row", "spiral")
"""Shapes that only the grid writes: they take long, and are taken up where somebody asks for it."""


@dataclass(frozen=True, slots=True)
class Sketched:
    """A sketch with its name, its shape and the structure that it spells.

    Not `asked`: others start from its programs, which are no answers.
    """

    name: str
    shape: Shape
    structure: StructureFound
    sketch: Sketch
    asked: bool = True

    @property
    def by_hand(self) -> Sketch | None:
        """The sketch of a person, whose limits are kept."""
        return self.sketch if self.shape == "any" else None

    @property
    def gridded(self) -> bool:
        """Whether it is filled from the grid, as it is written: a person's sketch, a row or a spiral."""
        return self.shape == "any" or self.shape in WALKED_SHAPES

    @property
    def bits(self) -> float:
        """What it takes to write down: its productions, and each number that is to be found."""
        numbers = {hole.name or hole.path for hole in self.sketch.holes}
        return NUMBER_BITS * len(numbers) + production_bits(self.sketch.template)


def sketches(config: SearchConfig) -> list[Sketched]:
    """The sketches that a search with these options takes up, in order."""
    if config.start is not None:
        return [by_hand("the start", whole_program_sketch(config.start, table1=config.strict))]
    if config.sketch is not None:
        own = by_hand("the sketch", config.sketch)
        loops = nest(config.sketch.template)
        row = own.structure == "lattice" and (loops.for_i is None or loops.for_j is None)
        return [own] if row else [*_starts_for(own.structure), own]
    taken = [one for one in every_sketch() if config.exhaustive_s is not None or not one.gridded]
    if config.recipe == "paper":
        return taken[:1]
    if config.structure == "auto":
        return taken
    wanted = [one for one in taken if one.structure == config.structure]
    starts = _starts_for("circular") if config.structure == "hybrid" else []
    return [*starts, *wanted]


def by_hand(name: str, sketch: Sketch) -> Sketched:
    """A person's sketch, as one to take up."""
    return Sketched(name, "any", structure_of(sketch.template), sketch)


def structure_of(program: Program) -> StructureFound:
    """What a program's pattern is called: circular for one curve, hybrid for several, else lattice."""
    parts = nest(program)
    if not any(isinstance(form, Polar) for form in (parts.draw.x, parts.draw.y)):
        return "lattice"
    return "hybrid" if parts.for_i is not None and parts.for_j is not None else "circular"


def _starts_for(structure: StructureFound) -> list[Sketched]:
    """The sketches whose programs a sketch of this structure may start from: hybrids hold rings."""
    held = ("circular", "hybrid") if structure == "hybrid" else (structure,)
    found = (one for one in every_sketch() if one.structure in held and not one.gridded)
    return [replace(one, asked=False) for one in found]


@cache
def every_sketch() -> tuple[Sketched, ...]:
    """A sketch for each shape, in the order in which they are looked for."""
    closed, open_, rings = "360/?n*j", "?s*j", "(?b*i + ?r)"
    spellings: dict[Shape, Sketch] = {
        "lattice": spelled(LATTICE, i="0, ??", j="0, ??", guards=3),
        "ring": spelled(curve("?r", closed), j="0, ?n"),
        "arc": spelled(curve("?r", open_), j="0, ??"),
        "rings in rings": spelled(curve(rings, closed), i="0, ??", j="0, ?n"),
        "fan": spelled(curve(rings, open_), i="1, ??", j="0, ??*i"),
        "rings in a row": spelled(curve("?r", closed, moves=True), i="0, ??", j="0, ?n"),
        "row": spelled("Draw(x=??*j + ??, y=??*j + ??)", j="0, ??"),
        "spiral": spelled(curve("(?b*j + ?r)", open_), j="0, ??"),
    }
    return tuple(
        Sketched(shape, shape, structure_of(sketch.template), sketch) for shape, sketch in spellings.items()
    )

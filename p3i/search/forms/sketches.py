"""The enumerator: every sketch that a proposer can write, and which ones a search takes up, in which order.

Every sketch is put together from the productions of the grammar with a hole for every number. Its length in
bits is what it takes to name the productions, and `NUMBER_BITS` for each hole that is a number of its own.
Sketches that a shorter one contains in another spelling are left out: x and y have the same form, and the
radius and the angle of a curve are one number in both.

A search takes up each shape in its fullest spelling, with a phase and all guards: what a filling leaves at 0
costs it nothing, and is not written. Structures come in the order of Table 1, not of length alone: a ring is
shorter than a lattice, but looking for one costs more, and where a lattice leaves no room none is looked for.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

from p3i.grammar.ast import Polar, Program
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.unroll import nest
from p3i.search.config import SearchConfig
from p3i.search.forms.filling import whole_program_sketch
from p3i.search.forms.length import NUMBER_BITS, PRODUCTION_BITS
from p3i.search.result import STRUCTURES, StructureFound

Shape = Literal["lattice", "row", "ring", "arc", "spiral", "rings in rings", "fan", "rings in a row", "any"]
"""What a sketch draws, however it is spelled; `any` is a person's own."""

WALKED_SHAPES: tuple[Shape, ...] = ("row", "spiral")
"""Shapes that only the grid writes: they take long, and are taken up where somebody asks for it."""
# What a sketch outside Table 1 costs on top: one that the paper has no word for is less likely.
_BITS_BEYOND = 16.0
_MOST_GUARDS = 3
_NAMED = re.compile(r"\?[a-z]")


@dataclass(frozen=True, slots=True)
class Sketched:
    """A sketch, its shape, the structure that it spells, and its length in bits.

    `fullest`: no other sketch of its shape says more. Not `asked`: others start from its programs, which are
    no answers. `by_hand` is the sketch that a person wrote, whose limits are kept.
    """

    name: str
    shape: Shape
    structure: StructureFound
    text: str
    bits: float
    fullest: bool = True
    asked: bool = True
    by_hand: Sketch | None = None

    @property
    def sketch(self) -> Sketch:
        """The sketch, read from its text; a person's as it was read."""
        return self.by_hand or _read(self.text)


@dataclass(frozen=True, slots=True)
class _Form:
    """A form of `Draw`: its shape, how it differs from others of it, its x and y, whether Table 1 has it."""

    shape: Shape
    spelling: str
    x: str
    y: str
    table1: bool
    fullest: bool


def sketches(config: SearchConfig) -> list[Sketched]:
    """The sketches that a search with these options takes up, in order."""
    if config.start is not None:
        return [by_hand("the start", whole_program_sketch(config.start, table1=config.strict))]
    if config.sketch is not None:
        own = by_hand("the sketch", config.sketch)
        return [*(replace(one, asked=False) for one in _towards(own)), own]
    taken = [one for one in sketches_by_length() if one.fullest]
    if config.recipe == "paper":
        return [one for one in taken if one.shape == "lattice"]
    if config.exhaustive_s is None:
        taken = [one for one in taken if one.shape not in WALKED_SHAPES]
    taken.sort(key=lambda one: (one.shape in WALKED_SHAPES, STRUCTURES.index(one.structure)))
    if config.structure == "auto":
        return taken
    wanted = [one for one in taken if one.structure == config.structure]
    towards = _towards(wanted[0]) if config.structure == "hybrid" else []
    return [*(replace(one, asked=False) for one in towards if one not in wanted), *wanted]


def by_hand(name: str, sketch: Sketch) -> Sketched:
    """A person's sketch, as one to take up."""
    return Sketched(name, "any", structure_of(sketch.template), "", 0.0, by_hand=sketch)


def structure_of(program: Program) -> StructureFound:
    """What a program's pattern is called: circular for one curve, hybrid for several, else lattice."""
    parts = nest(program)
    if not any(isinstance(form, Polar) for form in (parts.draw.x, parts.draw.y)):
        return "lattice"
    return "hybrid" if parts.for_i is not None and parts.for_j is not None else "circular"


def _towards(wanted: Sketched) -> list[Sketched]:
    """The sketches whose programs one of this structure may start from; none for a single row."""
    loops = nest(wanted.sketch.template)
    if wanted.structure == "lattice" and (loops.for_i is None or loops.for_j is None):
        return []
    names = {"lattice": ("lattice",), "circular": ("circular",), "hybrid": ("circular", "hybrid")}
    every = [one for one in sketches_by_length() if one.fullest and one.shape not in WALKED_SHAPES]
    return sorted(
        (one for one in every if one.structure in names[wanted.structure]),
        key=lambda one: STRUCTURES.index(one.structure),
    )


def sketches_by_length() -> list[Sketched]:
    """All sketches up to two loops and three guards, the shortest first; equal lengths by their names."""
    every = [*_lattices(), *_rings(), *_hybrids()]
    return sorted(every, key=lambda one: (one.bits, one.name))


def _lattices() -> Iterator[Sketched]:
    plain = _Form("lattice", "", "??*i + ??*j", "??*i + ??*j", True, False)
    moved = _Form("lattice", "moved", "??*i + ??*j + ??", "??*i + ??*j + ??", False, True)
    for form, guards in itertools.product((plain, moved), range(_MOST_GUARDS + 1)):
        yield _made(form, "lattice", loops=("i", "j"), guards=guards)
    yield _made(_Form("row", "", "??*j + ??", "??*j + ??", False, True), "lattice", loops=("j",))


def _rings() -> Iterator[Sketched]:
    """Single loops round a centre: x = radius * Cos(angle) + offset, and y alike with Sin."""
    curves: dict[Shape, tuple[str, str]] = {
        "ring": ("?r", "360/?n*j"),
        "arc": ("?r", "?t*j"),
        "spiral": ("(?s*j + ?r)", "?t*j"),
    }
    for (shape, (radius, step)), phase in itertools.product(curves.items(), (False, True)):
        angle = f"{step} + ?p" if phase else step
        x, y = f"{radius}*Cos({angle}) + ??", f"{radius}*Sin({angle}) + ??"
        form = _Form(shape, "with a phase" * phase, x, y, shape != "spiral" and not phase, phase)
        yield _made(form, "circular", loops=("j",), closed=shape == "ring")


def _hybrids() -> Iterator[Sketched]:
    """Rings in rings and fans (the radius grows with i), a ring repeated along a line (the centre moves)."""
    shapes: list[tuple[Shape, str, str, str]] = [
        ("rings in rings", "", "?r*i", "??"),
        ("rings in rings", "radius free", "(?q*i + ?r)", "??"),
        ("fan", "", "?r*i", "??"),
        ("fan", "radius free", "(?q*i + ?r)", "??"),
        ("rings in a row", "", "?r", "??*i + ??"),
    ]
    for (shape, spelling, radius, offset), phase in itertools.product(shapes, (False, True)):
        step = "?t*j" if shape == "fan" else "360/?n*j"
        angle = f"{step} + ?p" if phase else step
        x, y = f"{radius}*Cos({angle}) + {offset}", f"{radius}*Sin({angle}) + {offset}"
        table1 = radius == "?r*i" and not phase
        spellings = ", ".join(word for word in (spelling, "with a phase" * phase) if word)
        form = _Form(shape, spellings, x, y, table1, phase and radius != "?r*i")
        first = "1" if radius == "?r*i" or shape == "fan" else "0"
        stop = "??*i" if shape == "fan" else "?n"
        yield _made(form, "hybrid", loops=("i", "j"), closed=shape != "fan", first=first, stop=stop)


@cache
def _read(text: str) -> Sketch:
    sketch = parse_sketch(text)
    assert isinstance(sketch, Sketch), sketch
    return sketch


def _made(
    form: _Form,
    structure: StructureFound,
    *,
    loops: tuple[str, ...],
    guards: int = 0,
    closed: bool = False,
    first: str = "0",
    stop: str = "?n",
) -> Sketched:
    lines = ["SetCameraPose(rx=??, ry=??)"]
    for variable in loops:
        begin = first if variable == "i" else "0"
        end = stop if variable == "j" and (closed or stop != "?n") else "??"
        lines.append("    " * (len(lines) - 1) + f"for {variable} in range({begin}, {end}):")
    for _ in range(guards):
        lines.append("    " * (len(lines) - 1) + "if ??*i + ??*j >= ??:")
    lines.append("    " * (len(lines) - 1) + f"Draw(x={form.x}, y={form.y})")
    text = "\n".join(lines) + "\n"
    numbers = text.count("??") + len(set(_NAMED.findall(text)))
    bits = NUMBER_BITS * numbers + PRODUCTION_BITS * (1 + len(loops) + guards)
    bits += 0.0 if form.table1 else _BITS_BEYOND
    words = [form.shape, form.spelling, f"{guards} guards" if guards else ""]
    name = ", ".join(word for word in words if word)
    fullest = form.fullest and (form.shape != "lattice" or guards == _MOST_GUARDS)
    return Sketched(name, form.shape, structure, text, bits, fullest)

"""The sketches of the language in order of description length: Table 1's first, then the superset's.

Every sketch is put together from the productions of the grammar with a hole for every number. Its length in
bits is what it takes to name the productions, and `BITS_A_NUMBER` for each hole that is a number of its own.
Sketches that a shorter one contains in another spelling are left out: x and y have the same form, and the
radius and the angle of a curve are one number in both.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.result import StructureFound

BITS_A_NUMBER = 8.0
"""What it costs to write down one number: a range of 256 distinguishable values."""
_BITS_A_CHOICE = 1.0
# What a sketch outside Table 1 costs on top: one that the paper has no word for is less likely.
_BITS_BEYOND = 16.0


@dataclass(frozen=True, slots=True)
class Sketched:
    """A sketch, what it is called, the structure that it spells, and its length in bits.

    `family` names the family whose fast proposals find its programs, None where none does.
    """

    name: str
    structure: StructureFound
    sketch: Sketch
    bits: float
    family: StructureFound | None


@dataclass(frozen=True, slots=True)
class _Form:
    """A form of `Draw`: its name, its x and y, and whether Table 1 has it, however it spells a count."""

    name: str
    x: str
    y: str
    table1: bool


def sketches_by_length() -> Iterator[Sketched]:
    """All sketches up to two loops and one guard, the shortest first; equal lengths in the order of names."""
    every = [*_lattices(), *_rings(), *_hybrids()]
    yield from sorted(every, key=lambda one: (one.bits, one.name))


def _lattices() -> Iterator[Sketched]:
    plain = _Form("lattice", "??*i + ??*j", "??*i + ??*j", True)
    moved = _Form("lattice, moved", "??*i + ??*j + ??", "??*i + ??*j + ??", False)
    for form, guards in itertools.product((plain, moved), (0, 1)):
        yield _made(form, "lattice", loops=("i", "j"), guards=guards)
    yield _made(_Form("row", "??*j + ??", "??*j + ??", False), "lattice", loops=("j",))


def _rings() -> Iterator[Sketched]:
    """Single loops round a centre: x = radius * Cos(angle) + offset, and y alike with Sin."""
    curves = {"ring": ("?r", "360/?n*j"), "arc": ("?r", "?t*j"), "spiral": ("(?s*j + ?r)", "?t*j")}
    for (name, (radius, step)), phase in itertools.product(curves.items(), (False, True)):
        angle = f"{step} + ?p" if phase else step
        form = _Form(
            f"{name} with a phase" if phase else name,
            f"{radius}*Cos({angle}) + ??",
            f"{radius}*Sin({angle}) + ??",
            name != "spiral" and not phase,
        )
        yield _made(form, "circular", loops=("j",), closed=name == "ring")


def _hybrids() -> Iterator[Sketched]:
    """Rings in rings (the radius grows with i), and a ring repeated along a line (the centre moves)."""
    shapes = {
        "rings in rings": ("?r*i", "??", True),
        "rings in rings, radius free": ("(?q*i + ?r)", "??", False),
        "rings in a row": ("?r", "??*i + ??", False),
    }
    for (name, (radius, offset, table1)), phase in itertools.product(shapes.items(), (False, True)):
        angle = "360/?n*j + ?p" if phase else "360/?n*j"
        form = _Form(
            f"{name} with a phase" if phase else name,
            f"{radius}*Cos({angle}) + {offset}",
            f"{radius}*Sin({angle}) + {offset}",
            table1 and not phase,
        )
        yield _made(form, "hybrid", loops=("i", "j"), closed=True, first="1" if radius == "?r*i" else "0")


def _made(
    form: _Form,
    structure: StructureFound,
    *,
    loops: tuple[str, ...],
    guards: int = 0,
    closed: bool = False,
    first: str = "0",
) -> Sketched:
    lines = ["SetCameraPose(rx=??, ry=??)"]
    for variable in loops:
        begin = first if variable == "i" else "0"
        stop = "?n" if closed and variable == "j" else "??"
        lines.append("    " * (len(lines) - 1) + f"for {variable} in range({begin}, {stop}):")
    for _ in range(guards):
        lines.append("    " * (len(lines) - 1) + "if ??*i + ??*j >= ??:")
    lines.append("    " * (len(lines) - 1) + f"Draw(x={form.x}, y={form.y})")
    sketch = parse_sketch("\n".join(lines) + "\n")
    assert isinstance(sketch, Sketch), sketch
    numbers = len({hole.name or hole.path for hole in sketch.holes})
    bits = BITS_A_NUMBER * numbers + _BITS_A_CHOICE * (len(loops) + guards)
    bits += 0.0 if form.table1 else _BITS_BEYOND
    name = f"{form.name}, {guards} guard" if guards else form.name
    family = None if form.name.startswith(("row", "spiral")) else structure
    return Sketched(name, structure, sketch, bits, family)

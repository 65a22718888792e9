"""A program walked step by step in plain Python: which objects it draws, and where they lie.

This is the meaning of loops, guards and draws (DESIGN.md 2.2), readable at a glance and free of torch and
numpy, so that `check` and `expand` answer at once. The differentiable generator (compile.py) takes its
live indices and edges from here.

Convention: coordinates in program units (x right, y down, origin on the optical axis), angles in degrees.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from p3i.grammar.ast import Affine, Coordinate, Draw, For, If, Polar, Program, Span
from p3i.grammar.diagnostics import error
from p3i.grammar.leaves import statements
from p3i.grammar.limits import DRAWS
from p3i.grammar.parse_error import ParseError

SLACK = 1e-9
"""What rounding may cost a bound or a guard: 0.07 * 100 is 7.000000000000001 and must count as 7."""

COINCIDE = 1e-6
"""Draws closer than this, in program units, are one object."""

_RANGE_HELP = "numbers reach up to 1.7e308; write smaller ones"

Point = tuple[float, float, int, int]
"""x, y, i, j. A variable that no loop binds is 0, or 1 where an unbound `i` reads as 1."""


@dataclass(frozen=True, slots=True)
class Nest:
    """A program's loops, guards and draw, side by side."""

    for_i: For | None
    for_j: For | None
    guards: tuple[If, ...]
    draw: Draw

    @property
    def unbound_i(self) -> int:
        """The value of `i` where no loop binds it: 1 under Table 1's top-level ring, else 0."""
        ring = isinstance(self.draw.x, Polar) and isinstance(self.draw.y, Polar)
        return 1 if self.for_j is not None and ring else 0


def nest(program: Program) -> Nest:
    """The statements of a program by kind; at most one loop each, as the checker assures."""
    loops: dict[str, For] = {}
    guards: list[If] = []
    draw: Draw | None = None
    for _, statement in statements(program):
        match statement:
            case For():
                loops[statement.variable] = statement
            case If():
                guards.append(statement)
            case Draw():
                draw = statement
    assert draw is not None
    return Nest(loops.get("i"), loops.get("j"), tuple(guards), draw)


def live_indices(program: Program) -> list[tuple[int, int]]:
    """The (i, j) that are drawn, in the order of the loops, coinciding draws included.

    Raises ParseError (P122) where the loops turn more often than the limit allows.
    """
    parts = nest(program)
    guards = [statement.guard for statement in parts.guards]
    return [
        (i, j)
        for i, j in _turns(parts)
        if all(guard.i * i + guard.j * j + guard.constant >= -SLACK for guard in guards)
    ]


def points(program: Program) -> list[Point]:
    """Every draw as (x, y, i, j) in program units, in the order of the loops.

    Raises ParseError: P122 for loops that turn too often, P123 for a coordinate that overflows.
    """
    draw = nest(program).draw
    found: list[Point] = []
    for i, j in live_indices(program):
        x, y = coordinate_at(draw.x, i, j), coordinate_at(draw.y, i, j)
        if not (math.isfinite(x) and math.isfinite(y)):
            guilty = draw.y if math.isfinite(x) else draw.x
            message = f"a coordinate overflows at i = {i}, j = {j}"
            raise _refusal("P123", message, guilty.span, help=_RANGE_HELP)
        found.append((x, y, i, j))
    return found


def edges(live: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The neighbours of equation 2, as pairs of positions in `live`, each once.

    (i, j) is joined to (i + 1, j) and to (i, j + 1) where both are drawn; a ring does not wrap.
    """
    position = {index: place for place, index in enumerate(live)}
    return [
        (place, position[neighbour])
        for (i, j), place in position.items()
        for neighbour in ((i + 1, j), (i, j + 1))
        if neighbour in position
    ]


def affine_at(affine: Affine, i: int, j: int) -> float:
    """The value of an affine in double."""
    return affine.i * i + affine.j * j + affine.constant


def coordinate_at(coordinate: Coordinate, i: int, j: int) -> float:
    """The value of a coordinate, in program units; infinite or nan where it overflows."""
    if isinstance(coordinate, Affine):
        return affine_at(coordinate, i, j)
    degrees = affine_at(coordinate.angle, i, j)
    if not math.isfinite(degrees):
        return math.nan
    turn = math.cos if coordinate.function == "Cos" else math.sin
    return affine_at(coordinate.radius, i, j) * turn(math.radians(degrees)) + affine_at(
        coordinate.offset, i, j
    )


def distinct(found: Sequence[Point]) -> list[int]:
    """Positions of the points that are objects of their own: the first of those that coincide."""
    kept: list[int] = []
    buckets: dict[tuple[int, int], list[int]] = {}
    for place, (x, y, *_) in enumerate(found):
        column, row = _bucket(x), _bucket(y)
        near = (
            other
            for across in (column - 1, column, column + 1)
            for down in (row - 1, row, row + 1)
            for other in buckets.get((across, down), ())
        )
        if not any(math.hypot(x - found[other][0], y - found[other][1]) <= COINCIDE for other in near):
            buckets.setdefault((column, row), []).append(place)
            kept.append(place)
    return kept


def _bucket(value: float) -> int:
    """Which stretch of length COINCIDE holds the value; far out, where doubles lie apart, each its own."""
    stretch = value / COINCIDE
    return math.floor(stretch if math.isfinite(stretch) else value)


def on_one_line(found: Sequence[Point]) -> bool:
    """Whether all points lie on one straight line, to within a millionth of its length; no points do not."""
    if not found:
        return False
    # Products of large coordinates would overflow: all is told in the largest of them.
    unit = max(1.0, max(max(abs(x), abs(y)) for x, y, *_ in found))
    x0, y0 = found[0][0] / unit, found[0][1] / unit
    steps = [(x / unit - x0, y / unit - y0) for x, y, *_ in found]
    across, down = max(steps, key=lambda step: math.hypot(*step))
    length = math.hypot(across, down)
    if length <= COINCIDE / unit:
        return True
    tolerance = COINCIDE * max(length, 1 / unit)
    return all(abs(x * down - y * across) / length <= tolerance for x, y in steps)


def in_front(program: Program, found: Sequence[Point], *, focal_mm: float) -> list[bool]:
    """For each point, whether it lies before the camera. The canvas does not matter: its size cancels.

    The third row of Ry(ry) Rx(rx) is (-sin ry, cos ry sin rx, cos ry cos rx), the focal focal_mm / 36 of
    the longer side, which is 100 units.
    """
    rx, ry = math.radians(program.camera.rx_deg), math.radians(program.camera.ry_deg)
    focal = focal_mm / 36 * 100
    across, down = -math.sin(ry), math.cos(ry) * math.sin(rx)
    return [across * x + down * y + focal > 0 for x, y, *_ in found]


def _turns(parts: Nest) -> Iterator[tuple[int, int]]:
    """Every turn of the innermost loop, before guards."""
    limit = DRAWS.value()
    turns = 0
    for i in _range(parts.for_i, parts.unbound_i) if parts.for_i else (parts.unbound_i,):
        inner = _range(parts.for_j, i) if parts.for_j else (0,)
        turns += max(1, len(inner))
        if turns > limit:
            raise _too_many(parts.for_j, turns, limit)
        for j in inner:
            yield i, j


def _range(loop: For, i: int) -> range:
    """The whole numbers that a loop walks through."""
    ends = [affine_at(bound, i, 0) for bound in (loop.start, loop.stop)]
    if not all(math.isfinite(end) for end in ends):
        raise _refusal("P123", f"a bound of `for {loop.variable}` overflows", loop.span, help=_RANGE_HELP)
    start, stop = (math.ceil(end - SLACK) for end in ends)
    limit = DRAWS.value()
    if stop - start > limit:
        raise _too_many(loop, stop - start, limit)
    return range(start, stop)


def _too_many(loop: For | None, turns: int, limit: int) -> ParseError:
    counted = f"{turns:,}" if turns < 10**15 else "10^15"
    return _refusal(
        "P122",
        f"the loops turn at least {counted} times; the limit is {limit:,}",
        loop.span if loop else None,
        help=f"narrow the bounds, or {DRAWS.advice()}",
    )


def _refusal(code: str, message: str, span: Span | None, *, help: str) -> ParseError:
    return ParseError((error(code, message, span, help=help),))

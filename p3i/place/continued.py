"""A program continued beyond the frame of its photo: which more objects a wider picture would show.

Loops and guards bound (i, j) by straight lines. Where the photo's frame lies in the way of the next object
beyond such a bound, nothing is known of the pattern's end, and it goes on; where the next object would lie
on the photo, the pattern ends there, and goes on nowhere beyond that bound.

Convention: pixels of the photo; boxes in them are (left, top, right, bottom), their edges included.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Affine, For, Polar, Program, Statement
from p3i.interp.unroll import SLACK, Nest, nest
from p3i.place.outlines import Chart, chart_of, polygons
from p3i.place.placed import Placed
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
Box = tuple[float, float, float, float]

# The search widens the box of indices by so many at a time, up to so many objects.
_STEP = 4
_MOST = 40_000
# Cells smaller than this are too near to the horizon to be painted.
_LEAST_PX = 4.0
# A bound is the frame's doing where the frame cuts this share of the cells next to it.
_CUT = 0.5
# Of a cell, this much may lie beyond the frame before the frame is said to cut it.
_SLACK_PX = 1.0
# Rings whose step divides 360 up to this are closed.
_TURN_SLACK = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """`form` of (i, j) is >= 0 for what is drawn; `open` where the pattern may go on beyond it."""

    form: Affine
    open: bool = False

    def holds(self, index: Index) -> Mask:
        """Which (i, j) [K, 2] lie on the drawn side."""
        form = self.form
        return form.i * index[:, 0] + form.j * index[:, 1] + form.constant >= -SLACK


@dataclass(frozen=True, slots=True, eq=False)
class Continued:
    """What goes on: the `index` [K, 2] and `points` [K, 2] that come in addition, and which `bounds` open."""

    index: Index
    points: Array
    bounds: tuple[Bound, ...]


def continued(placed: Placed, canvas: Box) -> Continued:
    """The objects that continue `placed` on `canvas`, a box in the photo's pixels that holds the photo."""
    chart = chart_of(placed.pattern)
    parts = nest(placed.pattern.program)
    frame = (-0.5, -0.5, placed.size.width - 0.5, placed.size.height - 0.5)
    given = _bounds(parts)
    found: list[Bound] = []
    for bound in given:
        others = [other for other in given if other is not bound]
        cells = _next_beyond(placed, bound, others, parts)
        low, high, front = _extents(placed, chart, cells)
        cut = ~front | _sticks_out(low, high, frame)
        found.append(dataclasses.replace(bound, open=len(cells) > 0 and bool(cut.mean() >= _CUT)))
    closed = [bound for bound in found if not bound.open]
    if len(closed) == len(found):
        return Continued(np.zeros((0, 2), np.int64), np.zeros((0, 2)), tuple(found))
    index = _grown(placed, chart, closed, canvas, parts)
    low, high, front = _extents(placed, chart, index)
    wanted = front & _touches(low, high, canvas) & _sticks_out(low, high, frame)
    wanted &= (high - low).min(1) >= _LEAST_PX
    index = index[wanted]
    points = placed.at(index)
    fresh = _fresh(points, placed.points)
    _, first = np.unique(np.rint(points * 1e3), axis=0, return_index=True)  # turns that coincide are one
    fresh &= np.isin(np.arange(len(points)), first)
    return Continued(index[fresh], points[fresh], tuple(found))


def widened(program: Program, index: Index) -> Program | None:
    """`program` with ranges that also hold `index` [K, 2]; None where a guard or a leaning bound forbids."""
    parts = nest(program)
    loops = [loop for loop in (parts.for_i, parts.for_j) if loop is not None]
    leaning = any(bound.i or bound.j for loop in loops for bound in (loop.start, loop.stop))
    if not len(index):
        return program
    if leaning or parts.guards:
        return None

    def change(statement: Statement) -> Statement:
        if not isinstance(statement, For):
            return statement
        values = index[:, 0 if statement.variable == "i" else 1]
        start = min(statement.start.constant, float(values.min()))
        stop = max(statement.stop.constant, float(values.max()) + 1)
        return dataclasses.replace(
            statement,
            start=dataclasses.replace(statement.start, constant=start),
            stop=dataclasses.replace(statement.stop, constant=stop),
            body=change(statement.body),  # pyright: ignore[reportArgumentType]
        )

    return dataclasses.replace(program, world=change(program.world))


def _bounds(parts: Nest) -> list[Bound]:
    """What the loops and guards ask of (i, j); a loop's stop is the last number that it reaches."""
    found = [guard.guard for guard in parts.guards]
    for variable, loop in (("i", parts.for_i), ("j", parts.for_j)):
        if loop is None:
            continue
        one = Affine(i=float(variable == "i"), j=float(variable == "j"))
        start, stop = loop.start, loop.stop
        found.append(Affine(one.i - start.i, one.j - start.j, -start.constant))
        # k < stop is k <= stop - 1 for whole stops, and no worse than a part of a step off for others.
        found.append(Affine(stop.i - one.i, stop.j - one.j, stop.constant - 1))
    return [Bound(form) for form in found]


def _next_beyond(placed: Placed, bound: Bound, others: list[Bound], parts: Nest) -> Index:
    """The (i, j) one step from a drawn object, on the far side of `bound` and of no other."""
    steps = [(1, 0), (-1, 0)] * (parts.for_i is not None) + [(0, 1), (0, -1)] * (parts.for_j is not None)
    beside = np.unique(
        np.concatenate([placed.index + np.array(step, np.int64) for step in steps]), axis=0
    ).reshape(-1, 2)
    beside = beside[~bound.holds(beside) & _inside(beside, others)]
    return beside[_fresh(placed.at(beside), placed.points)] if len(beside) else beside


def _extents(placed: Placed, chart: Chart, index: Index) -> tuple[Array, Array, Mask]:
    """The boxes of cells on the photo: low and high corners [K, 2], and which lie in front wholly [K]."""
    if not len(index):
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, bool)
    corners = polygons(chart, index)
    pixels, front = project(placed.image_from_plane, corners)
    return pixels.min(1), pixels.max(1), np.asarray(front.all(1))


def _sticks_out(low: Array, high: Array, box: Box) -> Mask:
    """Which boxes do not lie inside `box` wholly."""
    return np.asarray(
        (low < np.array(box[:2]) - _SLACK_PX).any(1) | (high > np.array(box[2:]) + _SLACK_PX).any(1)
    )


def _touches(low: Array, high: Array, box: Box) -> Mask:
    """Which boxes share a pixel with `box`."""
    return np.asarray((low <= np.array(box[2:])).all(1) & (high >= np.array(box[:2])).all(1))


def _grown(placed: Placed, chart: Chart, closed: list[Bound], canvas: Box, parts: Nest) -> Index:
    """The (i, j) inside the bounds that stay, in a box that has grown until nothing more is in sight."""
    low, high = placed.index.min(0), placed.index.max(0)
    axes = [axis for axis, loop in ((0, parts.for_i), (1, parts.for_j)) if loop is not None]
    grew = True
    while grew and int(np.prod(high - low + 1)) < _MOST:
        grew = False
        for axis in axes:
            unit = (np.arange(2) == axis).astype(np.int64)
            for end in (-1, 1):
                room = _most_turns(parts, axis) - int(high[axis] - low[axis] + 1)
                step = int(min(_STEP, max(0, room))) * unit
                wider_low, wider_high = (low - step, high) if end < 0 else (low, high + step)
                slab = _box(wider_low, wider_high)
                fresh = (slab[:, axis] < low[axis]) | (slab[:, axis] > high[axis])
                slab = slab[fresh & _inside(slab, closed)]
                first, last, front = _extents(placed, chart, _sound(slab, parts))
                seen = front & _touches(first, last, canvas)
                if (seen & ((last - first).min(1) >= _LEAST_PX)).any():
                    low, high, grew = np.minimum(low, wider_low), np.maximum(high, wider_high), True
    index = _box(low, high)
    return _sound(index[_inside(index, closed)], parts)


def _inside(index: Index, bounds: list[Bound]) -> Mask:
    """Which (i, j) [K, 2] all bounds hold."""
    return np.all([np.ones(len(index), bool), *(bound.holds(index) for bound in bounds)], axis=0)


def _box(low: Index, high: Index) -> Index:
    """All (i, j) of a box, its ends included."""
    columns, rows = np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)
    return np.stack(np.meshgrid(columns, rows, indexing="ij"), -1).reshape(-1, 2).astype(np.int64)


def _sound(index: Index, parts: Nest) -> Index:
    """Those whose ring has a radius on the side where the drawn ones have theirs: above 0."""
    radii = [form.radius for form in (parts.draw.x, parts.draw.y) if isinstance(form, Polar)]
    for radius in radii:
        if radius.i or radius.j:
            index = index[radius.i * index[:, 0] + radius.j * index[:, 1] + radius.constant > 1e-6]
    return index


def _most_turns(parts: Nest, axis: int) -> float:
    """How many steps of a variable go once round: inf where it does not turn, or moves outwards too."""
    for form in (parts.draw.x, parts.draw.y):
        if isinstance(form, Polar):
            turn = (form.angle.i, form.angle.j)[axis]
            outwards = (form.radius.i, form.radius.j)[axis]
            if turn and not outwards:
                return max(1, int(np.floor(360 / abs(turn) + _TURN_SLACK)))
    return np.inf


def _fresh(points: Array, drawn: Array) -> Mask:
    """Which points [K, 2] no drawn object [M, 2] holds already."""
    if not len(points):
        return np.zeros(0, bool)
    apart = np.abs(points[:, None] - drawn[None]).max(2).min(1)
    return apart > 1e-3

"""A program continued over unknown ground: which more objects there are where the photo shows nothing.

Unknown is what lies beyond the frame and what is hidden in the photo: holes, what is transparent or masked.
Loops and guards bound (i, j) by straight lines. Beyond each such bound the pattern goes on line by line, as
long as what the photo shows of the next line does not speak against it: a line that is hidden or cut off
wholly says nothing, and one that is seen in part says what that part shows. So an outline that is seen beside
a hole goes straight on through it, and one that ends where the hole begins does not.

Convention: pixels of the photo; boxes in them are (left, top, right, bottom), their edges included.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Affine, For, Polar, Program, Statement
from p3i.interp.unroll import SLACK, Nest, nest
from p3i.place.moves import nearest
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed
from p3i.place.presence import bits_of
from p3i.vision.image import Image, masked
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
Box = tuple[float, float, float, float]

# The search widens the box of indices by so many, then twice as many each time, up to so many objects.
_STEP = 4
_MOST = 10_000
# Cells smaller than this are too near to the horizon to be painted.
_LEAST_PX = 4.0
# A cell is looked at in so many places a side.
_LOOKS = 7
# A line of cells is as the program has it where the photo shows this share of them wholly.
_SEEN = 0.5
# What lies nearer to an object than this, in distances to the next, is in its cell, if to no other nearer.
_IN_CELL = 0.75
# Rings whose step divides 360 up to this are closed.
_TURN_SLACK = 0.1

AGAINST_BITS = 3.0
"""A line of cells ends the pattern where what is seen of it says, 8 to 1, that no objects are there."""


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """`form` of (i, j) is >= 0 for what is drawn, and as far as -`reach` for what is continued."""

    form: Affine
    reach: float = 0.0

    def beyond(self, index: Index) -> Array:
        """How far each (i, j) [K, 2] lies beyond what is drawn: [K], 0 and below where it does not."""
        form = self.form
        return -(form.i * index[:, 0] + form.j * index[:, 1] + form.constant)

    def holds(self, index: Index) -> Mask:
        """Which (i, j) [K, 2] lie on the side that is drawn or continued."""
        return self.beyond(index) <= self.reach + SLACK


@dataclass(frozen=True, slots=True, eq=False)
class Continued:
    """What goes on: the `index` [K, 2] and `points` [K, 2] that come in addition, and the `bounds` moved."""

    index: Index
    points: Array
    bounds: tuple[Bound, ...]

    def notes(self) -> list[str]:
        """A sentence where something goes on through a hole of the photo."""
        count = len(self.index)
        if not count:
            return []
        what = "object is" if count == 1 else "objects are"
        return [f"the pattern goes on through the hole: {count} {what} added that the program does not draw"]

    def joined(self, laid: Placed) -> Placed:
        """The program with what goes on behind its own objects."""
        return dataclasses.replace(
            laid,
            index=np.concatenate([laid.index, self.index]),
            points=np.concatenate([laid.points, self.points]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A program on a photo that is `valid` [H, W] with a `hole` [H, W], and the `canvas` around it."""

    laid: Placed
    valid: Mask
    hole: Mask
    canvas: Box


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """Of each cell [K]: the share that the photo shows (`seen`), and that lies where objects are `asked` for.

    `in_sight` [K]: which have a part on photo or canvas and are large enough to be painted.
    """

    seen: Array
    asked: Array
    in_sight: Mask


def continued(
    laid: Placed, photo: Image, *, hole: Mask | None = None, canvas: Box | None = None
) -> Continued:
    """The objects that continue `laid` over a `hole` [H, W] of the photo, and on a `canvas` around it.

    `photo` is flat, as `laid` is; what is not valid of it is unknown as well. The canvas is a box in the
    photo's pixels, without it the photo. Objects come in where their cells have a part in the hole or beyond
    the frame.
    """
    frame = (-0.5, -0.5, laid.size.width - 0.5, laid.size.height - 0.5)
    view = _View(laid, photo.valid, np.zeros_like(photo.valid) if hole is None else hole, canvas or frame)
    bounds = tuple(Bound(form) for form in _forms(nest(laid.pattern.program)))
    index = np.zeros((0, 2), np.int64)
    if view.hole.any() or view.canvas != frame:
        index = _around(view)
        index = index[_fresh(laid, index)]
    shown = _shown(view, index)
    if not shown.asked.any():
        return Continued(np.zeros((0, 2), np.int64), np.zeros((0, 2)), bounds)
    whole, bits = shown.seen > 1 - 1e-9, np.zeros(len(index))
    # What is seen is looked at only where the pattern could go on at all: near a horizon cells are many.
    free = _inside(index, _moved(bounds, index, bits, whole))
    told = free & (shown.seen > 0)
    found = bits_of(laid, masked(photo, view.hole), index[told]) if told.any() else None
    if found is not None:
        bits[told] = found
    bounds = _moved(bounds, index, bits, whole)
    return _distinct(laid, index[free & _inside(index, bounds) & (shown.asked > 0)], bounds)


def followed(laid: Placed, other: Placed, more: Continued) -> Continued:
    """The objects that continue `laid` where `more` did `other`, another program of the same photo.

    `other` ends with those that came in. Line by line beyond each bound, as far as most of a line lies in
    cells of these: of a pattern that is yet to be laid, what the photo shows tells nothing. A program with
    the bounds of the other goes on as far.
    """
    forms = tuple(_forms(nest(laid.pattern.program)))
    everywhere = np.ones((laid.size.height, laid.size.width), bool)
    frame = (-0.5, -0.5, laid.size.width - 0.5, laid.size.height - 0.5)
    index = _around(_View(laid, everywhere, ~everywhere, frame))
    index = index[_fresh(laid, index)]
    points = laid.at(index)
    number = nearest(other, points)
    away = np.hypot(*(points - other.points[number]).T)
    there = number >= len(other.index) - len(more.index)
    there &= away < _IN_CELL * pitch(chart_of(other.pattern))
    bounds = more.bounds
    if forms != tuple(bound.form for bound in bounds):
        bounds = _moved(tuple(Bound(form) for form in forms), index, np.zeros(len(index)), ~there)
    return _distinct(laid, index[there & _inside(index, bounds)], bounds)


def _distinct(laid: Placed, index: Index, bounds: tuple[Bound, ...]) -> Continued:
    """What goes on, turns of a ring that coincide as one."""
    points = laid.at(index)
    _, first = np.unique(np.rint(points * 1e3), axis=0, return_index=True)
    first = np.sort(first)
    return Continued(index[first], points[first], bounds)


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


def _forms(parts: Nest) -> list[Affine]:
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
    return found


def _moved(bounds: tuple[Bound, ...], index: Index, bits: Array, seen: Mask) -> tuple[Bound, ...]:
    """The bounds moved outwards over undrawn cells [K, 2], as far as what is seen does not speak against.

    Half a line of cells wholly `seen` [K] is as the program has it: whoever wrote it saw that no objects are
    there. Of others what there is counts, by its `bits` [K]. Each bound in turn given the others, until none
    moves.
    """
    found = list(bounds)
    moved = True
    while moved:
        moved = False
        for number, bound in enumerate(found):
            others = (*found[:number], *found[number + 1 :])
            free = _inside(index, others) & ~bound.holds(index)
            levels = np.round(bound.beyond(index[free]), 6)
            reach = bound.reach
            for level in np.unique(levels):
                line = levels == level
                if seen[free][line].mean() >= _SEEN or bits[free][line].sum() <= -AGAINST_BITS:
                    break
                reach = float(level)
            if reach > bound.reach:
                found[number], moved = dataclasses.replace(bound, reach=reach), True
    return tuple(found)


def _shown(view: _View, index: Index) -> _Shown:
    """What there is of each cell of `index` [K, 2], looked at in a grid of places."""
    chart = chart_of(view.laid.pattern)
    ticks = (np.arange(_LOOKS) + 0.5) / _LOOKS - 0.5
    place = np.zeros((len(index), _LOOKS, _LOOKS, 4))
    place[..., :2] = index[:, None, None]
    place[..., chart.axes] += np.stack(np.meshgrid(ticks, ticks, indexing="ij"), -1)
    points = chart.at(place.reshape(-1, 4)).reshape(*place.shape[:3], 2)
    at, front = project(view.laid.image_from_plane, points)
    steps = [
        np.linalg.norm(at[:, -1] - at[:, 0], axis=-1),
        np.linalg.norm(at[:, :, -1] - at[:, :, 0], axis=-1),
    ]
    sides = [step.max(1, initial=0) * _LOOKS / (_LOOKS - 1) for step in steps]
    large = front.all((1, 2)) & (np.minimum(*sides) >= _LEAST_PX)
    height, width = view.valid.shape
    at = np.where(front[..., None], at, -1e9)
    pixel = np.rint(at)
    in_frame: Mask = np.asarray((pixel >= 0).all(-1) & (pixel <= np.array([width - 1, height - 1])).all(-1))
    columns, rows = np.moveaxis(np.where(in_frame[..., None], pixel, 0).astype(np.int64), -1, 0)
    in_hole = in_frame & view.hole[rows, columns]
    seen = in_frame & view.valid[rows, columns] & ~in_hole
    on_canvas = (at >= np.array(view.canvas[:2])).all(-1) & (at <= np.array(view.canvas[2:])).all(-1)
    asked = in_hole | (on_canvas & ~in_frame)
    shares = [one.mean((1, 2)) for one in (seen, asked, in_frame | on_canvas)]
    return _Shown(shares[0], shares[1], large & (shares[2] > 0))


def _around(view: _View) -> Index:
    """All (i, j) with a cell in sight, in a box that has grown until nothing more is."""
    parts = nest(view.laid.pattern.program)
    low, high = view.laid.index.min(0), view.laid.index.max(0)
    drawn = high - low + 1
    loops = [axis for axis, loop in ((0, parts.for_i), (1, parts.for_j)) if loop is not None]
    axes = [axis for axis in loops if _moves(view.laid, axis)]
    room = [[_most_turns(parts, axis) - int(drawn[axis])] * 2 for axis in (0, 1)]  # once round, either way
    grew, step = True, _STEP // 2
    while grew and int(np.prod(high - low + 1)) < _MOST:
        grew, step = False, 2 * step
        for axis in axes:
            unit = (np.arange(2) == axis).astype(np.int64)
            for end in (0, 1):
                count = int(min(step, max(0, room[axis][end])))
                wider = (low - count * unit, high) if end == 0 else (low, high + count * unit)
                slab = _box(*wider)
                slab = slab[(slab[:, axis] < low[axis]) | (slab[:, axis] > high[axis])]
                if _shown(view, _sound(slab, parts)).in_sight.any():
                    low, high, grew = *wider, True
                    room[axis][end] -= count
    index = _sound(_box(low, high), parts)
    return index[_shown(view, index).in_sight]


def _moves(laid: Placed, axis: int) -> bool:
    """Whether a step of a loop variable, 0 for i and 1 for j, moves what is drawn."""
    step = (np.arange(2) == axis).astype(np.int64)
    return bool((np.abs(laid.at(laid.index + step) - laid.points) > 1e-6).any())


def _inside(index: Index, bounds: tuple[Bound, ...]) -> Mask:
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


def _fresh(laid: Placed, index: Index) -> Mask:
    """Which (i, j) [K, 2] lie where no drawn object does: rings meet themselves."""
    points = laid.at(index)
    return np.asarray(np.abs(points - laid.points[nearest(laid, points)]).max(1) > 1e-3)

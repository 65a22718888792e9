"""Names for the objects of a program, as people say them: A1 to H12 on a board, 1 to 12 on a clock.

Rows are letters from top to bottom, columns numbers from left to right, by the two directions of the program
as the photo shows them. On rings the letter is the ring, from the inside out, and the numbers run clockwise
from the top. All objects of the program are counted, seen or not, so a name does not hang on what is listed.
"""

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np

from p3i.grammar.ast import Polar
from p3i.interp.unroll import nest
from p3i.place.placed import Placed
from p3i.vision.sheet import project

Arrangement = Literal["grid", "ring", "rings", "curve"]

_OPEN = 1.6
"""A ring whose widest gap is this many times its usual one is an arc, and begins after that gap."""
_SAME = 1e-6
_HALF = 0.2
"""Rows whose shift is so near to a half step, in half steps, are those of bricks."""


@dataclass(frozen=True, slots=True, eq=False)
class Naming:
    """The row and column [M] of each object, from 0, and its name; `arrangement` says what rows are.

    In a "grid" rows and columns are those of the photo; in "rings" a row is a ring and a column a place on
    it; a "ring" and a "curve" (a spiral, counted from its first object) are one row. `outward` [M, 2] points
    from the middle of each object's ring to it, on the plane, with length 1; None in a grid.
    """

    arrangement: Arrangement
    rows: np.ndarray
    columns: np.ndarray
    names: tuple[str, ...]
    outward: np.ndarray | None = None


def named(placed: Placed) -> Naming:
    """The names of the objects of `placed`, in their order there."""
    turning = _turning(placed)
    if turning is None:
        return _grid(placed)
    away = placed.points - _middles(placed, placed.index.astype(float))
    length = np.linalg.norm(away, axis=1, keepdims=True)
    outward = np.where(length > _SAME, away / np.maximum(length, _SAME), (0.0, -1.0))
    return dataclasses.replace(_round(placed, turning), outward=outward)


def _round(placed: Placed, turning: int) -> Naming:
    """Names on a ring, on rings, or along a curve whose loop variable `turning` goes round."""
    parts = nest(placed.pattern.program)
    loops = [loop is not None for loop in (parts.for_i, parts.for_j)]
    if not loops[1 - turning]:
        if _grows(placed, turning):
            return _numbered("curve", np.zeros(len(placed.index), np.int64), placed.index[:, turning])
        columns = _clockwise(placed, np.arange(len(placed.index)))
        return _numbered("ring", np.zeros(len(columns), np.int64), columns)
    rows = _ring_order(placed, 1 - turning)
    columns = np.zeros(len(rows), np.int64)
    for row in range(int(rows.max(initial=-1)) + 1):
        ring = np.flatnonzero(rows == row)
        columns[ring] = _clockwise(placed, ring)
    return _numbered("rings", rows, columns)


def letters(row: int) -> str:
    """A, B, ... Z, AA, AB, ... for rows from 0."""
    text = ""
    row += 1
    while row:
        row, digit = divmod(row - 1, 26)
        text = chr(65 + digit) + text
    return text


def _numbered(arrangement: Arrangement, rows: np.ndarray, columns: np.ndarray) -> Naming:
    columns = columns - columns.min()
    lettered = arrangement in ("grid", "rings")
    names = [
        f"{letters(row) if lettered else ''}{column + 1}"
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    ]
    return Naming(arrangement, rows, columns, tuple(names))


def _grid(placed: Placed) -> Naming:
    along = [_seen_direction(placed, variable) for variable in (0, 1)]
    # The pairing that agrees more with right and down; i runs along the rows where both do alike.
    straight = abs(along[0][0]) + abs(along[1][1])
    crossed = abs(along[1][0]) + abs(along[0][1])
    across, down = (1, 0) if crossed > straight + _SAME else (0, 1)
    signs = {
        variable: -1 if along[variable][axis] < -_SAME else 1 for variable, axis in ((down, 1), (across, 0))
    }
    rows, columns = (signs[variable] * placed.index[:, variable] for variable in (down, across))
    rows = rows - rows.min()
    shift = _shift(placed, across) * signs[across] * signs[down]
    return _numbered("grid", rows, columns + np.floor(shift * rows + _SAME).astype(np.int64))


def _shift(placed: Placed, across: int) -> float:
    """By how much of a step each row starts further along than the one before: whole halves, as of bricks.

    Numbers then run down the wall, not along the diagonal: every other row begins half a step to the right.
    A shift that is no half (a keyboard's, or a wrong focal's) is none.
    """
    basis = placed.basis
    if basis is None:
        return 0.0
    step, down = basis[across], basis[1 - across]
    shift = float(step @ down) / float(step @ step)
    return round(2 * shift) / 2 if abs(2 * shift - round(2 * shift)) < _HALF else 0.0


def _seen_direction(placed: Placed, variable: int) -> np.ndarray:
    """The mean direction [2], of length 1 at most, in which a loop variable grows on the photo."""
    seen = placed.in_sight()
    index = (placed.index[seen] if seen.any() else placed.index).astype(float)
    half = np.zeros(2)
    half[variable] = 0.25
    (before, front), (after, ahead) = (
        project(placed.image_from_plane, placed.at(index + step)) for step in (-half, half)
    )
    steps = (after - before)[front & ahead]
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    return (steps / np.maximum(lengths, 1e-12)).sum(axis=0) / max(len(steps), 1)


def _turning(placed: Placed) -> int | None:
    """The loop variable that goes round, 0 for i and 1 for j; None where the objects stand in rows."""
    draw = nest(placed.pattern.program).draw
    if not (isinstance(draw.x, Polar) and isinstance(draw.y, Polar)):
        return None
    turns = [max(abs(getattr(form.angle, name)) for form in (draw.x, draw.y)) for name in ("i", "j")]
    return None if max(turns) == 0 else int(turns[1] > 0)


def _grows(placed: Placed, variable: int) -> bool:
    """Whether radius or middle change along the loop that goes round: a spiral, no ring."""
    draw = nest(placed.pattern.program).draw
    name = "ij"[variable]
    forms = [form for form in (draw.x, draw.y) if isinstance(form, Polar)]
    return any(getattr(form.radius, name) != 0 or getattr(form.offset, name) != 0 for form in forms)


def _middles(placed: Placed, index: np.ndarray) -> np.ndarray:
    """The middle [K, 2] of the ring that each of `index` [K, 2] lies on."""
    draw = nest(placed.pattern.program).draw
    offsets = [
        form.offset.i * index[:, 0] + form.offset.j * index[:, 1] + form.offset.constant
        for form in (draw.x, draw.y)
        if isinstance(form, Polar)
    ]
    return np.stack(offsets, axis=1)


def _ring_order(placed: Placed, variable: int) -> np.ndarray:
    """The ring [M] of each object: from the inside out, or as the photo shows them where all are as wide."""
    steps = placed.index[:, variable]
    kinds, rows = np.unique(steps, return_inverse=True)
    radii = np.linalg.norm(placed.points - _middles(placed, placed.index.astype(float)), axis=1)
    sizes = np.array([radii[rows == row].mean() for row in range(len(kinds))])
    if np.ptp(sizes) > _SAME * max(1.0, float(sizes.max())):
        order = np.argsort(sizes, kind="stable")
    else:
        along = _seen_direction(placed, variable)
        backwards = along[int(abs(along[1]) > abs(along[0]))] < -_SAME
        order = np.arange(len(kinds))[::-1] if backwards else np.arange(len(kinds))
    place = np.empty(len(kinds), np.int64)
    place[order] = np.arange(len(kinds))
    return place[rows]


def _clockwise(placed: Placed, ring: np.ndarray) -> np.ndarray:
    """The place [K], from 0, of the objects at `ring` [K] on their ring: clockwise, from the topmost.

    The first is the object that lies nearest to straight above the middle; on an arc it is the first one.
    """
    points = placed.points[ring]
    middles = _middles(placed, placed.index[ring].astype(float))
    seen, front = project(placed.image_from_plane, np.concatenate([points, middles]))
    if front.all():
        points, middles = seen[: len(ring)], seen[len(ring) :]
    away = points - middles
    from_top = np.degrees(np.arctan2(away[:, 0], -away[:, 1])) % 360
    order = np.argsort(from_top, kind="stable")
    turns = from_top[order]
    gaps = np.diff(turns, append=turns[:1] + 360)
    if len(ring) > 2 and gaps.max() > _OPEN * np.median(gaps):
        first = (int(gaps.argmax()) + 1) % len(ring)
    else:
        first = int(np.round(np.minimum(turns, 360 - turns), 6).argmin()) if len(ring) else 0
    place = np.empty(len(ring), np.int64)
    place[np.roll(order, -first)] = np.arange(len(ring))
    return place

"""Is the object there? Each object's cell compared with what the cells share and with its neighbours.

The cells are read off the photo side by side, in the program's own coordinates: parallelograms of a lattice
and sectors of rings become squares. What each says for an object, in bits, is told as the search tells it
where it looks for the extent (p3i.vision.cell_bits): an object is there where the bits speak for it, and not
where its place is empty or covered by something else.

Convention: pixels of the photo, pixel centres at whole numbers; `index` [K, 2] holds (i, j).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Program
from p3i.place.flat import flat_of
from p3i.place.outlines import Chart, chart_of
from p3i.place.placed import Placed, placed
from p3i.vision.alike import alike_in
from p3i.vision.cell_bits import TOWARDS, CellBits, cell_bits
from p3i.vision.cells import cut
from p3i.vision.image import Image, resized
from p3i.vision.sheet import Box, Sheet, project, sampled, sheet_points

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

THERE = 0.5
"""An object whose presence is at least this is there: its bits speak for it."""

_SIDES = (8, 24)
"""Samples along the side of a cell: at least, at most."""
_SAMPLES = 3_000_000
"""Of a sheet, at most about this many."""
_FEWEST = 3
"""With fewer objects than this there is no telling what is common to them."""


def absent_of(program: Program, photo: Image, *, focal_mm: float | None = None) -> tuple[int, int]:
    """How many objects of `program` the photo does not show where they are drawn, and of how many in it.

    Objects that cannot be judged are not among the first. `focal_mm` counts where the program's header names
    none.
    """
    inside = placed(program, photo, focal_mm=focal_mm).in_sight()
    flat = flat_of(photo, program, focal_mm=focal_mm)
    scores = presence_of(flat.placed, flat.photo, flat.placed.index[inside])
    return int((scores < THERE).sum()), int(inside.sum())


def presence_of(laid: Placed, photo: Image, index: np.ndarray) -> Array:
    """How probably the photo shows each object of `index` [K, 2]: [K] in 0..1, nan where it cannot be judged.

    `photo` is flat, as `laid` is (flat.py).
    """
    unknown = np.full(len(index), np.nan)
    found = _read(laid, photo, index, index)
    if found is None:
        return unknown
    if found.bits is None:  # nothing to see
        return np.where(found.seen, 0.0, np.nan)
    halves = _by_halves(found.bits, found.drawn)
    scores = 1 / (1 + 2.0 ** -np.maximum(found.bits.whole, halves)[found.place])
    return np.where(found.bits.judged[found.place], scores, np.nan) if found.enough else unknown


def bits_of(laid: Placed, photo: Image, asked: np.ndarray) -> Array | None:
    """The bits [K] that the photo says for an object at each (i, j) of `asked` [K, 2], drawn or not.

    0 where nothing is known of it; None where there is no telling at all. What an object looks like is told
    by those that `laid` draws; `photo` is flat, as `laid` is.
    """
    inside = laid.in_sight()
    found = _read(laid, photo, laid.index[inside], asked)
    if found is None or found.bits is None or not found.enough:
        return None
    return np.where(found.bits.judged, found.bits.whole, 0.0)[found.place]


@dataclass(frozen=True, slots=True, eq=False)
class _Read:
    """What cells side by side say: their `bits`, None where there is nothing to see.

    `drawn` [R, C] are 1 where objects are; `place` [K] is where those asked for stand, `seen` [K] whether the
    photo shows them at all; `enough` of the drawn ones can be judged.
    """

    bits: CellBits | None
    drawn: Floats
    place: NDArray[np.int64]
    seen: Mask
    enough: bool


def _read(laid: Placed, photo: Image, index: np.ndarray, asked: np.ndarray) -> _Read | None:
    """The cells of the objects `index` [M, 2] and those `asked` [K, 2]; None where they cannot be read."""
    chart = replace(chart_of(laid.pattern), upright=laid.pattern.upright)
    if len(index) < _FEWEST or not chart.directions:
        return None
    sheet = sheet_of(laid, photo, chart, np.concatenate([index, asked]))
    if sheet is None:
        return None
    own, place = (_position(chart, sheet.box, one) for one in (index, asked))
    drawn = np.zeros(sheet.box.count, np.float32)
    drawn[own] = 1
    alike = alike_in(sheet, drawn)
    seen = cut(sheet.seen, sheet.side).mean(axis=(1, 2))[place] > 0
    bits = None if alike is None else cell_bits(alike)
    enough = bits is not None and int(bits.judged[own].sum()) >= _FEWEST
    return _Read(bits, drawn.reshape(sheet.box.rows, sheet.box.columns), place, seen, enough)


def _by_halves(found: CellBits, drawn: Floats) -> Array:
    """The bits [N] of the halves that face drawn neighbours [R, C] where none is drawn on the other side.

    At the rim of a board the other half is another ground.
    """
    around = np.pad(drawn, 1) > 0
    rows, columns = drawn.shape

    def beside(i: int, j: int) -> Mask:
        return around[1 + j : 1 + j + rows, 1 + i : 1 + i + columns].ravel()

    facing = [beside(i, j) & ~beside(-i, -j) for i, j in TOWARDS]
    return np.where(np.stack(facing), found.halves, -np.inf).max(axis=0)


def sheet_of(laid: Placed, photo: Image, chart: Chart, index: np.ndarray) -> Sheet | None:
    """The cells at `index` [N, 2], those between and around too, side by side; None for too many."""
    box = _box(chart, index)
    side = int(np.clip(np.sqrt(_SAMPLES / box.count) // 2 * 2, 0, _SIDES[1]))
    if side < _SIDES[0]:
        return None
    pixels, valid, matrix = _reduced(laid, photo, chart, index, side)
    at, front = _seen_at(chart, matrix, sheet_points(box, side))
    steps = [np.linalg.norm(np.gradient(at, axis=axis), axis=-1) for axis in (0, 1)]
    spacing = np.where(front, np.maximum(*steps), 1.0)
    return sampled(pixels, valid, at, front, spacing, box=box, side=side)


def _box(chart: Chart, index: np.ndarray) -> Box:
    """The box of the cells of `index` and one more all around; one row where there is one direction only."""
    low, high = index.min(axis=0) - 1, index.max(axis=0) + 2
    if len(chart.directions) == 2:
        return Box(int(low[0]), int(high[0]), int(low[1]), int(high[1]))
    variable = chart.directions[0]
    return Box(int(low[variable]), int(high[variable]), 0, 1)


def _position(chart: Chart, box: Box, index: np.ndarray) -> NDArray[np.int64]:
    """The cell of the box [K] of each (i, j)."""
    if len(chart.directions) == 2:
        return (index[:, 1] - box.j_start) * box.columns + index[:, 0] - box.i_start
    return index[:, chart.directions[0]] - box.i_start


def _seen_at(chart: Chart, matrix: Array, points: Array) -> tuple[Array, Mask]:
    """Places of the sheet [..., 2] on the photo."""
    flat = points.reshape(-1, 2)
    place = np.zeros((len(flat), 4))
    place[:, chart.axes] = flat
    at, front = project(matrix, chart.at(place))
    return at.reshape(points.shape), front.reshape(points.shape[:-1])


def _reduced(
    laid: Placed, photo: Image, chart: Chart, index: np.ndarray, side: int
) -> tuple[Floats, Mask, Array]:
    """The photo no larger than the sheet can use, and the matrix from the plane to its pixels."""
    place = np.zeros((len(index), 4))
    place[:, :2] = index
    ends = []
    for axis in chart.axes:
        move = np.zeros(4)
        move[axis] = 0.25
        (before, front), (after, ahead) = (
            project(laid.image_from_plane, chart.at(place + sign * move)) for sign in (-1, 1)
        )
        ends.append(np.where(front & ahead, np.linalg.norm(after - before, axis=1) * 2, np.nan))
    # The largest cells decide: the smaller ones keep what they have.
    largest = float(np.nanquantile(np.stack(ends), 0.9)) if np.isfinite(ends).any() else 1.0
    scale = max(1.0, largest / (1.5 * side))
    small = resized(photo, max(1, round(photo.size.longer / scale)))
    scale = photo.size.longer / small.size.longer
    shift = (1 / scale - 1) / 2
    small_from_photo = np.array([[1 / scale, 0, shift], [0, 1 / scale, shift], [0, 0, 1.0]])
    return small.pixels, small.valid, small_from_photo @ laid.image_from_plane

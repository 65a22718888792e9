"""A picture seen anew through any smooth map, as sharp as it is and free of aliasing, in bounded memory.

Convention: a *view* is what is made, the *source* what it is read from; pixel centres at whole numbers. The
map says where the view's pixels lie in the source. The view is made tile by tile. Where a tile shrinks the
source it is sampled several times finer, axis by axis, and reduced by a windowed sinc whose cut-off is that
of the view; elsewhere the source is read by Lanczos-4 directly. OpenCV rounds points to 1/32 pixel.
"""

import math
from collections.abc import Callable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.size import Size

Floats = NDArray[np.floating]
Mask = NDArray[np.bool_]
Points = Callable[[Floats, Floats], tuple[Floats, Floats, Mask]]
"""The map: x [w] and y [h] of view pixels -> source x [h, w], y [h, w], and which are known at all [h, w]."""

_TILE = 256
"""Side of a tile, in pixels of the view."""

_LOBES = 2
"""The sinc that reduces a finer tile reaches this many pixels of the view to each side."""

_SLACK = 0.15
"""A view that shrinks the source by less than this is not worth a second sample."""

_MOST_SAMPLES = 32
"""No pixel takes more samples than this along an axis: beyond lies the horizon, or a thumbnail."""

_TILE_SAMPLES = 1024
"""A tile whose side would take more samples than this is cut into four."""


def resample(
    pixels: NDArray[np.float32],
    alpha: NDArray[np.float32] | None,
    points: Points,
    *,
    size: Size,
    bits: int = 8,
) -> tuple[NDArray, NDArray | None]:
    """The view of `size`: whole numbers of `bits` (8 or 16) [h, w, 3], and their alpha [h, w].

    `pixels` [H, W, 3] and `alpha` [H, W] (None: all known) are in 0..1, alpha is plain. The view's alpha is 0
    where the map leads to nothing, and the colours are 0 there; it is None where everything is known.
    """
    top = 2**bits - 1
    kind = np.uint8 if bits == 8 else np.uint16
    values = np.zeros((size.height, size.width, 3), kind)
    opacity = np.zeros((size.height, size.width), kind)
    source = pixels if alpha is None else np.dstack([pixels * alpha[:, :, None], alpha])
    halvings = _halvings(points, size)
    for _ in range(halvings):
        source = _halved(source)
    waiting = list(tiles(size))
    while waiting:
        rows, columns = waiting.pop()
        samples = _samples(points, rows, columns, halvings)
        longer = max((columns.stop - columns.start) * samples[0], (rows.stop - rows.start) * samples[1])
        if longer > _TILE_SAMPLES and max(columns.stop - columns.start, rows.stop - rows.start) > 16:
            waiting += _quarters(rows, columns)
            continue
        colour, seen = _tile(source, points, rows, columns, samples=samples, halvings=halvings)
        values[rows, columns] = colour * np.float32(top) + np.float32(
            0.5
        )  # to the nearest, as all is positive
        opacity[rows, columns] = seen * np.float32(top) + np.float32(0.5)
    return values, None if (opacity == top).all() else opacity


def tiles(size: Size, side: int = _TILE) -> Iterator[tuple[slice, slice]]:
    """The tiles of a view, as slices of rows and columns, row by row."""
    for first_row in range(0, size.height, side):
        for first_column in range(0, size.width, side):
            yield (
                slice(first_row, min(size.height, first_row + side)),
                slice(first_column, min(size.width, first_column + side)),
            )


def shrinkage(points: Points, rows: slice, columns: slice) -> tuple[float, float]:
    """The most that a tile shrinks the source along its x and its y: source pixels a view pixel.

    0 where nothing of the tile is known.
    """
    x = np.linspace(columns.start, columns.stop - 1, 5)
    y = np.linspace(rows.start, rows.stop - 1, 5)
    at_x, at_y, known = points(x, y)
    found = []
    for move_x, move_y in ((0.5, 0.0), (0.0, 0.5)):
        next_x, next_y, next_known = points(x + move_x, y + move_y)
        apart = np.hypot(next_x - at_x, next_y - at_y)[known & next_known] / 0.5
        found.append(float(apart.max(initial=0.0)))
    return found[0], found[1]


def _samples(points: Points, rows: slice, columns: slice, halvings: int) -> tuple[int, int]:
    """How many samples a pixel of the tile needs, along x and along y."""
    across, down = (
        min(_MOST_SAMPLES, max(1, math.ceil(shrink / 2**halvings - _SLACK)))
        for shrink in shrinkage(points, rows, columns)
    )
    return across, down


def _quarters(rows: slice, columns: slice) -> list[tuple[slice, slice]]:
    """The four parts of a tile; two where a side is one pixel."""

    def halves(side: slice) -> list[slice]:
        middle = (side.start + side.stop) // 2
        return [slice(*ends) for ends in ((side.start, middle), (middle, side.stop)) if ends[0] < ends[1]]

    return [(upper, left) for upper in halves(rows) for left in halves(columns)]


def _tile(
    source: NDArray[np.float32],
    points: Points,
    rows: slice,
    columns: slice,
    *,
    samples: tuple[int, int],
    halvings: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """One tile: colours [h, w, 3] and alpha [h, w] in 0..1."""
    width, height = columns.stop - columns.start, rows.stop - rows.start
    reduce = 2**halvings
    centres = (
        np.arange(columns.start, columns.stop, dtype=float),
        np.arange(rows.start, rows.stop, dtype=float),
    )
    x, y = _finer(columns.start, width, samples[0]), _finer(rows.start, height, samples[1])
    at_x, at_y, known_finer = points(x, y)
    known = known_finer if samples == (1, 1) else points(*centres)[2]
    if not known.any():
        return np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
    if halvings:
        at_x, at_y = (at_x + 0.5) / reduce - 0.5, (at_y + 0.5) / reduce - 0.5
    # Beyond any picture; keeps what lies behind the camera from overflowing.
    at_x, at_y = (np.clip(at, -1e5, 1e5).astype(np.float32) for at in (at_x, at_y))
    how = cv2.INTER_LANCZOS4 if samples == (1, 1) else cv2.INTER_CUBIC
    found = np.asarray(cv2.remap(source, at_x, at_y, how, borderMode=cv2.BORDER_REFLECT_101), np.float32)
    if samples != (1, 1):
        across, down = (_sinc(count) for count in samples)
        found = np.asarray(cv2.sepFilter2D(found, -1, across, down), np.float32)
        # The filter's reach is whole view pixels; those beside the tile are dropped here.
        found = found[_reach(samples[1]) :: samples[1], _reach(samples[0]) :: samples[0]][:height, :width]
    opacity = known.astype(np.float32)
    if source.shape[2] == 4:
        covered = np.clip(found[:, :, 3], 0, 1)
        found = found[:, :, :3] / np.maximum(covered, 1 / 512)[:, :, None]
        opacity = opacity * covered
    if not known.all() or source.shape[2] == 4:
        found = found * (opacity > 0)[:, :, None]
    return np.asarray(np.clip(found, 0, 1), np.float32), opacity.astype(np.float32, copy=False)


def _reach(count: int) -> int:
    """How far the filter reaches, in samples."""
    return _LOBES * count if count > 1 else 0


def _finer(start: int, length: int, count: int) -> NDArray[np.float64]:
    """The places [N] of `count` samples a pixel, the filter's reach included; every pixel's centre is one."""
    reach = _reach(count)
    return start + (np.arange(length * count + 2 * reach) - reach) / count


def _sinc(count: int) -> NDArray[np.float32]:
    """A Lanczos kernel [N] that lets pass what `count` times fewer samples can hold; odd in length, sum 1."""
    if count == 1:
        return np.ones(1, np.float32)
    place = np.arange(-_LOBES * count + 1, _LOBES * count) / count
    kernel = np.sinc(place) * np.sinc(place / _LOBES)
    return (kernel / kernel.sum()).astype(np.float32)


def _halvings(points: Points, size: Size) -> int:
    """How often the source may be halved with no loss: the view shrinks it four times as much everywhere."""
    coarse = max(_TILE, math.ceil(max(size.width, size.height) / 16))
    shrinks = [shrinkage(points, rows, columns) for rows, columns in tiles(size, coarse)]
    least = min((min(shrink) for shrink in shrinks if max(shrink) > 0), default=1.0)
    return max(0, math.floor(math.log2(max(least, 1.0) / 2)))


def _halved(source: NDArray[np.float32]) -> NDArray[np.float32]:
    """[H, W, C] at half the size, each pixel the mean of four; an odd side repeats its last pixel."""
    height, width = source.shape[:2]
    if height % 2 or width % 2:
        source = np.asarray(
            cv2.copyMakeBorder(source, 0, height % 2, 0, width % 2, borderType=cv2.BORDER_REPLICATE),
            np.float32,
        )
    half = (source.shape[1] // 2, source.shape[0] // 2)
    return np.asarray(cv2.resize(source, half, interpolation=cv2.INTER_AREA), np.float32)

"""Image quilting (Efros and Freeman 2001, SIGGRAPH) as a way to fill a hole: our own code, from the paper.

Square blocks of the photo, each of which overlaps those before it by a sixth of its side, are laid in raster
order. A block is drawn from those whose squared difference from what is known beneath it is within a tenth of
the least, and joined along the boundary of least error through the overlap (the paper's sections 2 and 2.1).

What filling a hole adds: the photo around the hole counts as laid already, and stays as it is; the raster
begins at a side of the hole where the photo is seen.
"""

import cv2
import numpy as np

_TOLERANCE = 0.1
_OVERLAP = 1 / 6
_PER_PHOTO = 12
_LEAST_SIDE = 4


def quilted(picture: np.ndarray, hole: np.ndarray, *, side: int | None = None, seed: int = 0) -> np.ndarray:
    """`picture` float32 [H, W, 3] with `hole` bool [H, W] filled; outside of it nothing changes.

    `side` of a block in pixels: a twelfth of the photo's shorter side stands in, and half of that, and so on,
    where no block of the photo is free of the hole. Raises ValueError where none of 4 pixels is.
    """
    side = side or max(16, round(min(hole.shape) / _PER_PHOTO))
    while not _free(hole, side).any():
        side //= 2
        if side < _LEAST_SIDE:
            raise ValueError("the hole leaves no block of the photo")
    # The raster goes right and down: turn the photo so that it starts from what is seen.
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    down = -1 if rows[0] == 0 and rows[-1] < hole.shape[0] - 1 else 1
    right = -1 if columns[0] == 0 and columns[-1] < hole.shape[1] - 1 else 1
    along = (1, 0) if rows[0] == 0 and rows[-1] == hole.shape[0] - 1 else (0, 1)

    def turned(values: np.ndarray) -> np.ndarray:
        flipped = values[::down, ::right]
        return np.ascontiguousarray(flipped.transpose(*along, *range(2, flipped.ndim)))

    filled = _rastered(turned(picture), turned(hole), side, np.random.default_rng(seed))
    return np.ascontiguousarray(filled.transpose(*along, 2)[::down, ::right])


def _rastered(picture: np.ndarray, hole: np.ndarray, side: int, random: np.random.Generator) -> np.ndarray:
    overlap = max(1, round(side * _OVERLAP))
    free = _free(hole, side)
    source = np.where(hole[:, :, None], np.float32(0), picture)
    filled, open_ = source.copy(), hole.copy()
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    for top in _starts(rows[0], rows[-1], side, overlap, hole.shape[0]):
        for left in _starts(columns[0], columns[-1], side, overlap, hole.shape[1]):
            here = (slice(top, top + side), slice(left, left + side))
            if not open_[here].any():
                continue
            old, known = filled[here], ~open_[here]
            y, x = _drawn(source, free, old, known, random)
            new = source[y : y + side, x : x + side]
            kept = known & (_cut(old, new, known, overlap) | ~hole[here])
            filled[here] = np.where(kept[:, :, None], old, new)
            open_[here] = False
    return filled


def _starts(first: int, last: int, side: int, overlap: int, length: int) -> list[int]:
    """Where blocks begin along an axis to cover first..last; the first overlaps what is before it."""
    starts = range(max(0, first - overlap), last + 1, side - overlap)
    return sorted({min(start, length - side) for start in starts})


def _free(hole: np.ndarray, side: int) -> np.ndarray:
    """Which blocks, by their first pixel, touch no pixel of the hole: bool [H - side + 1, W - side + 1]."""
    height, width = hole.shape
    if min(height, width) < side:
        return np.zeros((1, 1), bool)
    sums = cv2.integral(hole.astype(np.uint8))
    return sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side] == 0


def _drawn(
    source: np.ndarray, free: np.ndarray, old: np.ndarray, known: np.ndarray, random: np.random.Generator
) -> tuple[int, int]:
    """The first pixel of a block of the photo that fits what is known, at random among the nearly best."""
    mask = np.repeat(known[:, :, None].astype(np.float32), 3, axis=2)
    misfit = cv2.matchTemplate(source, old * mask, cv2.TM_SQDIFF, mask=mask)
    misfit = np.where(free, np.maximum(misfit, 0), np.inf)
    # The transforms of matchTemplate are exact to about so much of what they add up.
    rounding = 1e-5 * float((old * mask).astype(float).ravel() @ (old * mask).ravel())
    good = np.argwhere(misfit <= (1 + _TOLERANCE) * misfit.min() + rounding)
    y, x = good[random.integers(len(good))].tolist()
    return y, x


def _cut(old: np.ndarray, new: np.ndarray, known: np.ndarray, overlap: int) -> np.ndarray:
    """Which pixels [S, S] of a block lie before the boundaries of least error, at its left or its top."""
    error = np.where(known, ((old - new) ** 2).sum(2), 0)
    kept = np.zeros(known.shape, bool)
    if known[:, :overlap].all():
        kept[:, :overlap] |= _before(error[:, :overlap])
    if known[:overlap].all():
        kept[:overlap] |= _before(error[:overlap].T).T
    return kept


def _before(error: np.ndarray) -> np.ndarray:
    """Which pixels [N, K] lie before the path of least error from the first row to the last."""
    total = error.astype(float)
    for row in range(1, len(total)):
        above = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(above[:-2], above[1:-1]), above[2:])
    before = np.zeros(error.shape, bool)
    at = int(total[-1].argmin())
    for row in range(len(total) - 1, -1, -1):
        if row < len(total) - 1:
            low = max(0, at - 1)
            at = low + int(total[row, low : at + 2].argmin())
        before[row, :at] = True
    return before

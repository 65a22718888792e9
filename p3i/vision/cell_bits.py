"""What each cell of a sheet says for an object in it, in bits: the one judgement of extent and of presence.

A cell is compared with the kinds of cell that the pattern holds and with the mean of its neighbours that
belong to it, since light and look may change along a pattern. How often cells of the pattern look like none
of that, and others do, is estimated from the sheet itself; so agreement becomes the number of bits by which
the cell is told shorter where an object is drawn: positive where it is there, negative where it is not, 0
where nothing is known.

At the rim of a board or of a ruled sheet half of the cell is another ground. So halves of cells are judged as
well: `halves` says what the half towards a neighbour says by itself.

Convention: cells row by row as in p3i.vision.sheet; arrays in, arrays out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.vision.alike import Alike, Kind
from p3i.vision.cells import agreement, correlation, cut, shifted

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

TOWARDS = ((1, 0), (-1, 0), (0, 1), (0, -1))
"""The neighbours (i, j) towards which the halves of a cell lie, in the order of `CellBits.halves`."""
MISSES = (0.04, 0.1, 0.2, 0.35, 0.5)
"""Shares of objects that do not look like the others, from the least that a pattern has."""
STRAYS = (0.02, 0.06, 0.15)
"""Shares of other things that do."""

_SLACK = 0.09  # of a period: how far an object may lie from its place
_UNLIKE, _LIKE = 0.3, 0.7  # of the scaled agreement: below no object, above surely one
# The same of a half, which a line along the rim alone agrees with by half.
_HALF_UNLIKE, _HALF_LIKE = 0.5, 1.0
_LEAST_VISIBLE = 0.25  # of a cell, for it to be judged
_LEAST_LEAD = 0.05  # of a typical cell's agreement over that of others; below it nothing tells them apart
_ROUNDS = 6  # so often the mean of the neighbours is taken anew
_FEWEST_NEIGHBOURS = 3.0  # of the eight, that must be of the pattern for their mean to count


@dataclass(frozen=True, slots=True, eq=False)
class CellBits:
    """The bits [N] of each cell, of its `halves` [4, N] towards `TOWARDS`, and which cells [N] are judged."""

    whole: Array
    halves: Array
    judged: Mask


def cell_bits(alike: Alike, shown: Mask | None = None) -> CellBits:
    """What each cell says for an object in it: nothing where little of it is known, or not `shown` [N]."""
    side = alike.sheet.side
    middle = cut(alike.sheet.seen, side)[:, side // 2, side // 2]
    judged = middle & (alike.visible > _LEAST_VISIBLE) & (True if shown is None else shown)
    if alike.level <= 0 or not judged.any():
        return CellBits(np.zeros(len(judged)), np.zeros((4, len(judged))), judged)
    likeness = np.maximum.reduce([_likeness(alike, kind, judged, ()) for kind in alike.kinds])
    passes = _with_neighbours(alike, _ramp(likeness, _UNLIKE, _LIKE) * judged, judged)
    trust = np.where(judged, np.sqrt(alike.visible), 0.0)
    rates = _rates(passes, trust, (alike.sheet.box.rows, alike.sheet.box.columns))
    halves = [
        _bits(_ramp(half, _HALF_UNLIKE, _HALF_LIKE), trust, *rates) for half in _half_likeness(alike, judged)
    ]
    return CellBits(_bits(passes, trust, *rates), np.stack(halves), judged)


def _ramp(values: NDArray, low: float, high: float) -> Array:
    """Values [N] as shares of the way from low to high, 0..1."""
    return np.clip((values - low) / (high - low), 0, 1).astype(float)


def _bits(passes: Array, trust: Array, misses: float, strays: float) -> Array:
    """Bits [N] of cells that pass [N] in 0..1, each as far as it is trusted [N]."""
    worst, best = np.log2(misses / (1 - strays)), np.log2((1 - misses) / strays)
    return (worst + (best - worst) * passes) * trust


def _rates(passes: Array, trust: Array, grid: tuple[int, int]) -> tuple[float, float]:
    """The shares of misses and of strays that explain cells [N] best, a rectangle of them the pattern."""

    def explained(misses: float, strays: float) -> float:
        without = float((trust * (passes * np.log2(strays) + (1 - passes) * np.log2(1 - strays))).sum())
        worth = _bits(passes, trust, misses, strays).reshape(grid)
        i0, i1, j0, j1 = best_rectangle(worth)
        return without + max(0.0, float(worth[j0:j1, i0:i1].sum()))

    return max(((m, s) for m in MISSES for s in STRAYS), key=lambda rate: explained(*rate))


def _likeness(alike: Alike, kind: Kind, judged: Mask, part: tuple[slice, ...]) -> Floats:
    """Agreement [N] of a `part` of the cells with that of a kind, scaled: 0 other things, 1 a typical one."""
    slack = max(1, round(_SLACK * alike.sheet.side))
    near = np.array([(x, y) for x in (-slack, 0, slack) for y in (-slack, 0, slack)])
    cells, known = alike.cells[:, :, *part], alike.cells_known[:, *part]
    fit = agreement(cells, known, shifted(kind.template, near)[:, :, *part]).max(axis=1)
    others = judged & (alike.weights < 0.1) & (kind.weights < 0.1)
    return _scaled(fit, kind.weights, others)


def _scaled(fit: NDArray, weights: NDArray, others: Mask) -> Floats:
    """Fits [N] on a scale where those of the other cells are 0 and those of typical ones, by weight, 1."""
    inside = float(np.average(fit, weights=weights + 1e-9))
    outside = float(np.clip(np.median(fit[others]), 0, 0.3)) if others.sum() > 8 else 0.15
    return ((fit - outside) / max(inside - outside, _LEAST_LEAD)).astype(np.float32)


def _half_likeness(alike: Alike, judged: Mask) -> list[Floats]:
    """The likeness [N] of the half of each cell towards each of `TOWARDS`."""
    half, every = alike.sheet.side // 2, slice(None)
    parts = [
        (every, slice(half, None)),
        (every, slice(None, half)),
        (slice(half, None), every),
        (slice(None, half), every),
    ]
    return [
        np.maximum.reduce([_likeness(alike, kind, judged, part) for kind in alike.kinds]) for part in parts
    ]


def _with_neighbours(alike: Alike, passes: Array, judged: Mask) -> Array:
    """How far cells pass [N], by themselves or by agreement with the neighbours that are of the pattern.

    What is found so counts as a neighbour in the next round: a pattern whose look changes is followed.
    """
    for _ in range(_ROUNDS):
        weights = np.clip(2 * passes - 1, 0, 1).astype(np.float32)
        fit, count = _neighbour_agreement(alike, weights)
        asked = judged & (count >= _FEWEST_NEIGHBOURS)
        if not (asked & (weights > 0)).any():
            break
        scaled = _scaled(fit, weights * asked, asked & (passes < 0.1))
        grown = np.where(asked, np.maximum(passes, _ramp(scaled, _UNLIKE, _LIKE)), passes)
        if np.allclose(grown, passes, atol=0.05):
            break
        passes = grown
    return passes


def _neighbour_agreement(alike: Alike, weights: Floats) -> tuple[Floats, Floats]:
    """Agreement [N] of each cell with the mean of the eight around it, and the weights' sum [N]."""
    box = alike.sheet.box
    count, channels = alike.cells.shape[:2]
    cells = alike.cells.reshape(count, channels, -1)
    known = alike.cells_known.reshape(count, 1, -1)

    def around(values: NDArray) -> Floats:
        """Sums over the eight cells around each: [N, ...] to the same shape."""
        grid = values.reshape(box.rows, box.columns, -1)
        rows = grid.copy()
        rows[1:] += grid[:-1]
        rows[:-1] += grid[1:]
        sums = rows - grid
        sums[:, 1:] += rows[:, :-1]
        sums[:, :-1] += rows[:, 1:]
        return sums.reshape(values.shape)

    mean = around(cells * weights[:, None, None])
    mean /= np.maximum(around(known * weights[:, None, None]), 1e-3)
    mean *= known
    product = np.einsum("nck,nck->n", cells, mean)
    own, expected = np.einsum("nck,nck->n", cells, cells), np.einsum("nck,nck->n", mean, mean)
    return correlation(product, own, expected), around(weights[:, None])[:, 0]


def best_rectangle(worth: Array) -> tuple[int, int, int, int]:
    """The ends i0, i1, j0, j1 of the rectangle of greatest sum in [H, W], by Kadane's rule over rows."""
    rows = worth.shape[0]
    sums = np.vstack([np.zeros(worth.shape[1]), np.cumsum(worth, axis=0)])
    best, at = -np.inf, (0, 1, 0, 1)
    for j0 in range(rows):
        bands = sums[j0 + 1 :] - sums[j0]
        total = np.cumsum(bands, axis=1)
        before = np.concatenate([np.zeros((len(bands), 1)), total[:, :-1]], axis=1)
        lowest = np.minimum.accumulate(before, axis=1)
        gain = total - lowest
        k = int(gain.argmax())
        band, stop = divmod(k, gain.shape[1])
        if gain[band, stop] > best:
            best = float(gain[band, stop])
            start = int(before[band, : stop + 1].argmin())
            at = (start, stop + 1, j0, j0 + band + 1)
    return at

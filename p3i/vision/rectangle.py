"""The largest axis-parallel rectangle in which everything is known.

Convention: `known(x [w], y [h])` says for the points of a grid, bool [h, w], which are; coordinates are the
caller's. Searched on a coarse grid, then each side is moved as far as it goes.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Known = Callable[[Array, Array], NDArray[np.bool_]]

_FINER = 4
"""A coarse cell is known where this many steps along each side, its corners included, are."""

_LINE = 1024
"""Points along a side that is moved."""


def largest_rectangle(known: Known, low: Array, high: Array, *, coarse: int) -> tuple[Array, Array]:
    """The corners (low [2], high [2]) of the largest known rectangle in the box of `low` and `high`.

    `coarse` is the number of cells along the box's longer side. Where nothing is known it is the box's
    middle, with no extent.
    """
    extent = high - low
    counts = np.maximum(1, np.round(coarse * extent / extent.max())).astype(int)
    x, y = (np.linspace(low[k], high[k], counts[k] * _FINER + 1) for k in (0, 1))
    whole = _cells(known(x, y), int(counts[0]), int(counts[1]))
    left, top, right, bottom = largest_box(whole)
    if right == left or bottom == top:
        return (low + high) / 2, (low + high) / 2
    step = extent / counts
    found_low, found_high = low + step * (left, top), low + step * (right, bottom)
    return _grown(known, found_low, found_high, step=step)


def largest_box(free: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """The largest box of True cells of [h, w]: left, top, right, bottom, half-open; first of equals."""
    best, box = 0, (0, 0, 0, 0)
    height = np.zeros(free.shape[1] + 1, int)  # a last column of none ends every run
    for row, line in enumerate(free):
        height[:-1] = np.where(line, height[:-1] + 1, 0)
        waiting: list[tuple[int, int]] = []
        for column, tall in enumerate(height.tolist()):
            start = column
            while waiting and waiting[-1][1] >= tall:
                start, past = waiting.pop()
                if past * (column - start) > best:
                    best = past * (column - start)
                    box = (start, row + 1 - past, column, row + 1)
            waiting.append((start, tall))
    return box


def _cells(points: NDArray[np.bool_], columns: int, rows: int) -> NDArray[np.bool_]:
    """Which coarse cells [rows, columns] are known at all their points, borders included."""
    across = np.ones((len(points), columns), bool)
    for k in range(_FINER + 1):
        across &= points[:, k : k + _FINER * columns : _FINER]
    whole = np.ones((rows, columns), bool)
    for k in range(_FINER + 1):
        whole &= across[k : k + _FINER * rows : _FINER]
    return whole


def _grown(known: Known, low: Array, high: Array, *, step: Array) -> tuple[Array, Array]:
    """The rectangle (low [2], high [2]) with each side moved outwards while all it takes in is known.

    The moves grow ever smaller, from `step` [2].
    """
    low, high = low.copy(), high.copy()
    for halving in range(1, 11):
        for axis in (0, 1):
            for side, sign in ((low, -1.0), (high, 1.0)):
                move = sign * step[axis] / 2**halving
                strip_low, strip_high = low.copy(), high.copy()
                strip_low[axis], strip_high[axis] = sorted((side[axis], side[axis] + move))
                grid = [np.linspace(strip_low[k], strip_high[k], 5 if k == axis else _LINE) for k in (0, 1)]
                if known(grid[0], grid[1]).all():
                    side[axis] += move
    return low, high

"""Where to cut a pattern into tiles: along the joints, so that a tile shows whole objects."""

import numpy as np

_WIDE = 0.012
"""A cut is as wide as this share of a side (the deviation of the blur across it)."""

_NEAR, _ASIDE = 0.04, 0.02
"""An edge is beside a cut within about this share of a side, and counts so much against one that is cut."""

_LEAVING = 16.0
"""Programs draw where objects are, and edges tell of objects only in part: a cut through an object's place,
half a side from where it was, counts for five, one a quarter of a side from there for two."""

_GRAIN = 2.0
"""Differences of up to this many times the usual one are no edges."""


def cut_of(mean: np.ndarray, *, down: bool) -> tuple[float, float]:
    """How far to move a tile [H, W, 3] that wraps, as shares of its sides: to the right and down.

    A cut goes where the contrast along it is least: between windows, in the joint of bricks, along the
    border of a chessboard's fields. (0, 0) leaves the tile as it is; `down` says whether it wraps downwards.
    """
    return _moved(mean, 1), _moved(mean, 0) if down else 0.0


def _moved(mean: np.ndarray, axis: int) -> float:
    """The best cut across an axis, as a share of its length, -0.5 to 0.5."""
    count = mean.shape[axis]
    # A cut runs between two pixels, before pixel k of the axis, from the last to the first for k = 0. What
    # both sides are together counts: along the border of a chessboard's fields that is one grey.
    line = _blurred(mean, axis, max(0.7, _WIDE * count), between=True)
    edges = np.abs(np.roll(line, -1, 1 - axis) - line).sum(axis=2)
    through = np.maximum(0, edges - _GRAIN * np.median(edges)).sum(axis=1 - axis)
    across = np.abs(mean - np.roll(mean, 1, axis)).sum(axis=2).mean(axis=1 - axis)
    beside = _blurred(across, 0, max(1.0, _NEAR * count), between=False) * count
    moved = (np.arange(count) / count + 0.5) % 1 - 0.5
    cost = (through + _ASIDE * beside) * (1 + _LEAVING * moved**2)
    return float(moved[np.argmin(cost)])


def _blurred(values: np.ndarray, axis: int, sigma: float, *, between: bool) -> np.ndarray:
    """The means along an axis that wraps, around each pixel, or around the edge `between` it and the last."""
    count = values.shape[axis]
    away = np.arange(count) + (0.5 if between else 0.0)
    weight = np.exp(-0.5 * (np.minimum(away, count - away) / sigma) ** 2)
    shape = [-1 if k == axis else 1 for k in range(values.ndim)]
    spread = np.fft.fft(weight / weight.sum()).reshape(shape)
    return np.fft.ifft(np.fft.fft(values, axis=axis) * spread, axis=axis).real

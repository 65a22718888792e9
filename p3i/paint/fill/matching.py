"""A source matched with what lies around its hole: its last shift, its light, and how far it is trusted.

Convention: K places around a hole with colours [K, 3] (RGB in 0..1) and weights [K] by nearness; S sources.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.light import matched_light

Array = NDArray[np.float64]

# Residuals of this size count half as much as small ones in finding a shift.
_ROBUST = 0.02
# A source is shifted so many times.
_SHIFTS = 3
# How far weights are drawn to the sources' own misfits: a share of the mean square of the residuals.
_RIDGE = 0.3
_HALF_PIXELS = np.array([(0.5, 0.0), (0.0, 0.5)])


def _shift_step(slopes: Sequence[NDArray], residual: NDArray, weights: NDArray) -> Array:
    """The step [2] that lessens the residual [K, 3]; `slopes` are the colours' along x and y, [K, 3] each.

    One robust step of Lucas and Kanade (IJCAI 1981).
    """
    robust = weights[:, None] / (np.abs(residual) + _ROBUST)
    normal = np.array([[(robust * one * other).sum() for other in slopes] for one in slopes])
    normal += np.eye(2) * (1e-3 * np.trace(normal) + 1e-6)
    return np.linalg.solve(normal, [(robust * one * residual).sum() for one in slopes])


def trusted(residuals: NDArray, weights: NDArray, misfits: Array) -> Array:
    """How much each source counts, [S], together 1: its `residuals` [S, K, 3] are 0 where it shows nothing.

    Least squares: the mean of the sources comes closest to what is wanted, drawn to trust by `misfits` [S].
    """
    prior = 1 / (misfits**2 + 1e-5)
    prior /= prior.sum()
    rows = (residuals * np.sqrt(weights)[:, None]).reshape(len(misfits), -1)
    products = rows @ rows.T / (3 * weights.sum())
    ridge = _RIDGE * np.trace(products) / len(misfits) + 1e-9
    normal = products + ridge * np.eye(len(misfits))
    towards, even = np.linalg.solve(normal, np.stack([ridge * prior, np.ones(len(misfits))], 1)).T
    found = np.clip(towards + even * (1 - towards.sum()) / even.sum(), 0, None)
    return found / found.sum()


def aligned(
    read: Callable[[Array], NDArray], wanted: NDArray, *, weights: NDArray, most_px: float
) -> tuple[Array, Array, Array, float]:
    """The shift [2] under which a source is likest to what is wanted, its gain and offset [3], its misfit.

    `read` gives the source's colours [K, 3] under a shift of up to `most_px` along each axis. The misfit is
    the mean difference that is left of `wanted` [K, 3], by `weights` [K].
    """
    best: tuple[Array, Array, Array, float] | None = None
    shift = np.zeros(2)
    for left in range(_SHIFTS, -1, -1):
        colours = read(shift)
        gain, offset = matched_light(colours, wanted, weights)
        residual = wanted - (gain * colours + offset)
        misfit = float((weights[:, None] * np.abs(residual)).sum() / max(float(weights.sum()), 1e-9) / 3)
        if best is None or misfit < best[3]:
            best = shift, gain, offset, misfit
        if left:
            slopes = [gain * (read(shift + half) - read(shift - half)) for half in _HALF_PIXELS]
            shift = np.clip(shift + _shift_step(slopes, residual, weights), -most_px, most_px)
    assert best is not None
    return best

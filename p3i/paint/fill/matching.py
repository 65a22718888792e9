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
# Neighbouring pixels tell the same: one in so many counts.
_ALIKE = 9.0
# A source is shifted so many times.
_SHIFTS = 3
# How far weights are drawn to the sources' own misfits: a share of the mean square of the residuals.
_RIDGE = 0.3
_HALF_PIXELS = np.array([(0.5, 0.0), (0.0, 0.5)])


def _shift_step(
    slopes: Sequence[NDArray], residual: NDArray, weights: NDArray, *, shift: Array, likely_px: float
) -> Array:
    """The step [2] that lessens the residual [K, 3]; `slopes` are the colours' along x and y, [K, 3] each.

    One robust step of Lucas and Kanade (IJCAI 1981), with shifts of `likely_px` as likely as it is likely
    that the residual is noise.
    """
    robust = weights[:, None] / (np.abs(residual) + _ROBUST)
    normal = np.array([[(robust * one * other).sum() for other in slopes] for one in slopes])
    told = np.array([(robust * one * residual).sum() for one in slopes])
    noise = np.sqrt((weights[:, None] * residual**2).sum() / max(3 * float(weights.sum()), 1e-9))
    back = _ALIKE * 3 * max(float(noise), 1e-3) / likely_px**2
    normal += np.eye(2) * (1e-3 * np.trace(normal) + 1e-6 + back)
    return np.linalg.solve(normal, told - back * shift)


def trusted(residuals: NDArray, weights: NDArray, misfits: Array, *, share: float = 1.0) -> Array:
    """How much each source counts, [S], together 1: its `residuals` [S, K, 3] are 0 where it shows nothing.

    Least squares: the mean of the sources comes closest to what is wanted, drawn to trust by `misfits` [S];
    the more so the smaller the `share` that the residuals have in what is known.
    """
    prior = 1 / (misfits**2 + 1e-5)
    prior /= prior.sum()
    if share <= 0 or not weights.sum():
        return prior
    rows = (residuals * np.sqrt(weights)[:, None]).reshape(len(misfits), -1)
    products = rows @ rows.T / (3 * weights.sum())
    ridge = _RIDGE / share * np.trace(products) / len(misfits) + 1e-9
    normal = products + ridge * np.eye(len(misfits))
    towards, even = np.linalg.solve(normal, np.stack([ridge * prior, np.ones(len(misfits))], 1)).T
    found = np.clip(towards + even * (1 - towards.sum()) / even.sum(), 0, None)
    return found / found.sum()


def aligned(
    read: Callable[[Array], NDArray],
    wanted: NDArray,
    *,
    weights: NDArray,
    most_px: float,
    light: tuple[Array, Array] | None = None,
    share: float = 1.0,
    likely_px: float = np.inf,
) -> tuple[Array, Array, Array, float]:
    """The shift [2] under which a source is likest to what is wanted, its gain and offset [3], its misfit.

    `read` gives the source's colours [K, 3] under a shift of up to `most_px` along each axis. The misfit is
    the mean difference that is left of `wanted` [K, 3], by `weights` [K]. For gain and offset it counts by
    its `share` (0..1), the rest is those of `light`; shifts are drawn to those that are `likely_px`.
    """
    best: tuple[Array, Array, Array, float] | None = None
    shift = np.zeros(2)
    for left in range(_SHIFTS, -1, -1):
        colours = read(shift)
        gain, offset = matched_light(colours, wanted, weights, light=light, share=share)
        residual = wanted - (gain * colours + offset)
        misfit = float((weights[:, None] * np.abs(residual)).sum() / max(float(weights.sum()), 1e-9) / 3)
        if best is None or misfit < best[3]:
            best = shift, gain, offset, misfit
        if left:
            slopes = [gain * (read(shift + half) - read(shift - half)) for half in _HALF_PIXELS]
            step = _shift_step(slopes, residual, weights, shift=shift, likely_px=likely_px)
            shift = np.clip(shift + step, -most_px, most_px)
    assert best is not None
    return best

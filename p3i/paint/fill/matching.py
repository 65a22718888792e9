"""What all ways to fill by other cells share: light, the last shift, trust, and what a hole's rim lacks.

Convention: K places around a hole with colours [K, 3] (RGB in 0..1) and weights [K] by nearness; S sources.
"""

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# Light is matched by an offset and a gain between these, drawn towards 1 as if by that share of the variance
# and that much besides: flat surroundings say nothing of contrast.
_GAINS = (0.5, 2.0)
_PRIOR = 0.1
_PRIOR_VARIANCE = 1e-3
# Residuals of this size count half as much as small ones in finding a shift.
_ROBUST = 0.02
# A source is shifted so many times.
_SHIFTS = 3
_HALF_PIXELS = np.array([(0.5, 0.0), (0.0, 0.5)])
# The most that is carried in from a rim.
_MOST_CARRIED = 0.15
# How far weights are drawn to the sources' own misfits: a share of the mean square of the residuals.
_RIDGE = 0.3
# What is carried in from a rim is smoothed along it over this share of the distance to the next object, times
# each of these: near the rim its own difference counts, further in that of more.
_SMOOTH = 0.125
_SCALES = (0.5, 1.0, 2.0, 4.0)
# Where the finest smoothing is over this many pixels the rim is reduced first, until it is over so many.
_COARSE_SIGMA = 16.0
_LEAST_SIGMA = 4.0


def _matched_light(colours: NDArray, wanted: NDArray, weights: NDArray) -> tuple[Array, Array]:
    """The gain and offset [3] that bring colours [K, 3] closest to those wanted; 1 and 0 without weight."""
    share = (weights / max(float(weights.sum()), 1e-9))[:, None].astype(float)
    mean, wanted_mean = (share * colours).sum(0), (share * wanted).sum(0)
    variance = (share * (colours - mean) ** 2).sum(0)
    together = (share * (colours - mean) * (wanted - wanted_mean)).sum(0)
    prior = _PRIOR * variance + _PRIOR_VARIANCE
    gain = np.clip((together + prior) / (variance + prior), *_GAINS)
    return gain, wanted_mean - gain * mean


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
        gain, offset = _matched_light(colours, wanted, weights)
        residual = wanted - (gain * colours + offset)
        misfit = float((weights[:, None] * np.abs(residual)).sum() / max(float(weights.sum()), 1e-9) / 3)
        if best is None or misfit < best[3]:
            best = shift, gain, offset, misfit
        if left:
            slopes = [gain * (read(shift + half) - read(shift - half)) for half in _HALF_PIXELS]
            shift = np.clip(shift + _shift_step(slopes, residual, weights), -most_px, most_px)
    assert best is not None
    return best


def rim_of(hole: NDArray, known: NDArray, *, reach_px: float) -> NDArray[np.bool_]:
    """The known pixels [h, w] beside a hole [h, w], up to `reach_px` away from it."""
    far = np.asarray(cv2.distanceTransform((hole == 0).astype(np.uint8), cv2.DIST_L2, 5))
    return (far > 0) & (far <= reach_px) & known


def membrane(off: NDArray, rim: NDArray[np.bool_], *, spacing_px: float) -> Floats:
    """What a hole's rim [h, w] lacks, `off` [h, w, 3] there, carried smoothly inwards: [h, w, 3].

    0 without a rim; nothing is lifted or lowered by more than `_MOST_CARRIED`.
    """
    limited = np.clip(off, -_MOST_CARRIED, _MOST_CARRIED).astype(np.float32)
    return carried(limited * rim[:, :, None], rim.astype(np.float32), spacing_px=spacing_px)


def carried(off: Floats, rim: Floats, *, spacing_px: float) -> Floats:
    """What a rim lacks, carried smoothly to all pixels: `off` [h, w, 3] (0 beside the rim) -> [h, w, 3].

    `rim` [h, w] is 1 on the rim, else 0; `spacing_px` is how far the next object lies. 0 without a rim.
    """
    height, width = rim.shape
    finest = _SCALES[0] * _SMOOTH * spacing_px
    if finest >= _COARSE_SIGMA:
        # What is smooth over so many pixels is known from a reduced picture as well.
        reduce = 2 ** int(np.log2(finest / _LEAST_SIGMA))
        size = (-(-width // reduce), -(-height // reduce))
        small, small_rim = (
            np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_AREA), np.float32)
            for plane in (off, rim)
        )
        found = carried(small, small_rim, spacing_px=spacing_px / reduce)
        return np.asarray(cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
    total, weight = np.zeros_like(off), np.zeros_like(rim)
    for scale in _SCALES:
        sigma = max(0.7, scale * _SMOOTH * spacing_px)
        for plane, summed in ((off, total), (rim, weight)):
            summed += cv2.GaussianBlur(plane, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) / scale
    fading = np.minimum(1, weight / 1e-3) / np.maximum(weight, 1e-9)
    return (total * fading[:, :, None]).astype(np.float32)

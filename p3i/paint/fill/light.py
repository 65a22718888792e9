"""The light of a fill: a source brought into that around its hole, and what the hole's rim lacks carried in.

Convention: K places around a hole with colours [K, 3] (RGB in 0..1) and weights [K] by nearness.
"""

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
# What surroundings differ by is weighed anew so many times, and told no finer than this.
_ROUNDS = 3
_LEAST_OFF = 1 / 255
MOST_CARRIED = 0.15
"""What a rim lacks is carried in up to this."""
# What is carried in from a rim is smoothed along it over this share of the distance to the next object, times
# each of these: at the rim its own difference counts, further in that of more.
_SMOOTH = 0.125
_SCALES = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
# Where a smoothing is over this many pixels the rim is reduced first, until it is over so many.
_COARSE_SIGMA = 16.0
_LEAST_SIGMA = 4.0


def matched_light(
    colours: NDArray,
    wanted: NDArray,
    weights: NDArray,
    *,
    light: tuple[Array, Array] | None = None,
    share: float = 1.0,
) -> tuple[Array, Array]:
    """The gain and offset [3] that bring colours [K, 3] closest to those wanted; 1 and 0 without weight.

    Those of `light` count instead, as far as the colours have not all of the `share` (0..1). Robust:
    places that differ by more than half of all do count the less, by the square of how much more (an
    M-estimator whose influence falls off), so that what is foreign around a hole tells nothing of light.
    """
    before, lifted = light if light is not None else (np.ones(3), np.zeros(3))
    gain, offset = _closest(colours, wanted, weights, before, lifted, share)
    for _ in range(_ROUNDS if weights.any() else 0):
        off = np.abs(gain * colours + offset - wanted).mean(1)
        usual = max(_weighted_median(off, weights), _LEAST_OFF)
        robust = weights * np.minimum(1, usual / np.maximum(off, _LEAST_OFF)) ** 2
        gain, offset = _closest(colours, wanted, robust, before, lifted, share)
    return gain, offset


def _closest(
    colours: NDArray, wanted: NDArray, weights: NDArray, before: Array, lifted: Array, share: float
) -> tuple[Array, Array]:
    """The gain and offset [3] by one regression, drawn to the gain `before` and the offset `lifted`.

    Both sides are told with errors: an object differs from its like by what is its own. Least squares would
    make every source paler by that (attenuation; Fuller, Measurement Error Models, 1987, section 1.1), and
    their mean a second time. With as much of it on both sides the reliability is their correlation.
    """
    parts = (weights / max(float(weights.sum()), 1e-9))[:, None].astype(float)
    mean, wanted_mean = (parts * colours).sum(0), (parts * wanted).sum(0)
    variance = (parts * (colours - mean) ** 2).sum(0)
    spread = (parts * (wanted - wanted_mean) ** 2).sum(0)
    together = np.maximum((parts * (colours - mean) * (wanted - wanted_mean)).sum(0), 0)
    reliable = np.minimum(together / np.sqrt(np.maximum(variance * spread, 1e-12)), 1) * variance
    prior = _PRIOR * variance + _PRIOR_VARIANCE
    prior += (1 - share) / share * variance
    gain = np.clip((together + before * prior) / (reliable + prior), *_GAINS)
    level = share * wanted_mean + (1 - share) * (before * mean + lifted)
    return gain, level - gain * mean


def _weighted_median(values: NDArray, weights: NDArray) -> float:
    """The value [K] below which half of the weights [K] lie."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order[min(np.searchsorted(below, below[-1] / 2), len(order) - 1)]])


def rim_of(hole: NDArray, known: NDArray, *, reach_px: float) -> NDArray[np.bool_]:
    """The known pixels [h, w] beside a hole [h, w], up to `reach_px` away from it."""
    far = np.asarray(cv2.distanceTransform((hole == 0).astype(np.uint8), cv2.DIST_L2, 5))
    return (far > 0) & (far <= reach_px) & known


def carried(off: Floats, rim: Floats, *, spacing_px: float) -> Floats:
    """What a rim lacks, carried smoothly to all pixels: `off` [h, w, 3] (0 beside the rim) -> [h, w, 3].

    `rim` [h, w] is 1 on the rim, else 0; `spacing_px` is how far the next object lies. 0 without a rim.
    """
    height, width = rim.shape
    total, weight = np.zeros_like(off), np.zeros_like(rim)
    for scale in _SCALES:
        sigma = max(0.7, scale * _SMOOTH * spacing_px)
        # What is smooth over so many pixels is known from a reduced picture as well.
        reduce = 2 ** int(np.log2(sigma / _LEAST_SIGMA)) if sigma >= _COARSE_SIGMA else 1
        size = (-(-width // reduce), -(-height // reduce))
        for plane, summed in ((off, total), (rim, weight)):
            small = plane if reduce == 1 else cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
            blurred = cv2.GaussianBlur(small, (0, 0), sigma / reduce, borderType=cv2.BORDER_CONSTANT)
            if reduce > 1:
                blurred = cv2.resize(blurred, (width, height), interpolation=cv2.INTER_LINEAR)
            summed += blurred / np.float32(scale)
    fading = np.minimum(1, weight / 1e-3) / np.maximum(weight, 1e-9)
    return (total * fading[:, :, None]).astype(np.float32)

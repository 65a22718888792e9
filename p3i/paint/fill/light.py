"""The light of a fill: a source brought into that around its hole, and what the hole's rim lacks carried in.

Convention: K places around a hole with colours [K, 3] (RGB in 0..1) and weights [K] by nearness.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.even import reduction
from p3i.vision.planes import times
from p3i.vision.strips import Window, strips_of, wider_by, within

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
# Where a smoothing is over this many pixels the rim is reduced first.
_COARSE_SIGMA = 16.0
_FINEST_PX = 0.7
# A bell reaches so many sigmas; a picture is carried into in parts of twice that, or of so many pixels.
_REACH = 4.0
_PART_PX = 256


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
    both = _Both.of(colours, wanted)
    gain, offset = _closest(both, weights, before, lifted, share)
    for _ in range(_ROUNDS if weights.any() else 0):
        off = both.off(gain, offset)
        usual = max(_weighted_median(off, weights), _LEAST_OFF)
        robust = weights * np.minimum(1, usual / np.maximum(off, _LEAST_OFF)) ** 2
        gain, offset = _closest(both, robust, before, lifted, share)
    return gain, offset


@dataclass(frozen=True, slots=True, eq=False)
class _Both:
    """Colours and those wanted, a row a channel as sums are fast: `own`, `other` [3, K].

    `products` [15, K] are both, their squares and their products, whose means are all that a regression asks.
    """

    own: Array
    other: Array
    products: Array

    @classmethod
    def of(cls, colours: NDArray, wanted: NDArray) -> "_Both":
        """For colours [K, 3] and those wanted."""
        own, other = (np.ascontiguousarray(part.T, float) for part in (colours, wanted))
        return cls(own, other, np.concatenate([own, other, own * own, other * other, own * other]))

    def off(self, gain: Array, offset: Array) -> Array:
        """What each place is off by under this light, [K], over the channels."""
        first, second, third = np.abs(gain[:, None] * self.own + (offset[:, None] - self.other))
        return (first + second + third) / 3


def _closest(
    both: _Both, weights: NDArray, before: Array, lifted: Array, share: float
) -> tuple[Array, Array]:
    """The gain and offset [3] by one regression, drawn to the gain `before` and the offset `lifted`.

    Both sides are told with errors: an object differs from its like by what is its own. Least squares would
    make every source paler by that (attenuation; Fuller, Measurement Error Models, 1987, section 1.1), and
    their mean a second time. With as much of it on both sides the reliability is their correlation.
    """
    parts = weights.astype(float) / max(float(weights.sum()), 1e-9)
    mean, wanted_mean, square, wanted_square, product = (both.products @ parts).reshape(5, 3)
    # Without weight all of these are 0; of colours in 0..1 little is lost in the differences.
    variance = np.maximum(square - mean * mean, 0)
    spread = np.maximum(wanted_square - wanted_mean * wanted_mean, 0)
    together = np.maximum(product - mean * wanted_mean, 0)
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


def carried_into(
    read: Callable[[Window], tuple[Floats, NDArray[np.bool_]]],
    wanted: NDArray[np.bool_],
    *,
    spacing_px: float,
) -> Iterator[tuple[Window, Floats]]:
    """What a rim lacks, carried smoothly to the `wanted` pixels [h, w], part by part: where, and what.

    `read` gives what the rim lacks in a window, 0 beside the rim, and the rim; `spacing_px` is how far the
    next object lies. Parts in which nothing is wanted, or that nothing is carried into, are left out.
    """
    height, width = shape = wanted.shape
    bells = [(scale, max(_FINEST_PX, scale * _SMOOTH * spacing_px)) for scale in _SCALES]
    fine = [(scale, sigma) for scale, sigma in bells if sigma < _COARSE_SIGMA]
    coarse = _Coarse.of(read, shape, bells[len(fine) :]) if len(fine) < len(bells) else None
    reach = int(np.ceil(_REACH * fine[-1][1])) + 1 if fine else 0
    part = max(_PART_PX, 2 * reach)
    for window in ((rows, columns) for rows in strips_of(height, part) for columns in strips_of(width, part)):
        if not wanted[window].any():
            continue
        wider = wider_by(window, reach, shape)
        off, rim = read(wider)
        inner = within(window, wider)
        summed = np.zeros((*rim[inner].shape, 4), np.float32) if coarse is None else coarse.shown(window)
        if rim.any():
            told = np.asarray(cv2.merge([off, rim.astype(np.float32)]), np.float32)
            for scale, sigma in fine:
                summed += _smoothed(told, sigma)[inner] / np.float32(scale)
        weight = summed[:, :, 3]
        if weight.any():
            share = np.minimum(1, weight / 1e-3) / np.maximum(weight, 1e-9)
            yield window, times(np.asarray(share, np.float32), summed[:, :, :3])


@dataclass(frozen=True, slots=True, eq=False)
class _Coarse:
    """What is smooth over many pixels: a picture `reduce` times smaller [h, w, 4], last channel the rim."""

    reduce: int
    small: Floats

    @classmethod
    def of(
        cls,
        read: Callable[[Window], tuple[Floats, NDArray[np.bool_]]],
        shape: tuple[int, int],
        bells: list[tuple[float, float]],
    ) -> "_Coarse":
        """What bells make of a rim, together: (scale, sigma), each twice as wide as the one before."""
        height, width = shape
        sigma = bells[0][1]
        reduce = reduction(sigma)
        small = np.zeros((-(-height // reduce), -(-width // reduce), 4), np.float32)
        for rows in strips_of(height, max(reduce, _PART_PX // reduce * reduce)):
            off, rim = read((rows, slice(0, width)))
            if rim.any():
                to = slice(rows.start // reduce, -(-rows.stop // reduce))
                small[to] = _means(np.asarray(cv2.merge([off, rim.astype(np.float32)]), np.float32), reduce)
        return cls(reduce, _doubling(small, sigma / reduce, [scale for scale, _ in bells]))

    def shown(self, window: Window) -> Floats:
        """A window of it at full size [h, w, 4]."""
        # A little more on each side, so that all are read between the pixels that they lie between.
        few = tuple(
            slice(max(0, part.start // self.reduce - 1), min(side, -(-part.stop // self.reduce) + 1))
            for part, side in zip(window, self.small.shape[:2], strict=True)
        )
        rows, columns = (
            slice(part.start - less.start * self.reduce, part.stop - less.start * self.reduce)
            for part, less in zip(window, few, strict=True)
        )
        return _larger(self.small[few], self.reduce)[rows, columns]


def _doubling(told: Floats, sigma: float, scales: list[float]) -> Floats:
    """A picture smoothed by a bell, one twice as wide and so on, over their scales, together: [h, w, C].

    Each wider bell is of the picture at half the size: there they are all of the same width.
    """
    found = _smoothed(told, sigma) / np.float32(scales[0])
    if len(scales) > 1:
        found += _larger(_doubling(_means(told, 2), sigma, scales[1:]), 2)[: len(told), : told.shape[1]]
    return found


def _smoothed(picture: Floats, sigma: float) -> Floats:
    """Under a bell of this width; beyond the picture lies 0."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT), np.float32)


def _larger(picture: Floats, times: int) -> Floats:
    """A picture at so many times its size."""
    size = (picture.shape[1] * times, picture.shape[0] * times)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.float32)


def _means(picture: Floats, reduce: int) -> Floats:
    """The means of squares of `reduce` pixels a side [h, w, C]; beyond the picture lies 0."""
    height, width = picture.shape[:2]
    whole = np.pad(picture, ((0, -height % reduce), (0, -width % reduce), (0, 0)))
    size = (whole.shape[1] // reduce, whole.shape[0] // reduce)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.float32)

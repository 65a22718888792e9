"""The light of a fill: a source brought into that around its hole, and what the hole's rim lacks carried in.

Convention: K places around a hole with colours [K, 3] (RGB in 0..1) and weights [K] by nearness.
"""

from collections.abc import Callable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.strips import Window, strips_of, wider_by, within

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# Light is matched by an offset and a gain between these, drawn towards 1 as if by that share of the variance
# and that much besides: flat surroundings say nothing of contrast.
_GAINS = (0.5, 2.0)
_PRIOR = 0.1
_PRIOR_VARIANCE = 1e-3
MOST_CARRIED = 0.15
"""What a rim lacks is carried in up to this."""
# What is carried in from a rim is smoothed along it over this share of the distance to the next object, times
# each of these: near the rim its own difference counts, further in that of more.
_SMOOTH = 0.125
_SCALES = (0.5, 1.0, 2.0, 4.0)
# Where the finest smoothing is over this many pixels the rim is reduced first, until it is over so many.
_COARSE_SIGMA = 16.0
_LEAST_SIGMA = 4.0
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

    Those of `light` count instead, as far as the colours have not all of the `share` (0..1).
    """
    before, lifted = light if light is not None else (np.ones(3), np.zeros(3))
    parts = (weights / max(float(weights.sum()), 1e-9))[:, None].astype(float)
    mean, wanted_mean = (parts * colours).sum(0), (parts * wanted).sum(0)
    variance = (parts * (colours - mean) ** 2).sum(0)
    together = (parts * (colours - mean) * (wanted - wanted_mean)).sum(0)
    prior = _PRIOR * variance + _PRIOR_VARIANCE
    prior += (1 - share) / share * variance
    gain = np.clip((together + before * prior) / (variance + prior), *_GAINS)
    level = share * wanted_mean + (1 - share) * (before * mean + lifted)
    return gain, level - gain * mean


def rim_of(hole: NDArray, known: NDArray, *, reach_px: float) -> NDArray[np.bool_]:
    """The known pixels [h, w] beside a hole [h, w], up to `reach_px` away from it."""
    far = np.asarray(cv2.distanceTransform((hole == 0).astype(np.uint8), cv2.DIST_L2, 5))
    return (far > 0) & (far <= reach_px) & known


def carried(off: Floats, rim: Floats, *, spacing_px: float) -> Floats:
    """What a rim lacks, carried smoothly to all pixels: `off` [h, w, 3] (0 beside the rim) -> [h, w, 3].

    `rim` [h, w] is 1 on the rim, else 0; `spacing_px` is how far the next object lies. 0 without a rim.
    """
    total, weight = np.zeros_like(off), np.zeros_like(rim)
    for scale in _SCALES:
        sigma = max(_FINEST_PX, scale * _SMOOTH * spacing_px)
        for plane, summed in ((off, total), (rim, weight)):
            blurred = np.asarray(
                cv2.GaussianBlur(plane, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT), np.float32
            )
            blurred /= scale
            summed += blurred
    total *= (np.minimum(1, weight / 1e-3) / np.maximum(weight, 1e-9))[:, :, None]
    return total


def carried_into(
    read: Callable[[Window], tuple[Floats, NDArray[np.bool_]]], shape: tuple[int, int], *, spacing_px: float
) -> Iterator[tuple[Window, Floats]]:
    """`carried` for a picture [h, w] of any size, part by part: where, and what is to be added there.

    `read` gives what the rim lacks in a window, 0 beside the rim, and the rim. Parts that nothing is carried
    into are left out.
    """
    height, width = shape
    finest = _SCALES[0] * _SMOOTH * spacing_px
    if finest >= _COARSE_SIGMA:
        yield from _carried_coarsely(read, shape, 2 ** int(np.log2(finest / _LEAST_SIGMA)), spacing_px)
        return
    reach = int(np.ceil(_REACH * max(_FINEST_PX, _SCALES[-1] * _SMOOTH * spacing_px))) + 1
    part = max(_PART_PX, 2 * reach)
    for rows in strips_of(height, part):
        for columns in strips_of(width, part):
            wider = wider_by((rows, columns), reach, shape)
            off, rim = read(wider)
            if rim.any():
                found = carried(off, rim.astype(np.float32), spacing_px=spacing_px)
                yield (rows, columns), found[within((rows, columns), wider)]


def _carried_coarsely(
    read: Callable[[Window], tuple[Floats, NDArray[np.bool_]]],
    shape: tuple[int, int],
    reduce: int,
    spacing_px: float,
) -> Iterator[tuple[Window, Floats]]:
    """What is smooth over many pixels is known from a picture `reduce` times smaller as well."""
    height, width = shape
    size = -(-height // reduce), -(-width // reduce)
    small, small_rim = np.zeros((*size, 3), np.float32), np.zeros(size, np.float32)
    every = slice(0, width)
    parts = list(strips_of(height, max(reduce, _PART_PX // reduce * reduce)))
    for rows in parts:
        off, rim = read((rows, every))
        if rim.any():
            to = slice(rows.start // reduce, -(-rows.stop // reduce))
            small[to], small_rim[to] = _means(off, reduce), _means(rim.astype(np.float32), reduce)
    if not small_rim.any():
        return
    small = carried(small, small_rim, spacing_px=spacing_px / reduce)
    for rows in parts:
        first, last = max(0, rows.start // reduce - 1), min(size[0], -(-rows.stop // reduce) + 1)
        larger = (size[1] * reduce, (last - first) * reduce)
        found = cv2.resize(small[first:last], larger, interpolation=cv2.INTER_LINEAR)
        start = rows.start - first * reduce
        yield (rows, every), np.asarray(found[start : start + rows.stop - rows.start, :width], np.float32)


def _means(plane: Floats, reduce: int) -> Floats:
    """The means of squares of `reduce` pixels a side; beyond the picture lies 0."""
    more = [(0, -side % reduce) for side in plane.shape[:2]] + [(0, 0)] * (plane.ndim - 2)
    whole = np.pad(plane, more)
    size = (whole.shape[1] // reduce, whole.shape[0] // reduce)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.float32)

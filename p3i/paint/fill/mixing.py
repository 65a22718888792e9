"""The picture of one piece of a hole: what most of its sources show, and grain given back by the best.

A mean comes closest to what is hidden, and is softer than any source: what differs between them averages
out. So each place is drawn from the mean towards the sources' median, which keeps edges that most of them
show. Where the piece is softer still than the softest source, so much of what the best source shows beyond
it is added that it is as sharp.

Convention: a window of the photo, [h, w] pixels; colours float32 RGB.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.ground import Ground
from p3i.paint.fill.sources import Source
from p3i.vision.planes import three, times
from p3i.vision.strips import strips_of

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Sources that count less than this are read only where no other shows anything.
_LEAST = 1e-3
# What a source shows is its own where it is known so far.
_WHOLE = 0.99
# Colours nearer than this to the mean are not told apart from it.
_ALIKE = 0.02
# All sources are held side by side for so many of their pixels.
_AT_A_TIME = 4_000_000
# So many pixels of a picture and what is computed of them are held nearest to the processor.
_AT_HAND = 16_384
_NOTHING = np.float32(1e-9)
_MEAN_OF_THREE = np.full((1, 3), 1 / 3, np.float32)
# Grain is what is finer than this, in pixels.
_GRAIN_PX = 1.5
GRAIN_REACH_PX = 8
"""Grain is told from so many pixels around."""
# So many pixels tell how sharp a window is.
_ASKED = 40_000


def painted(
    ground: Ground,
    found: list[Source],
    weights: Array,
    inside: Mask,
    *,
    corner: tuple[int, int],
    drawn: NDArray[np.uint8] | None,
    fading_px: float,
    grain: float | None = None,
) -> tuple[Floats, Floats, float]:
    """The colours [h, w, 3] of a window at `corner` (x, y) and how surely any source shows them [h, w], 0..1.

    Sharpness is that of the pixels `inside` [h, w]. Where a source's known ground ends it fades over
    `fading_px`. With `drawn` [H, W] only ground of the pattern is shown. Last how much of the best source's
    grain was given back: what it takes, or as much as `grain` says.
    """
    height, width = inside.shape
    mean, weight = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
    wanted = cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    # Those that count little are read only where the others leave something to be shown.
    order = np.argsort(-weights, kind="stable").tolist()
    sharp = {place: _Sharpness() for place in order}
    own = _Sharpness()
    rows = max(1, _AT_A_TIME // max(1, width * len(found)))
    for top in range(0, height, rows):
        band = slice(top, min(height, top + rows))
        shape, here = (width, band.stop - top), inside[band]
        read: list[tuple[Floats, Floats]] = []
        for place in order:
            share = float(weights[place])
            if share < _LEAST:
                if (weight[band][wanted[band]] > 0).all():
                    break
                share = _LEAST
            seen = found[place].window(
                ground, (corner[0], corner[1] + top), shape, drawn=drawn, fading_px=fading_px
            )
            if seen is None:
                continue
            sharp[place].add(seen[0], here & (seen[1] > _WHOLE))
            read.append((seen[0], seen[1] * np.float32(share)))
            weight[band] += read[-1][1]
        mean[band] = _of_most(read, weight[band])
        own.add(mean[band], here & (weight[band] > 0))
    whole = {place: one for place, one in sharp.items() if one.pixels >= max(1, 0.5 * inside.sum())}
    if len(whole) < 2 or grain == 0:
        return mean, weight, 0.0
    softest = min(one.typical() for one in whole.values())
    if grain is None and own.typical() >= softest:
        return mean, weight, 0.0
    best = found[min(whole, key=lambda place: found[place].misfit)]
    lead = best.window(ground, corner, (width, height), drawn=drawn, fading_px=fading_px)
    if lead is None:
        return mean, weight, 0.0
    return mean, weight, _sharpen(mean, lead[0], lead[1], inside, energy=softest, share=grain)


class _Sharpness:
    """The gradient energy of a picture that comes in bands, over its `pixels`."""

    def __init__(self) -> None:
        self.pixels, self.energy = 0, 0.0

    def add(self, colours: Floats, where: Mask) -> None:
        """Add what a band [h, w, 3] shows `where` [h, w]."""
        self.pixels += int(where.sum())
        self.energy += _energy(colours, where)

    def typical(self) -> float:
        """The energy of a pixel; 0 without any."""
        return self.energy / max(1, self.pixels)


def _of_most(read: list[tuple[Floats, Floats]], weight: Floats) -> Floats:
    """What most sources show [h, w, 3]: their mean, one step of Weiszfeld (1937) towards their median.

    The sources are colours [h, w, 3] and how much each counts [h, w]; `weight` [h, w] is the sum of that.
    Rows are done few at a time, so that what is in between stays in the processor's own memory.
    """
    result = np.zeros((*weight.shape, 3), np.float32)
    for rows in strips_of(len(weight), max(1, _AT_HAND // weight.shape[1])):
        part, here = [(colours[rows], counts[rows]) for colours, counts in read], result[rows]
        for colours, counts in part:
            here += times(counts, colours)
        here /= three(np.maximum(weight[rows], _NOTHING))
        if len(read) < 3:
            continue
        total, under = np.zeros_like(here), np.full(here.shape[:2], _NOTHING)
        for colours, counts in part:
            off = cv2.transform(cv2.absdiff(colours, here), _MEAN_OF_THREE)
            nearness = np.asarray(counts / (off + np.float32(_ALIKE)), np.float32)
            total += times(nearness, colours)
            under += nearness
        np.divide(total, three(under), out=here)
    return result


def _sharpen(
    mean: Floats, lead: Floats, known: Floats, inside: Mask, *, energy: float, share: float | None
) -> float:
    """Add grain of the leading source, this share or as much as brings the mean to this energy a pixel."""
    beyond = times(known, lead - mean)
    beyond -= cv2.GaussianBlur(beyond, (0, 0), _GRAIN_PX)
    if share is None:
        whole = inside & (known > _WHOLE)
        count = max(int(whole.sum()), 1)
        plain, square = _energy(mean, whole) / count, _energy(beyond, whole) / count
        both = _energy(mean, whole, beyond) / count
        share = min(1.0, share_to_reach(energy, plain, both, square))
    if share:
        mean += np.float32(share) * beyond
    return share


def share_to_reach(energy: float, plain: float, both: float, square: float) -> float:
    """How much of a detail to add to a picture for this energy: of picture and detail together a square.

    `plain` is the picture's own, `square` the detail's, `both` that of their product. 0 where the picture has
    as much, or there is no detail.
    """
    if plain >= energy or square <= 0:
        return 0.0
    return float((np.sqrt(both**2 + square * (energy - plain)) - both) / square)


def _energy(colours: Floats, where: Mask, other: Floats | None = None) -> float:
    """The sum of squared steps between neighbours, both `where`; or of the products with another's.

    Of a large window every so manyth row tells.
    """
    every = max(1, where.size // _ASKED)
    found = 0.0
    for step in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
        rows, columns = (slice(part.start, part.stop) for part in step)
        here = where[:-1:every, :-1] & where[rows, columns][::every][: len(where[:-1:every])]
        one = (colours[rows, columns][::every] - colours[:-1:every, :-1])[here]
        two = one if other is None else (other[rows, columns][::every] - other[:-1:every, :-1])[here]
        found += float(np.vdot(one, two))
    return found * every


def feathered(inside: Mask, radius: int) -> Floats:
    """A mask's [h, w] own weight near its rim, so that the weights of pieces side by side add up to 1."""
    size = 2 * radius + 1
    weights = cv2.blur(inside.astype(np.float32), (size, size), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(weights, np.float32)

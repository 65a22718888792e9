"""The picture of one piece of a hole: a mean of its sources, and grain given back by the best of them.

A mean comes closest to what is hidden, and is softer than any source: what differs between them averages
out. How much softer is measured, as gradient energy beside that of the sources at the same places, and so
much of what the best source shows beyond the mean is added that the piece is as sharp as the pattern is.

Convention: a window of the photo, [h, w] pixels; colours float32 RGB.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.ground import Ground
from p3i.paint.fill.sources import Source

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Sources that count less than this are read only where no other shows anything.
_LEAST = 1e-3
# What a source shows is its own where it is known so far.
_WHOLE = 0.99
# Grain is what is finer than this, in pixels, and it is given back until the mean is as sharp as this share
# of the sources.
_GRAIN_PX = 1.5
GRAIN_REACH_PX = 8
"""Grain is told from so many pixels around."""
_QUANTILE = 0.25
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
    total, weight = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
    shown: list[_Shown] = []
    wanted = cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    # Those that count little are read only where the others leave something to be shown.
    order = np.argsort(-weights, kind="stable")
    for place in order.tolist():
        share = float(weights[place])
        if share < _LEAST:
            if (weight[wanted] > 0).all():
                break
            share = _LEAST
        source = found[place]
        read = source.window(ground, corner, (width, height), drawn=drawn, fading_px=fading_px)
        if read is None:
            continue
        colours, known = read
        counts = known * np.float32(share)
        total += colours * counts[..., None]
        weight += counts
        shown.append(_shown(source.misfit, colours, known, inside, best=shown))
    mean = (total / np.maximum(weight, 1e-9)[..., None]).astype(np.float32)
    given = _sharpen(mean, shown, inside, grain) if len(shown) > 1 else 0.0
    return mean, weight, given


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """A source in a window: its misfit, its `energy` a pixel (None where it shows too little), its picture.

    The picture, colours [h, w, 3] and how far known [h, w], is kept of the best only.
    """

    misfit: float
    energy: float | None
    picture: tuple[Floats, Floats] | None


def _shown(misfit: float, colours: Floats, known: Floats, inside: Mask, *, best: list[_Shown]) -> _Shown:
    whole = inside & (known > _WHOLE)
    pixels = int(whole.sum())
    if pixels < 0.5 * inside.sum() or not pixels:
        return _Shown(misfit, None, None)
    leads = all(misfit < other.misfit for other in best if other.picture is not None)
    return _Shown(misfit, _energy(colours, whole) / pixels, (colours, known) if leads else None)


def _sharpen(mean: Floats, shown: list[_Shown], inside: Mask, share: float | None) -> float:
    """Add the grain of the best source, this share or as much as makes the mean as sharp as its sources."""
    leading = [one for one in shown if one.picture is not None]
    if not leading:
        return 0.0
    lead, known = leading[-1].picture or (mean, inside)
    wanted = float(np.quantile([one.energy for one in shown if one.energy is not None], _QUANTILE))
    beyond = (lead - mean) * known[..., None]
    beyond -= cv2.GaussianBlur(beyond, (0, 0), _GRAIN_PX)
    if share is None:
        whole = inside & (known > _WHOLE)
        count = max(int(whole.sum()), 1)
        plain, square = _energy(mean, whole) / count, _energy(beyond, whole) / count
        both = _energy(mean, whole, beyond) / count
        share = min(1.0, share_to_reach(wanted, plain, both, square))
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

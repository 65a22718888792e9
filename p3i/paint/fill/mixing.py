"""The picture of one piece of a hole: a mean of its sources, and grain given back by the best of them.

A mean comes closest to what is hidden, and is softer than any source: what differs between them averages out. How much
softer is measured, as gradient energy beside that of the sources at the same places, and so much of
what the best source shows beyond the mean is added that the piece is as sharp as the pattern is.

Convention: a window of the photo, [h, w] pixels; colours float32 RGB.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.sources import Ground, Source

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Sources that count less than this are not read.
_LEAST = 1e-3


def painted(
    ground: Ground,
    found: list[Source],
    weights: Array,
    inside: Mask,
    *,
    corner: tuple[int, int],
    drawn: NDArray[np.uint8] | None,
    fading_px: float,
) -> tuple[Floats, Floats]:
    """The colours [h, w, 3] of a window at `corner` (x, y) and how surely any source shows them [h, w], 0..1.

    Sharpness is that of the pixels `inside` [h, w]. Where a source's known ground ends it fades over
    `fading_px`. With `drawn` [H, W] only ground of the pattern is shown.
    """
    height, width = inside.shape
    total, weight = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
    shown: list[tuple[float, Floats, Floats]] = []
    for source, share in zip(found, weights, strict=True):
        if share < _LEAST and len(found) > 1 and not source.number < 0:
            share = _LEAST
        read = source.window(ground, corner, (width, height), drawn=drawn, fading_px=fading_px)
        if read is None:
            continue
        colours, known = read
        total += colours * (share * known)[..., None]
        weight += share * known
        shown.append((source.misfit, colours, known))
    mean = total / np.maximum(weight, 1e-9)[..., None]
    if len(shown) > 1:
        _sharpen(mean, shown, inside)
    return mean, weight


def _sharpen(mean: Floats, shown: list[tuple[float, Floats, Floats]], inside: Mask) -> None:
    """Add what the best source shows beyond the mean, as much as makes the mean as sharp as its sources."""
    area = max(int(inside.sum()), 1)
    energies, best = [], None
    for misfit, colours, known in shown:
        whole = inside & (known > 0.99)
        if whole.sum() < 0.5 * area:
            continue
        energies.append(_energy(colours, whole) / whole.sum())
        if best is None or misfit < best[0]:
            best = misfit, colours, known
    if best is None:
        return
    wanted = float(np.median(energies))
    beyond = (best[1] - mean) * best[2][..., None]
    # The energy of mean + share * beyond is a square in the share.
    whole = inside & (best[2] > 0.99)
    count = max(int(whole.sum()), 1)
    plain, square, both = (
        _energy(mean, whole) / count,
        _energy(beyond, whole) / count,
        _energy(mean, whole, beyond) / count,
    )
    if plain >= wanted or square <= 0:
        return
    root = both**2 + square * (wanted - plain)
    mean += np.float32(min(1.0, (np.sqrt(root) - both) / square)) * beyond


def _energy(colours: Floats, where: Mask, other: Floats | None = None) -> float:
    """The sum of squared steps between neighbours, both `where`; or of the products with another's."""
    found = 0.0
    for axis in (0, 1):
        here = where[1:] & where[:-1] if axis == 0 else where[:, 1:] & where[:, :-1]
        step = np.diff(colours, axis=axis)[here]
        found += float(np.vdot(step, step if other is None else np.diff(other, axis=axis)[here]))
    return found


def feathered(inside: Mask, radius: int) -> Floats:
    """A mask's own weight near its rim, so that the weights of pieces side by side add up to 1."""
    size = 2 * radius + 1
    return cv2.blur(inside.astype(np.float32), (size, size), borderType=cv2.BORDER_CONSTANT)

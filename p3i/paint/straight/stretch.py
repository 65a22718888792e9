"""A stretch of many neighbouring cells as the photo shows them, for a texture with the variety of many."""

import cv2
import numpy as np

from p3i.paint.straight.aligned import aligned, lit, sampled_evenly
from p3i.paint.straight.light import Light
from p3i.paint.straight.patches import Patch, Patches
from p3i.size import Size
from p3i.vision.image import Image

_COARSE = 24
"""Pixels of a cell's longer side in which stretches are compared."""

_MOST = 512
"""Pixels of a stretch's longer side in which they are."""

_FEATHER = 0.06
"""What a stretch does not show is blended in over this share of a cell's shorter side."""

_ALIKE = 1.25
"""Of the stretches of which no cell differs more than so many times the least, the nearest is taken."""


def likest(
    photo: Image,
    patches: Patches,
    mean: np.ndarray,
    *,
    count: tuple[int, int],
    light: Light,
    k1: float | None,
) -> Patch:
    """The piece of `patches` (of `count` cells each) that is seen most wholly, and has no odd cell.

    `mean` [h, w, 3] is what a cell mostly looks like.
    """
    cell = _coarse(mean, count)
    size = Size(cell.width * count[0], cell.height * count[1])
    stack = aligned(photo, patches, size, size, k1=k1, least=0.0)
    stack = lit(stack, light)
    usual = np.tile(_resized(mean, cell), (count[1], count[0], 1))
    whole = stack.seen.mean(axis=(1, 2))
    odd = np.zeros(len(stack.pieces))
    for k, (values, seen) in enumerate(zip(stack.values, stack.seen, strict=True)):
        apart = np.abs(values / np.float32(65535) - usual).mean(axis=2)
        shape = (count[1], cell.height, count[0], cell.width)
        shown = seen.reshape(shape).sum(axis=(1, 3))
        odd[k] = ((apart * seen).reshape(shape).sum(axis=(1, 3)) / np.maximum(shown, 1)).max()
    good = whole >= whole.max() - 0.005
    return stack.pieces[int(np.flatnonzero(good & (odd <= _ALIKE * odd[good].min() + 1e-9))[0])]


def laid_out(
    photo: Image,
    patches: Patches,
    piece: Patch,
    mean: np.ndarray,
    *,
    count: tuple[int, int],
    size: Size,
    larger: Size,
    light: Light,
    k1: float | None,
) -> tuple[np.ndarray, np.ndarray]:
    """The stretch `piece` on a canvas of `larger`, and where the photo shows it; elsewhere it is the `mean`.

    `size` is what of the canvas becomes the tile. float32 [H, W, 3] in 0..1 and bool [H, W].
    """
    values, seen = sampled_evenly(photo, patches, piece, size, larger, light=light, k1=k1)
    cells = -(-larger.width * count[0] // size.width), -(-larger.height * count[1] // size.height)
    cell = size.width / count[0], size.height / count[1]
    x, y = ((np.arange(side, dtype=np.float32) + 0.5) for side in (larger.width, larger.height))
    h, w = mean.shape[:2]
    wide = np.tile(mean, (cells[1] + 1, cells[0] + 1, 1))
    at = np.meshgrid(x / cell[0] * w - 0.5, y / cell[1] * h - 0.5)
    usual = cv2.remap(
        wide,
        at[0].astype(np.float32),
        at[1].astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    if seen.all():
        return values / np.float32(65535), seen
    feather = max(1.0, _FEATHER * min(cell))
    inside = cv2.distanceTransform(np.pad(seen, 1, mode="edge").astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    share = np.clip(inside / feather, 0, 1)[:, :, None].astype(np.float32)
    return share * (values / np.float32(65535)) + (1 - share) * usual, seen


def _coarse(mean: np.ndarray, count: tuple[int, int]) -> Size:
    height, width = mean.shape[:2]
    share = min(1.0, _COARSE / max(height, width), _MOST / max(height * count[1], width * count[0]))
    return Size(max(2, round(width * share)), max(2, round(height * share)))


def _resized(mean: np.ndarray, size: Size) -> np.ndarray:
    return cv2.resize(mean, (size.width, size.height), interpolation=cv2.INTER_AREA)

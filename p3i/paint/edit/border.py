"""A border painted around a photo: how wide it is, told by its not being what the pattern shows there.

The rim of the photo is filled from the rest by the program. Where a photo has no border, most of what comes
out is as the photo is; under a painted one a whole line along a side is unlike it.

Convention: `Sides` are pixels from the left, top, right and bottom.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from p3i.paint.edit.margins import Sides
from p3i.paint.fill.pieces import cells_on
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.image import Image, resized, resized_from_photo

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]

# A border is no wider than this share of the photo's shorter side.
_WIDEST = 0.06
# It is looked for on a photo no larger than this.
_LONGER = 1024
_MOST_TRIED = 8
# So many pixels of a line tell whether it is of the pattern.
_FEWEST = 32
# A line is unlike the pattern where three in four of its pixels differ more from it than three in four of a
# line farther in do.
_QUARTERS = (25, 75)


def border_px(photo: Image, laid: Placed) -> Sides:
    """How wide a border is painted on each side of a straight photo, 0 where none is or none can be told."""
    small = resized(photo, _LONGER)
    scale = photo.size.longer / small.size.longer
    shrunk = resized_from_photo(1 / scale) @ laid.image_from_plane
    laid = dataclasses.replace(laid, size=small.size, image_from_plane=shrunk)
    width, height = small.size.width, small.size.height
    deep = max(2, round(_WIDEST * min(width, height)))
    rim = np.ones((height, width), bool)
    rim[deep:-deep, deep:-deep] = False
    cells = cells_on(laid, most_px=4.0 * (width + height)) > 0
    hole = rim & cells
    if not hole.any() or not (cells & small.valid & ~rim).any():
        return 0, 0, 0, 0
    pixels, bare = fill_by_stack(small.pixels, small.valid & cells & ~rim, hole, laid, most_tried=_MOST_TRIED)
    off = np.where(hole & small.valid & ~bare, np.abs(pixels - small.pixels).mean(2), np.nan)
    # Each side in turn lies on top.
    left, top, right, bottom = (
        round(scale * _lines(np.rot90(off, turns)[:deep, deep:-deep])) for turns in (3, 0, 1, 2)
    )
    return left, top, right, bottom


def within(size: Size, border: Sides) -> Mask:
    """The pixels [H, W] of a photo that its border leaves."""
    left, top, right, bottom = border
    found = np.zeros((size.height, size.width), bool)
    found[top : size.height - bottom, left : size.width - right] = True
    return found


def _lines(off: NDArray) -> int:
    """How many lines of `off` [d, L], the outermost first, are the border's; nan says nothing."""
    told = np.isfinite(off).sum(1) >= _FEWEST
    if not told.any():
        return 0
    least, most = (np.full(len(off), fill) for fill in (0.0, np.inf))
    least[told], most[told] = np.nanpercentile(off[told], _QUARTERS, axis=1)
    deeper = np.minimum.accumulate(np.append(most[1:], np.inf)[::-1])[::-1]
    unlike = np.flatnonzero(told & (least > deeper))
    return 0 if not len(unlike) else int(unlike[-1]) + 1

"""What the network sees of a hole: its surroundings at the network's scale, and its sources laid upon them.

The photo is made smaller where its cells are larger than the network sees. On that photo the sources of a
hole are found, shifted, lit and weighed as for the method `stack` (sources.py). A *view* is a box of [h, w]
pixels that a matrix lays on it: about the hole itself, or on another cell by the program's own move, and so
alike in size, turn and perspective.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from cv2 import warpPerspective

from p3i.paint.fill.light import membrane, rim_of
from p3i.paint.fill.sources import Array, Floats, Ground, Mask, Source, hole_of, laid_on, sources
from p3i.paint.fill.stack import weighed
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.image import Image, resized, resized_from_photo
from p3i.vision.sheet import project
from p3i.vision.warp import pixel_grid, taken

# The network sees so much round the hole, in distances between cells, ...
_MARGIN, _LEAST_MARGIN_PX = 0.2, 4
# ... and of both about this many pixels a side at most.
_MOST_PX = 84
# Lessons are cut into so many cells at most, the nearest.
_MOST_CELLS = 160
# So many of the nearest cells are tried as sources: fewer than by the stack, as there are many lessons.
_MOST_TRIED = 24
# No source counts for nothing: the network starts from the logarithms.
_LEAST_WEIGHT = 1e-4
# The rim at which the membranes hang, in pixels of the view.
_RIM_PX = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A photo at the network's scale, and the views of it that are like a hole's own.

    `from_photo` [3, 3] takes the photo's pixels to those of `ground`, on which `placed` lies; `known` [H, W]
    is evidence there. `hole` [h, w] is seen through the first of the `views` [M, 3, 3], ground from view; the
    others show other cells. `pitch_px` is how far the next object lies.
    """

    from_photo: Array
    ground: Ground
    known: Mask
    placed: Placed
    hole: Mask
    views: Array
    pitch_px: float

    def seen(self, view: Array) -> tuple[Array, Mask]:
        """Where the pixels of a view lie on the ground [h * w, 2], and which are evidence [h, w]."""
        height, width = self.hole.shape
        grid = pixel_grid(Size(width, height), dtype=torch.float64).numpy().reshape(-1, 2)
        at, front = project(view, grid)
        return at, (front & self.ground.known(at)).reshape(height, width)

    def on_photo(self, source: Source) -> Source:
        """A source that was found on the ground, between pixels of the photo itself."""
        from_hole = np.linalg.inv(self.from_photo) @ source.from_hole @ self.from_photo
        return dataclasses.replace(
            source, from_hole=from_hole, shift_px=source.shift_px / self.from_photo[0, 0]
        )


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """What the network sees of one hole, through one view.

    `target` [h, w, 3] (inside the hole it is the truth where that is known, and never shown to the network),
    `hole` bool [h, w], `context` bool [h, w] (known, outside the hole), `sources` [K, h, w, 3] in the hole's
    light, `known` bool [K, h, w], `lifts` [K, h, w, 3] the membranes, `weights` [K], `found` the K sources.
    """

    target: Floats
    hole: Mask
    context: Mask
    sources: Floats
    known: Mask
    lifts: Floats
    weights: Floats
    found: list[Source]


def window_of(photo: Image, placed: Placed, part: Mask, *, working_px: int) -> Window:
    """The window of one part of a hole [H, W], with cells at most `working_px` wide.

    What is hidden is not valid in `photo`; its pixels hold what it is filled with.
    """
    rows, columns = np.nonzero(part)
    pitch = hole_of(_pixels_of(part), photo.pixels, photo.valid, placed).spacing_px
    longest = max(np.ptp(rows), np.ptp(columns)) + 1 + 2 * _MARGIN * pitch
    longer = max(1, round(photo.size.longer * min(1.0, working_px / pitch, _MOST_PX / longest)))
    scale = longer / photo.size.longer
    masks = np.stack([photo.valid, part, part], -1).astype(np.float32)
    everywhere = np.ones(part.shape, bool)
    small, marked = (resized(Image(values, everywhere), longer) for values in (photo.pixels, masks))
    known, hidden = marked.pixels[:, :, 0] > 0.999, marked.pixels[:, :, 1] > 0
    from_photo = resized_from_photo(scale)
    laid = dataclasses.replace(placed, size=small.size, image_from_plane=from_photo @ placed.image_from_plane)
    ground = Ground.of(small.pixels, known)
    own = hole_of(_pixels_of(hidden), small.pixels, known, laid)
    margin = max(_LEAST_MARGIN_PX, round(_MARGIN * own.spacing_px))
    corner = own.points.min(0) - margin
    width, height = (own.points.max(0) + margin + 1 - corner).astype(int)
    columns, rows = (own.points - corner).astype(int).T
    hole = np.zeros((height, width), bool)
    hole[rows, columns] = True
    view = np.array([[1, 0, corner[0]], [0, 1, corner[1]], [0, 0, 1]])
    views = [view, *(matrix @ view for matrix in laid_on(own, ground, laid, most=_MOST_CELLS))]
    return Window(from_photo, ground, known, laid, hole, np.array(views), own.spacing_px)


def gather(window: Window, hole: Mask, view: Array, *, most: int) -> Stack | None:
    """The stack of a hole [h, w] seen through a view, with at most so many sources.

    None where nothing is known round the hole, or no other cell shows what should be in it.
    """
    pixels = window.ground.pixels
    height, width = window.known.shape
    # The ground that the hole takes is hidden wherever a source might show it.
    hidden = warpPerspective(hole.astype(np.float32), view, (width, height)) > 0.01
    if not hidden.any():
        return None
    known = window.known & ~hidden
    ground = Ground.of(pixels, known)
    one = hole_of(_pixels_of(hidden), pixels, known, window.placed)
    found = sources(one, ground, window.placed, most=_MOST_TRIED, kept=most)
    if not found:
        return None
    at, seen = window.seen(view)
    target = np.clip(taken(pixels, at, sharp=True), 0, 1).reshape(*hole.shape, 3)
    context = seen & ~hole
    shown, knowns, lifts = [], [], []
    for source in found:
        places, front = source.where(at)
        colours = (source.gain * taken(pixels, places, sharp=True) + source.offset).astype(np.float32)
        shown.append(colours.reshape(target.shape))
        knowns.append((front & ground.known(places)).reshape(hole.shape))
        rim = rim_of(hole, context & knowns[-1], reach_px=_RIM_PX)
        lifts.append(membrane(target - shown[-1], rim, spacing_px=window.pitch_px))
    weights = np.maximum(weighed(one, ground, found), _LEAST_WEIGHT).astype(np.float32)
    return Stack(target, hole, context, np.stack(shown), np.stack(knowns), np.stack(lifts), weights, found)


def _pixels_of(mask: Mask) -> Array:
    """The pixels [L, 2] of a mask."""
    return np.argwhere(mask)[:, ::-1].astype(float)

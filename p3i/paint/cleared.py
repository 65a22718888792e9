"""A photo without its objects: the ground that lies between them, continued under them.

The colour under an object is the smooth continuation of the ground around it; its texture is that of the
ground at half a step's distance, where the cell has none of an object.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool or float32 [H, W].
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.cells import frames
from p3i.paint.cutout import Cutout
from p3i.paint.outlines import chart_of, polygons
from p3i.paint.placed import Placed
from p3i.vision.fill import filled
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# What is cleared reaches this far beyond an object, in its radii: edges are blurred, and objects slip.
_WIDER = 0.12
# Of the ground between an object and its cell's border, they take this share at most.
_OF_ROOM = 0.3
_LEAST_ALPHA = 0.1
# The ground's light is smooth over this share of a cell; it needs so many rounds to come under an object.
_BLUR = 0.12
_DIFFUSIONS = 12
# Texture is faint; what differs more from the light of the ground is another thing that lies there.
_MOST_TEXTURE = 0.08


def windows(placed: Placed, cut: Cutout, *, scale: float = 1.0) -> list[tuple[slice, slice] | None]:
    """Where each object may reach on the photo, rows and columns; None for those out of sight."""
    half = (cut.alpha.shape[0] - 1) / 2 * cut.step * scale
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0)])
    found: list[tuple[slice, slice] | None] = []
    for frame in frames(placed):
        pixels, front = project(placed.image_from_plane, corners @ frame[:2, :2].T + frame[:2, 2])
        low = np.maximum(np.floor(pixels.min(0)), 0).astype(int)
        limit = np.array([placed.size.width, placed.size.height])
        high = np.minimum(np.ceil(pixels.max(0)) + 1, limit).astype(int)
        seen = front.all() and (high > low).all()
        found.append((slice(low[1], high[1]), slice(low[0], high[0])) if seen else None)
    return found


def local_points(placed: Placed, frame: Array, window: tuple[slice, slice]) -> Array:
    """Where the pixels of a window lie about an object, in program units: [N, 2], row by row."""
    rows, columns = np.mgrid[window]
    pixels = np.stack([columns.ravel(), rows.ravel()], 1).astype(float)
    points, _ = project(np.linalg.inv(placed.image_from_plane), pixels)
    return (points - frame[:2, 2]) @ frame[:2, :2]


def object_masks(
    placed: Placed, cut: Cutout, *, wider: float = 1.0
) -> list[tuple[tuple[slice, slice], Floats]]:
    """For each object in sight its window and how much of each pixel it covers; `wider` scales it."""
    found: list[tuple[tuple[slice, slice], Floats]] = []
    for frame, window in zip(frames(placed), windows(placed, cut), strict=True):
        if window is None:
            continue
        rows, columns = window
        local = local_points(placed, frame, window) / wider
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        found.append((window, cut.at(local).reshape(shape)))
    return found


def covered(placed: Placed, cut: Cutout) -> Mask:
    """The pixels that objects cover, with a little around them: [H, W]."""
    wider = 1 + min(_WIDER, _OF_ROOM * cut.room / max(0.5 - cut.room, 0.05))
    mask = np.zeros((placed.size.height, placed.size.width), bool)
    for window, alpha in object_masks(placed, cut, wider=wider):
        mask[window] |= alpha > _LEAST_ALPHA
    return mask


def cleared(pixels: Floats, valid: Mask, placed: Placed, objects: Mask, cut: Cutout) -> Floats:
    """The photo with the ground continued under `objects` [H, W]: float32 [H, W, 3]."""
    ground = valid & ~objects
    if not ground.any():
        return pixels
    known = np.where(ground[:, :, None], pixels, np.float32(0))
    sigma = max(1.0, _BLUR * _pitch_px(placed))
    weight = cv2.GaussianBlur(ground.astype(np.float32), (0, 0), sigma)
    even = cv2.GaussianBlur(known, (0, 0), sigma) / np.maximum(weight, 1e-4)[:, :, None]
    # The ground's light, carried under the objects as a membrane is: by diffusion from all sides.
    under = filled(np.where(ground[:, :, None], even, np.float32(0)), ground)
    for _ in range(_DIFFUSIONS):
        under = np.where(ground[:, :, None], even, cv2.GaussianBlur(under, (0, 0), sigma))
    detail = np.where(ground[:, :, None], pixels - even, np.float32(0))
    texture = _texture(detail, ground, placed, objects)
    return np.where(
        objects[:, :, None], np.clip(under + np.clip(texture, -_MOST_TEXTURE, _MOST_TEXTURE), 0, 1), pixels
    ).astype(np.float32)


def _texture(detail: Floats, ground: Mask, placed: Placed, objects: Mask) -> Floats:
    """What the ground half a step away has beside its smooth part, for the pixels of `objects`."""
    found = np.zeros_like(detail)
    rows, columns = np.nonzero(objects)
    left = np.ones(len(rows), bool)
    points, _ = project(np.linalg.inv(placed.image_from_plane), np.stack([columns, rows], 1).astype(float))
    inner = cv2.erode(ground.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    for move in _half_steps(placed):
        at, front = project(placed.image_from_plane, points[left] + move)
        x, y = np.rint(at).astype(int).T
        inside = front & (x >= 0) & (y >= 0) & (x < ground.shape[1]) & (y < ground.shape[0])
        inside[inside] = inner[y[inside], x[inside]]
        places = np.flatnonzero(left)[inside]
        found[rows[places], columns[places]] = detail[y[inside], x[inside]]
        left[places] = False
    return found


def _half_steps(placed: Placed) -> Array:
    """Moves on the plane from objects to the ground between them, the middle of cells before their sides."""
    middle = placed.index[np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T))].astype(float)
    halves = np.array(
        [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)] + [(0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5)]
    )
    moves = placed.at(middle + halves) - placed.at(middle[None])
    moves = np.concatenate([moves, 0.6 * moves, 0.8 * moves])
    return moves[np.hypot(*moves.T) > 1e-6]


def _pitch_px(placed: Placed) -> float:
    """The typical width of a cell on the photo."""
    cells, front = project(placed.image_from_plane, polygons(chart_of(placed.pattern), placed.index))
    sides = (cells.max(1) - cells.min(1)).min(1)[front.all(1)]
    return float(np.median(sides)) if len(sides) else 8.0

"""A photo without its objects: the ground that lies between them, continued under them.

The colour under an object is the smooth continuation of the ground around it; its texture is that of the
ground at half a step's distance, where the cell has none of an object.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool or float32 [H, W].
"""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.cutout import Cutout
from p3i.place.moves import frames
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed
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
# Light that is smooth over at least twice as many pixels is computed on a reduced picture.
_FINEST_SIGMA = 4.0
# Rows of the photo whose texture is looked up at once.
_STRIP = 512


def windows(placed: Placed, cut: Cutout, *, scale: float = 1.0) -> list[tuple[slice, slice] | None]:
    """Where each object may reach on the photo, rows and columns; None for those out of sight."""
    rows, columns = np.nonzero(cut.alpha > 0)
    half = (cut.alpha.shape[0] - 1) / 2
    # The grid's places that hold something of the object, and one more all around.
    low, high = (
        (np.array([end(columns), end(rows)]) - half + one) * cut.step * scale
        for end, one in ((np.min, -1), (np.max, 1))
    )
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), (0, 0)])
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
    """Where the pixels of a window lie about an object, in program units: [K, 2], row by row."""
    rows, columns = np.mgrid[window]
    pixels = np.stack([columns.ravel(), rows.ravel()], 1).astype(float)
    points, _ = project(np.linalg.inv(placed.image_from_plane), pixels)
    return (points - frame[:2, 2]) @ frame[:2, :2]


def object_masks(
    placed: Placed, cut: Cutout, *, wider: float = 1.0
) -> Iterator[tuple[tuple[slice, slice], Floats]]:
    """For each object in sight its window and how much of each pixel it covers [h, w]; `wider` scales it."""
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    half = (cut.alpha.shape[0] - 1) / 2
    grid_from_local = np.diag([1 / (cut.step * wider), 1 / (cut.step * wider), 1.0])
    grid_from_local[:2, 2] = half
    for frame, window in zip(frames(placed), windows(placed, cut, scale=wider), strict=True):
        if window is None:
            continue
        rows, columns = window
        image_from_window = np.eye(3)
        image_from_window[:2, 2] = columns.start, rows.start
        matrix = grid_from_local @ np.linalg.inv(frame) @ plane_from_image @ image_from_window
        size = (columns.stop - columns.start, rows.stop - rows.start)
        # Beyond the grid nothing lies: the border is 0.
        how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        yield window, np.asarray(cv2.warpPerspective(cut.alpha, matrix, size, flags=how), np.float32)


def covered(placed: Placed, cut: Cutout) -> Mask:
    """The pixels that objects cover, with a little around them: [H, W]."""
    wider = 1 + min(_WIDER, _OF_ROOM * cut.room / max(0.5 - cut.room, 0.05))
    mask = np.zeros((placed.size.height, placed.size.width), bool)
    for window, alpha in object_masks(placed, cut, wider=wider):
        mask[window] |= alpha > _LEAST_ALPHA
    return mask


def cleared(pixels: Floats, valid: Mask, placed: Placed, objects: Mask) -> Floats:
    """The photo with the ground continued under `objects` [H, W]: float32 [H, W, 3]."""
    ground = valid & ~objects
    if not ground.any():
        return pixels
    even, under = _light(pixels, ground, sigma=max(1.0, _BLUR * _pitch_px(placed)))
    result = pixels.copy()
    detail = np.subtract(pixels, even, out=even)
    detail[~ground] = 0
    inner = cv2.erode(ground.astype(np.uint8), np.ones((3, 3), np.uint8))
    moves = [_move(placed, each) for each in _half_steps(placed)]
    # In strips: what is looked up for each pixel takes more memory than the photo.
    for start in range(0, len(objects), _STRIP):
        rows = slice(start, start + _STRIP)
        wanted = objects[rows]
        if not wanted.any():
            continue
        texture = _texture(detail, inner, moves, wanted, top=start)
        grown = under[rows][wanted] + np.clip(texture[wanted], -_MOST_TEXTURE, _MOST_TEXTURE)
        result[rows][wanted] = np.clip(grown, 0, 1)
    return result


def _light(pixels: Floats, ground: Mask, *, sigma: float) -> tuple[Floats, Floats]:
    """The ground's light, smooth over `sigma` pixels, and the same carried on under what is no ground.

    Both [H, W, 3]. What is that smooth is known from a reduced picture as well.
    """
    height, width = ground.shape
    reduce = 2 ** max(0, int(np.log2(sigma / _FINEST_SIGMA)))
    known, weight = np.where(ground[:, :, None], pixels, np.float32(0)), ground.astype(np.float32)
    size = (max(1, -(-width // reduce)), max(1, -(-height // reduce)))
    if reduce > 1:
        known, weight = (cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in (known, weight))
        sigma = sigma * size[0] / width
    spread = cv2.GaussianBlur(weight, (0, 0), sigma)
    even = cv2.GaussianBlur(known, (0, 0), sigma) / np.maximum(spread, 1e-4)[:, :, None]
    # Carried under the objects as a membrane is: by diffusion from all sides.
    fixed = weight >= 0.5
    under = filled(np.where(fixed[:, :, None], even, np.float32(0)), fixed)
    for _ in range(_DIFFUSIONS):
        under = np.where(fixed[:, :, None], even, cv2.GaussianBlur(under, (0, 0), sigma))
    if reduce > 1:
        even, under = (
            cv2.resize(each, (width, height), interpolation=cv2.INTER_LINEAR) for each in (even, under)
        )
    return np.asarray(even, np.float32), np.asarray(under, np.float32)


def _move(placed: Placed, step: Array) -> Array:
    """A step on the plane as the homography [3, 3] of the photo; its third coordinate is > 0 in front."""
    moved = np.eye(3)
    moved[:2, 2] = step
    return placed.image_from_plane @ moved @ np.linalg.inv(placed.image_from_plane)


def _texture(detail: Floats, inner: NDArray[Any], moves: list[Array], wanted: Mask, *, top: int) -> Floats:
    """What the ground half a step away has beside its smooth part: [h, W, 3], 0 where nothing is `wanted`.

    `wanted` [h, W] is a strip of the photo from row `top` on; `detail` [H, W, 3] is read where `inner` is 1.
    """
    found = np.zeros((*wanted.shape, 3), np.float32)
    left = wanted.copy()
    photo_from_strip = np.array([[1, 0, 0], [0, 1, top], [0, 0, 1.0]])
    how = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    for move in moves:
        rows, columns = (np.flatnonzero(left.any(axis)) for axis in (1, 0))
        if not len(rows):
            break
        # Only where something is left.
        part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        corner = np.array([[1, 0, part[1].start], [0, 1, part[0].start], [0, 0, 1.0]])
        matrix = move @ photo_from_strip @ corner
        size = (part[1].stop - part[1].start, part[0].stop - part[0].start)
        depth = (
            matrix[2, 0] * np.arange(size[0]) + (matrix[2, 1] * np.arange(size[1]) + matrix[2, 2])[:, None]
        )
        shown = (cv2.warpPerspective(inner, matrix, size, flags=how) > 0) & (depth > 1e-9) & left[part]
        if shown.any():
            found[part][shown] = cv2.warpPerspective(detail, matrix, size, flags=how)[shown]
            left[part] &= ~shown
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

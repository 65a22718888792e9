"""Pictures laid onto the plane: warped by the camera, the far ones first.

Convention: sprites are RGBA float32 [h, w, 4] in 0..1, premultiplied by alpha, so that filters and warps
mix no colour of transparent pixels in. A sprite's rectangle is centred on its object, upright on the plane.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from p3i.paint.draw.view import View
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import warp_pixels

_FINE = 3
"""Each sprite is warped this many times larger, then reduced."""


@dataclass(frozen=True, slots=True, eq=False)
class Sprite:
    """A picture for objects, and its smaller copies: `levels[k]` is about 2^k times smaller."""

    levels: tuple[np.ndarray, ...]

    @property
    def size(self) -> Size:
        return Size(self.levels[0].shape[1], self.levels[0].shape[0])


def sprite_of(image: Image) -> Sprite:
    """A sprite from a photo; what is transparent or unknown in the photo shows what lies below."""
    alpha = image.valid.astype(np.float32) if image.source.alpha is None else image.source.alpha
    level = premultiplied(image.pixels, alpha)
    levels = [level]
    while max(level.shape[:2]) > 1:
        height, width = (max(1, round(side / 2)) for side in level.shape[:2])
        level = cv2.resize(level, (width, height), interpolation=cv2.INTER_AREA)
        levels.append(level)
    return Sprite(tuple(levels))


def premultiplied(pixels: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """RGB [H, W, 3] and alpha [H, W], both in 0..1 -> premultiplied RGBA float32 [H, W, 4]."""
    return np.concatenate([pixels * alpha[:, :, None], alpha[:, :, None]], axis=2).astype(np.float32)


def plain(layer: np.ndarray) -> np.ndarray:
    """Premultiplied RGBA float [H, W, 4] in 0..1 -> uint8 [H, W, 4] with plain alpha."""
    alpha = layer[:, :, 3:]
    colour = layer[:, :, :3] / np.maximum(alpha, 1e-6)
    return np.rint(255 * np.clip(np.concatenate([colour, alpha], axis=2), 0, 1)).astype(np.uint8)


def lay(view: View, sprites: Sequence[Sprite], points: np.ndarray, *, units: float) -> np.ndarray:
    """The layer of sprites at the plane's `points` [M, 2]: uint8 [H, W, 4], plain alpha.

    The sprites are taken in turn. `units` is the longer side of a sprite on the plane. Later points stand
    before earlier ones at equal depth; the far ones are painted first.
    """
    layer = np.zeros((view.size.height, view.size.width, 4), np.float32)
    _, depth = view.project(points)
    order = [k for k in np.argsort(-depth, kind="stable").tolist() if depth[k] > 1e-3 * view.depth_unit]
    for k in order:
        placed = _placed(view, sprites[k % len(sprites)], points[k], units)
        if placed is not None:
            rows, columns, piece = placed
            window = layer[rows, columns]
            window *= 1 - piece[:, :, 3:]
            window += piece
    return plain(layer)


def _placed(
    view: View, sprite: Sprite, point: np.ndarray, units: float
) -> tuple[slice, slice, np.ndarray] | None:
    """Where one sprite falls on the canvas, and its premultiplied pixels there; None if it is outside."""
    width, height = (units * side / sprite.size.longer for side in (sprite.size.width, sprite.size.height))
    around = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * (width, height)
    outline, depth = view.project(point + around)
    bounds = _bounds(view, outline, point + around)
    if bounds is None:
        return None
    low, high = bounds
    region = Size(*(high - low).tolist())
    level = _level(view, sprite, point, units)
    source = np.pad(sprite.levels[level], ((1, 1), (1, 1), (0, 0)))  # transparent all around
    tall, wide = sprite.levels[level].shape[:2]
    # Pixels of the padded picture: (0.5, 0.5) is the sprite's upper left corner.
    source_from_plane = np.array(
        [[wide / width, 0, wide / 2 + 0.5], [0, tall / height, tall / 2 + 0.5], [0, 0, 1]]
    )
    plane_from_object = np.array([[1, 0, -point[0]], [0, 1, -point[1]], [0, 0, 1]])
    canvas_from_fine = np.array(
        [[1 / _FINE, 0, low[0] + 0.5 / _FINE - 0.5], [0, 1 / _FINE, low[1] + 0.5 / _FINE - 0.5], [0, 0, 1]]
    )
    plane_from_canvas = np.linalg.inv(view.canvas_from_plane)
    source_from_fine = source_from_plane @ plane_from_object @ plane_from_canvas @ canvas_from_fine
    fine = Size(region.width * _FINE, region.height * _FINE)
    piece = warp_pixels(source, source_from_fine, fine)
    if not (depth > 0).all():
        piece = piece * in_front(plane_from_canvas @ canvas_from_fine, fine)[:, :, None]
    piece = cv2.resize(piece, (region.width, region.height), interpolation=cv2.INTER_AREA)
    return slice(low[1], high[1]), slice(low[0], high[0]), piece


def _bounds(view: View, outline: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The rectangle of the canvas that a sprite may cover: first pixel and end; None if there is none."""
    canvas = np.array([view.size.width, view.size.height])
    if not np.isfinite(outline).all():  # it reaches behind the camera: what is left ends at the canvas
        seen = view.project_segments(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)).reshape(-1, 2)
        edge = canvas - 1.0
        frame = np.array([(0, 0), (edge[0], 0), edge, (0, edge[1])])
        plane = np.concatenate([frame, np.ones((4, 1))], axis=1) @ np.linalg.inv(view.canvas_from_plane).T
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = plane[:, :2] / np.where(plane[:, 2:] > 0, plane[:, 2:], np.nan)
        inside = ((plane >= corners.min(axis=0)) & (plane <= corners.max(axis=0))).all(axis=1)
        outline = np.concatenate([seen, frame[inside]])
        if not len(outline):
            return None
    low = np.clip(np.floor(outline.min(axis=0)) - 1, 0, canvas).astype(int)
    high = np.clip(np.ceil(outline.max(axis=0)) + 2, 0, canvas).astype(int)
    return None if (low >= high).any() else (low, high)


def in_front(plane_from_canvas: np.ndarray, size: Size) -> np.ndarray:
    """Which pixels of a canvas see the plane, and not what lies behind the camera: bool [H, W]."""
    x, y = np.arange(size.width), np.arange(size.height)[:, None]
    a, b, c = plane_from_canvas[2]
    return a * x + b * y + c > 0


def _level(view: View, sprite: Sprite, point: np.ndarray, units: float) -> int:
    """The copy of the sprite with about one pixel to one of the finer canvas, where it is densest."""
    (here, there_x, there_y), _ = view.project(point + units * 1e-4 * np.array([(0, 0), (1.0, 0), (0, 1)]))
    jacobian = np.stack([there_x - here, there_y - here], axis=1) / 1e-4  # canvas pixels per sprite
    least = float(np.linalg.svd(jacobian, compute_uv=False)[-1]) * _FINE
    excess = sprite.size.longer / max(least, 1e-3)
    return int(np.clip(np.floor(np.log2(max(excess, 1))), 0, len(sprite.levels) - 1))

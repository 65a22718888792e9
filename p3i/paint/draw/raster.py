"""A scene as pixels, anti-aliased.

Convention: uint8 [H, W, 3], or [H, W, 4] with plain alpha where the paper is transparent. Colours are
blended as they are stored, as browsers and viewers of vector pictures do.
"""

from collections.abc import Iterator
from functools import lru_cache

import cv2
import numpy as np
from PIL import Image as Pil
from PIL import ImageDraw, ImageFont

from p3i.paint.draw.scene import TO_BASELINE, Dots, Labels, Pixels, Scene, Strokes
from p3i.size import Size

_FINE = 4
"""Lines are drawn this many times larger, then reduced."""

_TILE = 256
"""Side of the squares in which lines are drawn, so that memory does not grow with the picture."""

_SHIFT = 4
"""Bits of OpenCV's fixed-point coordinates after the point."""


def paint(scene: Scene) -> np.ndarray:
    """The pixels of a scene: uint8 [H, W, 3], or [H, W, 4] where it has no paper."""
    channels = 3 if scene.paper is not None else 4
    canvas = np.zeros((scene.size.height, scene.size.width, channels), np.uint8)
    if scene.paper is not None:
        canvas[:] = scene.paper
    for layer in scene.layers:
        match layer:
            case Pixels(values=values):
                _paint_pixels(canvas, values)
            case Strokes():
                _paint_strokes(canvas, layer)
            case Dots():
                _paint_dots(canvas, layer)
            case Labels():
                _paint_labels(canvas, layer)
    return canvas


def _paint_pixels(canvas: np.ndarray, values: np.ndarray) -> None:
    if values.shape[2] == 3:
        canvas[:, :, :3] = values
        canvas[:, :, 3:] = 255
        return
    for rows in _bands(len(canvas)):
        blend(canvas[rows], values[rows, :, :3], values[rows, :, 3] / np.float32(255))


def _paint_strokes(canvas: np.ndarray, strokes: Strokes) -> None:
    low = strokes.segments.min(axis=1) - strokes.width
    high = strokes.segments.max(axis=1) + strokes.width
    colour = np.array(strokes.colour, np.uint8)
    for left, top in _tiles(Size(canvas.shape[1], canvas.shape[0])):
        tile = canvas[top : top + _TILE, left : left + _TILE]
        height, width = tile.shape[:2]
        near = (high >= (left, top)).all(axis=1) & (low <= (left + width, top + height)).all(axis=1)
        if near.any():
            covered = _line_coverage(strokes.segments[near] - (left, top), strokes.width, Size(width, height))
            blend(tile, colour, covered * np.float32(strokes.opacity))


def _line_coverage(segments: np.ndarray, width: float, size: Size) -> np.ndarray:
    """How much of each pixel lies under lines: float32 [H, W] in 0..1."""
    fine = np.zeros((size.height * _FINE, size.width * _FINE), np.uint8)
    # Pixel centres at whole numbers, here and in the finer picture.
    ends = (segments + 0.5) * _FINE - 0.5
    along = ends[:, 1] - ends[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    # OpenCV fills a polygon's edge too, half a pixel more on each side.
    along = along * max(0.0, width * _FINE - 1) / 2
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    first, last = ends[:, 0] - along, ends[:, 1] + along
    outline = np.stack([first - across, last - across, last + across, first + across], axis=1)
    for quad in np.rint(outline * 2**_SHIFT).astype(np.int32):
        cv2.fillConvexPoly(fine, quad, 255, cv2.LINE_8, _SHIFT)
    return _reduced(fine)


def _paint_dots(canvas: np.ndarray, dots: Dots) -> None:
    height, width = canvas.shape[:2]
    for center, axes, angle, colour, rim in zip(
        dots.centers, dots.axes, np.radians(dots.angles_deg), dots.colours, dots.rims, strict=True
    ):
        reach = float(axes.max()) + dots.rim_width + 1
        left, top = (max(0, int(part)) for part in np.floor(center - reach))
        right, bottom = (int(part) + 1 for part in np.ceil(center + reach))
        for x0, y0 in _tiles(
            Size(max(1, min(right, width)), max(1, min(bottom, height))), left=left, top=top
        ):
            window = canvas[y0 : min(bottom, y0 + _TILE), x0 : min(right, x0 + _TILE)]
            x = np.arange(x0, x0 + window.shape[1], dtype=np.float32) - np.float32(center[0])
            y = np.arange(y0, y0 + window.shape[0], dtype=np.float32)[:, None] - np.float32(center[1])
            u, v = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
            blend(window, rim, _ellipse_coverage(u, v, axes + dots.rim_width / 2))
            blend(window, colour, _ellipse_coverage(u, v, np.maximum(axes - dots.rim_width / 2, 0.3)))


def _paint_labels(canvas: np.ndarray, labels: Labels) -> None:
    height, width = canvas.shape[:2]
    for text, (x, y), size, rim in labels.words():
        font = _font(max(1, round(size)))
        reach = int(np.ceil(font.getlength(text) / 2 + rim + 2)), int(np.ceil(size + rim + 2))
        left, top = round(x) - reach[0], round(y) - reach[1]
        box = Pil.new("L", (2 * reach[0] + 1, 2 * reach[1] + 1))
        foot = (x - left, y - top + TO_BASELINE * size)
        for stroke, colour in ((rim, labels.rim), (0, labels.colour)):
            box.paste(0, (0, 0, *box.size))
            ImageDraw.Draw(box).text(foot, text, 255, font, anchor="ms", stroke_width=round(stroke))
            rows = slice(max(0, top), max(0, min(height, top + box.height)))
            columns = slice(max(0, left), max(0, min(width, left + box.width)))
            covered = np.asarray(box, np.float32)[
                rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
            ]
            if covered.size:
                blend(canvas[rows, columns], np.array(colour, np.uint8), covered / np.float32(255))


@lru_cache(maxsize=64)
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The font that Pillow brings along."""
    return ImageFont.load_default(size=size)


def _ellipse_coverage(u: np.ndarray, v: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """How much of each pixel lies in an ellipse, by the distance to its edge (to first order)."""
    a, b = axes.astype(np.float32)
    level = np.sqrt((u / a) ** 2 + (v / b) ** 2)
    slope = np.sqrt((u / (a * a)) ** 2 + (v / (b * b)) ** 2) / np.maximum(level, 1e-6)
    return np.clip(0.5 + (1 - level) / np.maximum(slope, 1e-6), 0, 1)


def blend(canvas: np.ndarray, colour: np.ndarray, opacity: np.ndarray) -> None:
    """Paint over `canvas` [H, W, 3 or 4] uint8 in place: `colour` [3] or [H, W, 3], `opacity` [H, W]."""
    if not opacity.any():
        return
    over = opacity[:, :, None]
    if canvas.shape[2] == 3:
        canvas[:] = np.rint(canvas + over * (np.asarray(colour, np.float32) - canvas))
        return
    under = canvas[:, :, 3:].astype(np.float32) / 255 * (1 - over)
    total = over + under
    mixed = (over * np.asarray(colour, np.float32) + under * canvas[:, :, :3]) / np.maximum(total, 1e-6)
    canvas[:, :, :3] = np.rint(mixed)
    canvas[:, :, 3:] = np.rint(total * 255)


def _reduced(fine: np.ndarray) -> np.ndarray:
    height, width = (side // _FINE for side in fine.shape)
    return cv2.resize(fine.astype(np.float32) / 255, (width, height), interpolation=cv2.INTER_AREA)


def _bands(height: int) -> Iterator[slice]:
    for top in range(0, height, _TILE):
        yield slice(top, top + _TILE)


def _tiles(end: Size, *, left: int = 0, top: int = 0) -> Iterator[tuple[int, int]]:
    """The upper left corners of the squares that cover a canvas from (left, top) up to `end`."""
    for y in range(top, end.height, _TILE):
        for x in range(left, end.width, _TILE):
            yield x, y

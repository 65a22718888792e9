"""What a picture consists of, before anyone decides between pixels and vectors.

Convention: pixels of the canvas, pixel centres at whole numbers; colours are RGB of 0..255. Layers are
painted in order.
"""

import colorsys
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from p3i.paint.draw.view import View, clip_to_canvas
from p3i.size import Size

Colour = tuple[int, int, int]

WHITE: Colour = (255, 255, 255)
_INK: Colour = (25, 28, 38)
_GRID: Colour = (163, 170, 184)
_HORIZON: Colour = (214, 40, 57)
_LAST_HUE = 0.78
"""Hues run from red to violet and stop before they come back to red."""

_RIM_SHARE = 0.13
"""The rim of letters, as a share of their size."""

TO_BASELINE = 0.36
"""From the middle of capitals and digits down to the line that they stand on, as a share of their size."""

_SMALLEST_PX = 1.1
"""No dot gets thinner than this, however far away it lies."""


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """A layer of pixels as large as the canvas: uint8 [H, W, 3] RGB, or [H, W, 4] with plain alpha."""

    values: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Strokes:
    """Straight lines of one kind: `segments` [S, 2, 2]. Where they overlap they do not add up."""

    segments: np.ndarray
    colour: Colour
    width: float
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Dots:
    """Ellipses: `centers` [M, 2], `axes` [M, 2] (half lengths), `angles_deg` [M] of the first axis, clockwise
    from x as y points down, `colours` uint8 [M, 3]; each with a rim.
    """

    centers: np.ndarray
    axes: np.ndarray
    angles_deg: np.ndarray
    colours: np.ndarray
    rims: np.ndarray
    rim_width: float


@dataclass(frozen=True, slots=True, eq=False)
class Labels:
    """Words: `texts` [M], the middle of each at `anchors` [M, 2], font sizes `heights` [M] in pixels.

    Light letters with a dark rim, to be read on any ground.
    """

    texts: tuple[str, ...]
    anchors: np.ndarray
    heights: np.ndarray
    colour: Colour = WHITE
    rim: Colour = _INK

    @property
    def rim_widths(self) -> np.ndarray:
        """How far the rim of each word reaches beyond its letters, in pixels: [M]."""
        return np.maximum(1.0, self.heights * _RIM_SHARE)

    def words(self) -> Iterator[tuple[str, tuple[float, float], float, float]]:
        """Each word: its text, the middle (x, y), the font's size and how far the rim reaches, in pixels."""
        heights, rims = self.heights.tolist(), self.rim_widths.tolist()
        yield from zip(self.texts, map(tuple, self.anchors.tolist()), heights, rims, strict=True)


Layer = Pixels | Strokes | Dots | Labels


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A canvas, the colour of its paper (None: transparent), and the layers on it."""

    size: Size
    paper: Colour | None
    layers: tuple[Layer, ...]


def rainbow(steps: np.ndarray) -> np.ndarray:
    """Colours uint8 [M, 3] for whole numbers [M]: the least is red, the greatest violet."""
    low, high = (int(steps.min()), int(steps.max())) if len(steps) else (0, 0)
    by_step = {}
    for step in np.unique(steps).tolist():
        hue = _LAST_HUE * (step - low) / max(1, high - low)
        # Yellow and green look brighter than red and blue of the same value: darken them a little.
        value = 0.96 - 0.14 * math.exp(-(((hue - 0.27) / 0.16) ** 2))
        by_step[step] = [round(255 * part) for part in colorsys.hsv_to_rgb(hue, 0.82, value)]
    return np.array([by_step[step] for step in steps.tolist()], dtype=np.uint8).reshape(-1, 3)


def colours_of(index: np.ndarray, *, loops: int) -> np.ndarray:
    """The colour of each draw [M, 3]: by i under two loops, else by the order of drawing."""
    if loops == 2 and len(index) and np.ptp(index[:, 0]):
        return rainbow(index[:, 0])
    return rainbow(np.arange(len(index)))


def dots(view: View, points: np.ndarray, *, radius: float, colours: np.ndarray, light_rim: bool) -> Dots:
    """Circles of the plane around `points` [M, 2] as the camera sees them, far to near.

    A circle of `radius` (program units) is seen as an ellipse exactly; those that reach behind the camera
    or lie beside the canvas are left out.
    """
    matrix = view.canvas_from_plane
    around = matrix @ _shifts(points)  # [M, 3, 3]: each point becomes the origin
    slope = np.hypot(matrix[2, 0], matrix[2, 1]) * radius
    seen = around[:, 2, 2] - slope > 1e-3 * view.depth_unit
    around, colours = around[seen], colours[seen]
    centers, axes, angles_deg = _ellipses(around, radius)
    rim_width = max(0.75, view.size.longer / 900)
    reach = axes.max(axis=1, initial=0) + rim_width
    size = np.array([view.size.width, view.size.height])
    kept = ((centers > -reach[:, None] - 1) & (centers < size + reach[:, None])).all(axis=1)
    order = np.argsort(-around[kept][:, 2, 2], kind="stable")
    centers, axes, angles_deg, colours = (part[kept][order] for part in (centers, axes, angles_deg, colours))
    rims = np.full_like(colours, 255) if light_rim else np.rint(colours * 0.62).astype(np.uint8)
    return Dots(centers, np.maximum(axes, _SMALLEST_PX), angles_deg, colours, rims, rim_width)


def grid(view: View, segments: np.ndarray, *, over_photo: bool) -> tuple[Strokes, ...]:
    """Cell outlines [S, 2, 2] (program units): thin, and light on dark over a photo, to be seen on any."""
    lines = view.project_segments(segments)
    width = max(1.0, view.size.longer / 1000)
    if not over_photo:
        return (Strokes(lines, _GRID, width),)
    return Strokes(lines, _INK, 2.4 * width, 0.45), Strokes(lines, WHITE, 1.1 * width, 0.9)


def horizon(view: View, *, over_photo: bool) -> tuple[Strokes, ...]:
    """The vanishing line, dashed, where it crosses the canvas."""
    line = view.horizon
    if line is None:
        return ()
    a, b, c = line
    foot = np.array(view.size.middle) - (a * view.size.middle[0] + b * view.size.middle[1] + c) * np.array(
        [a, b]
    )
    reach = view.size.width + view.size.height
    along = np.array([-b, a])
    whole = clip_to_canvas(np.stack([foot - reach * along, foot + reach * along])[None], view.size)
    if not len(whole):
        return ()
    dash = view.size.longer / 60
    length = float(np.linalg.norm(whole[0, 1] - whole[0, 0]))
    starts = np.arange(0, length, dash * 1.7)
    ends = np.minimum(starts + dash, length)
    unit = (whole[0, 1] - whole[0, 0]) / max(length, 1e-9)
    dashes = np.stack([whole[0, 0] + starts[:, None] * unit, whole[0, 0] + ends[:, None] * unit], axis=1)
    width = max(1.5, view.size.longer / 450)
    halo = (Strokes(dashes, WHITE, 2 * width, 0.7),) if over_photo else ()
    return (*halo, Strokes(dashes, _HORIZON, width))


def _shifts(points: np.ndarray) -> np.ndarray:
    shifts = np.tile(np.eye(3), (len(points), 1, 1))
    shifts[:, :2, 2] = points
    return shifts


def _ellipses(around: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Circles around the origin, seen through homographies [M, 3, 3]: centres, half axes, angles (degrees).

    A conic C goes to H^-T C H^-1; its centre c solves A c = -b, its axes are the eigenvectors of A.
    """
    # Relative to the projected origin, or far pictures lose their digits.
    base = around[:, :2, 2] / around[:, 2:, 2]
    back = np.linalg.inv(_shifts(-base) @ around)
    circle = np.diag([1.0, 1.0, -radius * radius])
    conic = back.transpose(0, 2, 1) @ circle @ back
    quadratic, linear = conic[:, :2, :2], conic[:, :2, 2]
    offset = -np.linalg.solve(quadratic, linear[..., None])[..., 0]
    level = conic[:, 2, 2] + (linear * offset).sum(axis=1)
    values, vectors = np.linalg.eigh(quadratic)
    axes = np.sqrt(np.maximum(-level[:, None] / values, 0))
    angles = np.degrees(np.arctan2(vectors[:, 1, 0], vectors[:, 0, 0]))
    return base + offset, axes, angles

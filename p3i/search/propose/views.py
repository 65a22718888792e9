"""Straightened views: the part of the plane that a picture shows, but for what is far away, on a canvas."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.look.evidence import ColourMap
from p3i.search.look.unrolled import orientation
from p3i.size import Size

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

# A view reaches to where things are this many times as far away as the nearest.
_DEPTH_RANGE = 3.5
# Gradients are evened out over this share of the canvas.
_EVENED = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """A square canvas on the plane: `unit` program units a pixel, its `middle` [2] in program units."""

    side: int
    unit: float
    middle: Array

    @property
    def plane_from_view(self) -> Array:
        """The matrix [3, 3] that takes canvas pixels to program units."""
        corner = self.middle - self.unit * (self.side - 1) / 2
        return np.array([[self.unit, 0, corner[0]], [0, self.unit, corner[1]], [0, 0, 1.0]])


def view_canvas(map_from_plane: Array, size: Size, *, side: int) -> Canvas | None:
    """The canvas of `side` pixels for a map of this size seen under a homography; None where no plane shows.

    `map_from_plane` is [3, 3].
    """
    x, y = np.meshgrid(np.linspace(0, size.width - 1, 17), np.linspace(0, size.height - 1, 17))
    plane = np.linalg.inv(map_from_plane) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    if plane[2].max() <= 0:
        return None
    near = plane[2] >= plane[2].max() / _DEPTH_RANGE  # the third row is 1 / depth
    points = plane[:2, near] / plane[2, near]
    low, high = points.min(1), points.max(1)
    return Canvas(side, float((high - low).max()) / (side - 1), (low + high) / 2)


def depth_of_view(map_from_view: Array, side: int) -> Array:
    """How far away each pixel of a view is, [side, side], in the unit of the homography's third row."""
    rows, columns = np.mgrid[0:side, 0:side]
    return map_from_view[2, 0] * columns + map_from_view[2, 1] * rows + map_from_view[2, 2]


def even_weights(known: NDArray, depth: Array) -> NDArray[np.float32]:
    """Weights that are even in the photo, so that a pose that blows up a few pixels does not win.

    Shapes: known [side, side] in 0..1, more than a half somewhere, and depth [side, side].
    """
    nearest = depth[known > 0.5].min()
    return (known * (nearest / np.maximum(depth, nearest)) ** 1.5).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class GradientView:
    """A photo's gradients straightened: `tensor` complex [S, S] (`gradient_tensor`), evened out.

    `known` [S, S] is 1 where they are known, else 0; `depth` [S, S] as of `depth_of_view`.
    """

    tensor: NDArray[np.complex64]
    known: NDArray[np.uint8]
    depth: Array
    canvas: Canvas
    map_from_view: Array


def gradient_view(colours: ColourMap, map_from_plane: Array, *, side: int) -> GradientView | None:
    """The gradients of a map on a canvas of `side` pixels; None where none of the plane shows.

    `map_from_plane` is [3, 3].
    """
    height, width = colours.valid.shape
    canvas = view_canvas(map_from_plane, Size(width, height), side=side)
    if canvas is None:
        return None
    map_from_view = map_from_plane @ canvas.plane_from_view
    depth = depth_of_view(map_from_view, side)
    valid = warped(colours.valid.numpy().astype(np.float32), map_from_view, side)
    known = cv2.erode(((depth > 0) & (valid > 0.99)).astype(np.uint8), np.ones((5, 5)))
    known[:2] = known[-2:] = 0
    known[:, :2] = known[:, -2:] = 0
    if not known.any():
        return None
    smooth = cv2.GaussianBlur(warped(colours.lab, map_from_view, side), (0, 0), 0.8)
    tensor = gradient_tensor(np.asarray(smooth, np.float32)) * known
    energy = cv2.GaussianBlur(np.abs(tensor) ** 2, (0, 0), _EVENED * side)
    tensor = tensor / np.sqrt(energy + energy.mean() + 1e-9)
    return GradientView(tensor, np.asarray(known, np.uint8), depth, canvas, map_from_view)


def warped(planes: Floats, map_from_view: Array, side: int) -> Floats:
    """The planes [H, W] or [H, W, C] of a map on the canvas of a view, 0 beyond: [side, side(, C)]."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpPerspective(planes, map_from_view, (side, side), flags=flags), np.float32)


def gradient_tensor(lab: Floats) -> NDArray[np.complex64]:
    """The gradient of a picture [H, W, 3] as complex numbers: sqrt(|grad|) times e^(2i direction)."""
    gx = 0.5 * (np.roll(lab, -1, 1) - np.roll(lab, 1, 1))
    gy = 0.5 * (np.roll(lab, -1, 0) - np.roll(lab, 1, 0))
    _, cosine, sine = orientation(gx, gy)
    return (cosine + 1j * sine).astype(np.complex64)

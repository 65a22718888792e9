"""The canvas of a straightened view: the part of the plane that a picture shows, but for what is far away."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.size import Size

Array = NDArray[np.float64]


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


def view_canvas(map_from_plane: Array, size: Size, *, side: int, depth_range: float) -> Canvas | None:
    """The canvas of `side` pixels for a map of this size seen under a homography; None where no plane shows.

    `map_from_plane` is [3, 3]. The view reaches to where things are `depth_range` times as far away as the
    nearest.
    """
    x, y = np.meshgrid(np.linspace(0, size.width - 1, 17), np.linspace(0, size.height - 1, 17))
    plane = np.linalg.inv(map_from_plane) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    if plane[2].max() <= 0:
        return None
    near = plane[2] >= plane[2].max() / depth_range  # the third row is 1 / depth
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

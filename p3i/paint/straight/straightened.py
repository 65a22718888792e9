"""A straightened view before it is painted: which way up, how large, and how its pixels lie in the photo.

Convention: arrays of float64; matrices are named target_from_source; pixel centres at whole numbers.
*Upright* units are the plane's after the turn (and, where a cell's true size is known, the affine map that
makes it metric): program units, or millimetres. `pinhole` pixels are the photo's after its lens is
straightened; they are the photo's own where the program's header names no lens_k1.
"""

from dataclasses import dataclass

import numpy as np
import torch

from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.sheet import project


@dataclass(frozen=True, slots=True, eq=False)
class Straightened:
    """A canvas that shows the plane straight on: `view_from_plane` [3, 3] is affine.

    `mm_per_px` is known where a cell's true size was given. `scale` is what the option means.
    """

    placed: Placed
    k1: float | None
    size: Size
    view_from_plane: np.ndarray
    scale: float
    mm_per_px: float | None = None

    @property
    def pinhole_from_view(self) -> np.ndarray:
        """View pixels to pixels of the photo (lens straightened); the third coordinate is the depth."""
        return self.placed.image_from_plane @ np.linalg.inv(self.view_from_plane)

    @property
    def view_from_pinhole(self) -> np.ndarray:
        """The inverse; its third coordinate is positive where the plane is seen."""
        return np.linalg.inv(self.pinhole_from_view)

    @property
    def dpi(self) -> float | None:
        """View pixels an inch of the plane."""
        return None if self.mm_per_px is None else 25.4 / self.mm_per_px

    def in_photo(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where view pixels x [w], y [h] lie in the photo as it is: x [h, w], y [h, w], and which it has."""
        columns, rows = np.asarray(x, float)[None, :], np.asarray(y, float)[:, None]
        h = self.pinhole_from_view
        depth = h[2, 0] * columns + (h[2, 1] * rows + h[2, 2])
        # The depth is that of the plane's origin where the view's middle is; far less is at the camera.
        front = depth > 1e-6 * abs(self.placed.image_from_plane[2, 2])
        over = 1 / np.where(front, depth, 1.0)
        at_x = (h[0, 0] * columns + (h[0, 1] * rows + h[0, 2])) * over
        at_y = (h[1, 0] * columns + (h[1, 1] * rows + h[1, 2])) * over
        if self.k1:
            at_x, at_y, shown = bent(at_x, at_y, self.k1, self.placed.size)
            front = front & shown
        size = self.placed.size
        inside = (at_x >= -0.5) & (at_x <= size.width - 0.5) & (at_y >= -0.5) & (at_y <= size.height - 0.5)
        return at_x, at_y, front & inside

    def in_view(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where photo pixels x [w], y [h] lie in the view: x [h, w], y [h, w], and which are on the view."""
        columns, rows = np.meshgrid(np.asarray(x, float), np.asarray(y, float))
        points = np.stack([columns, rows], axis=-1)
        if self.k1:
            points = straight_from_photo(torch.from_numpy(points), self.k1, size=self.placed.size).numpy()
        at, front = project(self.view_from_pinhole / abs(self.view_from_pinhole).max(), points)
        inside = (at >= -0.5).all(-1) & (at <= np.array([self.size.width, self.size.height]) - 0.5).all(-1)
        return at[..., 0], at[..., 1], front & inside


def bent(x: np.ndarray, y: np.ndarray, k1: float, size: Size) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pinhole points x, y [h, w] as the lens shows them, and which it shows."""
    points = torch.from_numpy(np.clip(np.stack([x, y], axis=-1), -1e7, 1e7))
    photo, shown = photo_from_straight(points, k1, size=size)
    return photo[..., 0].numpy(), photo[..., 1].numpy(), shown.numpy()

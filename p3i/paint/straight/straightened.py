"""A straightened view before it is painted: which way up, how large, and how its pixels lie in the photo.

Convention: arrays of float64; matrices are named target_from_source; pixel centres at whole numbers.
*Upright* units are the plane's after the turn (and, where a cell's true size is known, the affine map that
makes it metric): program units, or millimetres. `pinhole` pixels are the photo's after its lens is
straightened; they are the photo's own where the program's header names no lens_k1.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch

from p3i.errors import UsageError
from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.options.rectify import CellSize
from p3i.paint.straight.supercell import reduced, row_of
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.sheet import project

_SKEW_SNAP = 0.12
"""A row's shift against the next, in cells, that counts as none or as half a cell."""

_RIGHT_DEG = 4.0
"""Directions that are this near to a right angle count as at one: an assumed focal skews by as much."""

_LEAST_ANGLE_DEG = 50.0
"""Where u and v are closer than this, the lattice's two shortest vectors stand for them."""


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


def upright_from_plane(placed: Placed, *, upright: bool, cell: CellSize | None) -> np.ndarray:
    """The linear map [2, 2] from program units to upright units (millimetres where `cell` is known).

    A turn; with `cell`, the affine map that gives the cell its size, with as little turn as `upright` allows.
    Never a reflection. Raises UsageError for a cell where the program is no lattice.
    """
    basis = placed.basis
    if basis is None:
        if cell is not None:
            raise UsageError("--cell needs a lattice; the cells of this program are not all of one size")
        return np.eye(2)
    if cell is None:
        return _turn(-_off_axis_rad(basis)) if upright else np.eye(2)
    linear = _metric(basis, cell)
    # linear = turn @ stretch; the stretch alone leaves the view as it was seen, but for its proportions.
    _, stretches, right = np.linalg.svd(linear)
    stretch = right.T @ np.diag(stretches) @ right
    if not upright:
        return stretch
    return _turn(-_off_axis_rad(basis @ stretch.T)) @ stretch


def _metric(basis: np.ndarray, cell: CellSize) -> np.ndarray:
    """A map of the plane without reflection that gives the cell of `basis` (rows u, v) its true size."""
    # The width is that of the row, or of the step that runs more across.
    row = row_of(basis)
    first, second = basis[::-1] if (abs(basis[0, 0]) < abs(basis[1, 0]) if row is None else row) else basis
    side = math.copysign(1.0, first[0] * second[1] - first[1] * second[0])
    shift = float(first @ second / (first @ first))
    # A brick wall's rows are shifted by half a brick; what is a little off owes it to the focal.
    nearest = round(2 * shift) / 2
    shift = nearest if abs(shift - nearest) <= _SKEW_SNAP else shift
    along, across = cell.width_mm, cell.height_mm
    if row is not None and abs(first[1]) > abs(first[0]):  # rows that stand are columns
        along, across = across, along
    target = np.array([[along, 0.0], [shift * along, side * across]])
    return np.linalg.solve(np.array([first, second]), target).T


def _off_axis_rad(basis: np.ndarray) -> float:
    """The least angle that a view must turn back for the lattice to stand straight in it.

    That is: u across (or v, where u is more than 45 degrees off), or a pair of directions at right angles
    along both axes; u + v and u - v are one where u and v are as long as each other, as on a chessboard, and
    u and 2v - u where the next row is shifted by half, as of bricks.
    """
    u, v = basis if _angle_between_deg(*basis) >= _LEAST_ANGLE_DEG else reduced(basis) @ basis
    across = [math.remainder(_angle_rad(vector), math.pi) for vector in (u, v)]
    turns = [min(across, key=abs) if abs(across[0]) > math.pi / 4 else across[0]]
    turns += [
        math.remainder(_angle_rad(first), math.pi / 2)
        for first, second in ((u, v), (u + v, u - v), (u, 2 * v - u), (v, 2 * u - v))
        if _square(first, second)
    ]
    # Equal choices should not hang on rounding: the first of those that are nearly the least.
    least = min(abs(turn) for turn in turns)
    return next(turn for turn in turns if abs(turn) <= least + math.radians(0.01))


def _angle_between_deg(first: np.ndarray, second: np.ndarray) -> float:
    """The angle between two lines, up to 90."""
    return math.degrees(
        math.atan2(abs(first[0] * second[1] - first[1] * second[0]), abs(float(first @ second)))
    )


def _angle_rad(vector: np.ndarray) -> float:
    return math.atan2(vector[1], vector[0])


def _square(first: np.ndarray, second: np.ndarray) -> bool:
    return _angle_between_deg(first, second) >= 90 - _RIGHT_DEG


def _turn(angle_rad: float) -> np.ndarray:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[cos, -sin], [sin, cos]])

"""A lattice's plane set upright, and given its true size: where its rows run across, and lengths are lengths.

Convention: arrays of float64; a lattice's basis is [2, 2], rows u and v. *Upright* units are the plane's
after the turn (and, where a cell's true size is known, the affine map that makes it metric): program units,
or millimetres.
"""

import math

import numpy as np

from p3i.errors import UsageError
from p3i.options.cell import CellSize
from p3i.place.placed import Placed

_HALF = 0.1
"""Rows that are shifted by half to within this share of a half."""

_SKEW_SNAP = 0.12
"""A row's shift against the next, in cells, that counts as none or as half a cell."""

_RIGHT_DEG = 4.0
"""Directions that are this near to a right angle count as at one: an assumed focal skews by as much."""

_LEAST_ANGLE_DEG = 50.0
"""Where u and v are closer than this, the lattice's two shortest vectors stand for them."""


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


def row_of(basis: np.ndarray) -> int | None:
    """Which step of a basis [2, 2] is a row that the next is shifted against by half, as bricks are; or None.

    Every step to the middle of the next row is one too, seen slantwise: the row is the straighter of the two.
    """
    leans = [abs(math.remainder(_angle_deg(step), 90.0)) for step in basis]
    halves = np.abs(2 * np.abs(basis[0] @ basis[1]) / np.square(basis).sum(axis=1) - 1) < _HALF
    k = int(leans[1] < leans[0])
    return k if halves[k] and leans[k] < leans[1 - k] - 1 else None


def reduced(basis: np.ndarray) -> np.ndarray:
    """Steps [2, 2] of the two shortest vectors that span the lattice (Lagrange and Gauss)."""
    steps = np.eye(2, dtype=int)
    for _ in range(64):
        u, v = steps @ basis
        if u @ u > v @ v:
            steps, (u, v) = steps[::-1].copy(), (v, u)
        shift = round(float(u @ v / (u @ u)))
        if shift == 0:
            break
        steps[1] -= shift * steps[0]
    return steps


def _angle_deg(vector: np.ndarray) -> float:
    return math.degrees(math.atan2(vector[1], vector[0]))

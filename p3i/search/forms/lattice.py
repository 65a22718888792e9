"""Lattices as programs: the sketch, its numbers as a basis, and which of its cells a picture shows."""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Level

PHASE = frozenset({"draw.x.1", "draw.y.1"})
"""The numbers that shift all cells alike."""

# A picture with fewer whole cells is looked at to its very edges: at cells of which half shows.
_FEW_WHOLE = 16
# Steps to each side of a cell within which its surroundings are looked for.
_FARTHEST = 60

_CORNERS = torch.tensor([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]], dtype=torch.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """A camera and a lattice on its plane.

    `basis` [2, 2] has the steps u (of i) and v (of j) as rows, `origin` [2] is the point of (0, 0); both in
    program units.
    """

    rx_deg: float
    ry_deg: float
    basis: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, pattern: Pattern, theta: Tensor) -> "Lattice":
        """The lattice that the numbers theta [P] of the lattice sketch mean."""
        value = dict(zip(pattern.paths, theta.tolist(), strict=True))
        basis = np.array([[value["draw.x.i"], value["draw.y.i"]], [value["draw.x.j"], value["draw.y.j"]]])
        origin = np.array([value["draw.x.1"], value["draw.y.1"]])
        return cls(value["camera.rx"], value["camera.ry"], basis, origin)

    def theta(self, pattern: Pattern) -> Tensor:
        """This lattice as numbers [P] of the lattice sketch."""
        value = {
            "camera.rx": self.rx_deg,
            "camera.ry": self.ry_deg,
            "draw.x.i": self.basis[0, 0],
            "draw.y.i": self.basis[0, 1],
            "draw.x.j": self.basis[1, 0],
            "draw.y.j": self.basis[1, 1],
            "draw.x.1": self.origin[0],
            "draw.y.1": self.origin[1],
        }
        return torch.tensor([float(value[path]) for path in pattern.paths], dtype=torch.float64)

    @property
    def plane_from_index(self) -> np.ndarray:
        """The affine map from loop indices (i, j) to program units, [3, 3]."""
        matrix = np.eye(3)
        matrix[:2, :2], matrix[:2, 2] = self.basis.T, self.origin
        return matrix

    @property
    def cell_area(self) -> float:
        """The area of the fundamental cell, in square program units."""
        return abs(float(np.linalg.det(self.basis)))

    def moved_to(self, index: np.ndarray) -> "Lattice":
        """The same lattice with its origin at (i, j) = `index` [2], which may be fractional."""
        return Lattice(self.rx_deg, self.ry_deg, self.basis, self.origin + index @ self.basis)

    def with_basis(self, basis: np.ndarray) -> "Lattice":
        """The same camera and origin with other steps [2, 2]."""
        return Lattice(self.rx_deg, self.ry_deg, basis, self.origin)

    def reduced(self) -> "Lattice":
        """The same points written with the one basis that `reduce_basis` picks."""
        return self.with_basis(reduce_basis(self.basis))


def reduce_basis(basis: np.ndarray) -> np.ndarray:
    """The shortest basis [2, 2] of the same lattice (Lagrange-Gauss), in one fixed order and orientation.

    u is the more horizontal one and points right, v turns from u towards y (down): equal lattices get equal
    text.
    """
    u, v = basis[0].astype(float), basis[1].astype(float)
    for _ in range(100):
        if u @ u > v @ v:
            u, v = v, u
        times = round(float(u @ v) / max(float(u @ u), 1e-30))
        if times == 0:
            break
        v = v - times * u
    if abs(u[0]) * np.linalg.norm(v) < abs(v[0]) * np.linalg.norm(u):
        u, v = v, u
    if u[0] < 0:
        u = -u
    if u[0] * v[1] - u[1] * v[0] < 0:
        v = -v
    return np.stack([u, v])


def in_shortest_steps(pattern: Pattern) -> Pattern:
    """The same points under the shortest basis, their indices counted from 0: what lattices are judged in.

    `pattern` is of rows of rows, in which steps ever they were written; its own `program` keeps these. One
    that is in these steps already stays as it is.
    """
    lattice = Lattice.of(pattern, pattern.theta)
    basis = reduce_basis(lattice.basis)
    change = np.round(lattice.basis @ np.linalg.inv(basis))
    if np.isclose(np.square(basis).sum(), np.square(lattice.basis).sum(), rtol=1e-9):
        return pattern
    index = pattern.index.double() @ torch.from_numpy(change)
    first = index.amin(0)
    moved = Lattice(lattice.rx_deg, lattice.ry_deg, basis, lattice.origin + first.numpy() @ basis)
    return replace(pattern, theta=moved.theta(pattern), index=(index - first).long())


def cells_in_view(
    level: Level,
    pattern: Pattern,
    theta: Tensor,
    *,
    least_px: float = 4.0,
    most: int = 600,
    around: Tensor | None = None,
    cut: bool | None = None,
) -> Tensor:
    """The indices of the cells that lie wholly in the picture: float64 [N, 2].

    Cells smaller than `least_px` map pixels a side are left out; of more than `most` the largest stay, or,
    where a cell `around` [2] is given, those that are the fewest steps from it. `cut`: cells that the frame
    cuts are taken too where half of them shows; None takes them where few lie wholly in the picture, since a
    pattern of large cells has no others.
    """
    matrix = map_from_index(level, pattern, theta)
    index_from_map = np.linalg.inv(matrix)
    size = level.size
    x, y = np.meshgrid(np.linspace(0, size.width - 1, 33), np.linspace(0, size.height - 1, 33))
    seen = index_from_map @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    # 1/depth is the third row; a cell covers depth^-3 / |det| of the map.
    near = seen[2] > 0
    area = np.where(near, seen[2], 0) ** 3 / max(abs(np.linalg.det(index_from_map)), 1e-300)
    near &= area > least_px**2
    empty = torch.zeros((0, 2), dtype=torch.float64)
    if not near.any():
        return empty
    reached = seen[:2, near] / seen[2, near]
    low, high = np.floor(reached.min(1)), np.ceil(reached.max(1))
    if around is not None:  # what lies farther off than all that are wanted need not be looked at
        low = np.maximum(low, np.floor(around.numpy()) - _FARTHEST)
        high = np.maximum(np.minimum(high, np.ceil(around.numpy()) + _FARTHEST), low)
    if not np.isfinite(low).all() or (high - low).max() > 400 or (high - low).prod() > 40_000:
        return empty
    index = torch.cartesian_prod(
        torch.arange(low[0], high[0] + 1, dtype=torch.float64),
        torch.arange(low[1], high[1] + 1, dtype=torch.float64),
    )
    area, inside = cell_areas(matrix, index, level)
    if cut is None:
        cut = int((inside & (area > least_px**2)).sum()) < _FEW_WHOLE
    if cut:
        inside = _shown(matrix, index, level) >= 1 / 2
    inside &= area > least_px**2
    index, area = index[inside], area[inside]
    if len(index) > most:
        rank = -area if around is None else (index - around).square().sum(1)
        index = index[torch.sort(rank, stable=True).indices[:most].sort().values]
    return index


def cell_areas(matrix: np.ndarray, index: Tensor, level: Level) -> tuple[Tensor, Tensor]:
    """The areas [N] in square map pixels of the cells at `index` under `matrix` (index -> map), and which
    of the cells lie wholly in the picture [N]."""
    points, in_front = cell_corners(matrix, index)
    limits = np.array([level.size.width - 1, level.size.height - 1])
    inside = (in_front & (points >= -0.5).all(2) & (points <= limits + 0.5).all(2)).all(1)
    a, b = points[:, 2] - points[:, 0], points[:, 3] - points[:, 1]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return torch.from_numpy(area), torch.from_numpy(inside)


def _shown(matrix: np.ndarray, index: Tensor, level: Level) -> Tensor:
    """The share of each cell [N] that lies in the picture, under `matrix` (index -> map)."""
    steps = (np.arange(4) + 0.5) / 4 - 0.5
    within = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    at = (index.numpy()[:, None] + within[None]).reshape(-1, 2)
    moved = np.column_stack([at, np.ones(len(at))]) @ matrix.T
    in_front = moved[:, 2] > 1e-9
    points = moved[:, :2] / np.where(in_front, moved[:, 2], 1)[:, None]
    limits = np.array([level.size.width - 1, level.size.height - 1])
    inside = in_front & (points >= -0.5).all(1) & (points <= limits + 0.5).all(1)
    return torch.from_numpy(inside.reshape(len(index), -1).mean(1))


def cell_corners(matrix: np.ndarray, index: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """The corners [N, 4, 2] of the cells at `index` [N, 2] under `matrix` (index -> pixels), in turn around
    the cell, and which of them lie in front of the camera [N, 4]."""
    corners = (index[:, None, :] + _CORNERS[None]).numpy()
    moved = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2) @ matrix.T
    in_front = moved[..., 2] > 1e-9
    return moved[..., :2] / np.where(in_front, moved[..., 2], 1)[..., None], in_front


def map_from_index(level: Level, pattern: Pattern, theta: Tensor) -> np.ndarray:
    """The homography from loop indices (i, j) to map pixels, [3, 3]."""
    return level.map_from_plane(pattern, theta).numpy() @ Lattice.of(pattern, theta).plane_from_index


def cell_px(level: Level, pattern: Pattern, theta: Tensor) -> float:
    """The side of the cell at the origin under theta [P], in photo pixels: the square root of its area."""
    area, _ = cell_areas(
        map_from_index(level, pattern, theta), torch.zeros((1, 2), dtype=torch.float64), level
    )
    return math.sqrt(max(float(area[0]), 1e-6)) / float(level.map_from_photo[0, 0])

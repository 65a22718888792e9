"""From a fit to a program: which point of the cell is the object, which cells hold one, and the text."""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.grammar.ast import Affine, CameraPose, Draw, For, If, Program
from p3i.interp.camera import image_from_plane
from p3i.interp.pattern import Pattern
from p3i.search.cells import contrast, sample_grid, sample_points
from p3i.search.evidence import Evidence, Level
from p3i.search.extent import find_extent
from p3i.search.grow import SUPPORT, Fit, sane, side_of_cell
from p3i.search.lattice import Lattice, cell_areas, cells_in_view, map_from_index
from p3i.search.phase import find_phase
from p3i.search.register import find_instances, fit_instances
from p3i.search.score import score_of

# Numbers in a program: angles to a thousandth of a degree, lengths to a ten-thousandth of a unit, which is
# a hundredth of a pixel at the far end of a long row in a large photo.
_ANGLE_DIGITS = 3
_LENGTH_DIGITS = 4
_SAMPLES = 6
# The last fit: on a map sharper by this, on at most so many objects and at least so few, so many times.
_SHARPER = 0.6
_MOST_REFITTED = 300
_FEWEST_REFITTED = 6
_REFITS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """A lattice with its objects: half-open index ranges and guards (a, b, c) for a*i + b*j >= c."""

    lattice: Lattice
    i_range: tuple[int, int]
    j_range: tuple[int, int]
    guards: tuple[tuple[int, int, int], ...] = ()

    def holds(self, index: np.ndarray) -> np.ndarray:
        """Which rows of `index` [N, 2] the layout draws."""
        i, j = index[:, 0], index[:, 1]
        inside = (
            (i >= self.i_range[0]) & (i < self.i_range[1]) & (j >= self.j_range[0]) & (j < self.j_range[1])
        )
        for a, b, c in self.guards:
            inside &= a * i + b * j >= c
        return inside

    def program(self, *, from_zero: bool = True) -> Program:
        """The program, with both loops starting at 0, or else at the first index of each range.

        Where the origin is 0, the latter needs no constants in `Draw` and guards, of which Table 1 has none.
        """
        (i0, i1), (j0, j1) = self.i_range, self.j_range
        i_start, j_start = (0, 0) if from_zero else (i0, j0)
        i_skip, j_skip = i0 - i_start, j0 - j_start
        u, v = self.lattice.basis
        origin = self.lattice.origin + i_skip * u + j_skip * v

        def length(value: float) -> float:
            return round(float(value), _LENGTH_DIGITS)

        body: Draw | If = Draw(
            Affine(length(u[0]), length(v[0]), length(origin[0])),
            Affine(length(u[1]), length(v[1]), length(origin[1])),
        )
        for a, b, c in reversed(self.guards):
            body = If(Affine(a, b, a * i_skip + b * j_skip - c), body)
        inner = For("j", Affine(constant=j_start), Affine(constant=j1 - j_skip), body)
        pose = CameraPose(
            round(self.lattice.rx_deg, _ANGLE_DIGITS), round(self.lattice.ry_deg, _ANGLE_DIGITS)
        )
        return Program(pose, For("i", Affine(constant=i_start), Affine(constant=i1 - i_skip), inner))


def found_layout(evidence: Evidence, lattice: Lattice, ground: Tensor) -> Layout | None:
    """The objects of a lattice whose cells `ground` [N, 2] are sure: phase and extent from the photo.

    None where no object is seen.
    """
    image = evidence.image
    matrix = image_from_plane(
        lattice.rx_deg, lattice.ry_deg, size=image.size, focal_mm=evidence.focal_mm
    ).numpy()
    support = _painted(evidence, ground, matrix, lattice)
    phase = find_phase(image.pixels, image.valid, matrix, lattice.basis, support)
    if phase is None:
        return None
    lattice = Lattice(lattice.rx_deg, lattice.ry_deg, lattice.basis, phase.origin)
    found = find_extent(image.pixels, image.valid, matrix, lattice.basis, lattice.origin, support)
    if found is None or min(np.diff(found.i_range)[0], np.diff(found.j_range)[0]) < 2:
        return None  # one row fixes no plane
    return Layout(lattice, found.i_range, found.j_range, found.guards)


def filling_layout(evidence: Evidence, pattern: Pattern, layout: Layout) -> Layout:
    """The layout continued over the whole picture, as the paper assumes (section 3.4).

    All objects whose middle lies in the picture are drawn, also those whose cell the frame cuts.
    """
    theta = layout.lattice.theta(pattern)
    level = evidence.level_for(side_of_cell(evidence, pattern, theta))
    cells = cells_in_view(level, pattern, theta, most=4000)
    if len(cells) == 0:
        return layout
    first, last = cells.min(0).values - 1, cells.max(0).values + 1
    around = torch.cartesian_prod(
        *(torch.arange(int(a), int(b) + 1).double() for a, b in zip(first, last, strict=True))
    )
    points, in_front = sample_points(level, pattern, theta, around)
    limits = torch.tensor([level.size.width - 0.5, level.size.height - 0.5])
    seen = in_front & (points >= -0.5).all(1) & (points <= limits).all(1)
    index = torch.cat([cells, around[seen]]).numpy().astype(int)
    low, high = index.min(0), index.max(0) + 1
    return Layout(layout.lattice, (int(low[0]), int(high[0])), (int(low[1]), int(high[1])))


def strict_layout(layout: Layout) -> tuple[Layout, float]:
    """The nearest layout inside Table 1, and how far its points moved, in program units.

    Table 1 has no constants: a point of the lattice falls on the origin, and guards keep c = 0 only.
    """
    basis, origin = layout.lattice.basis, layout.lattice.origin
    shift = np.round(origin @ np.linalg.inv(basis)).astype(int)
    moved = origin - shift @ basis
    i_range = (layout.i_range[0] + int(shift[0]), layout.i_range[1] + int(shift[0]))
    j_range = (layout.j_range[0] + int(shift[1]), layout.j_range[1] + int(shift[1]))
    guards = tuple((a, b, c + a * int(shift[0]) + b * int(shift[1])) for a, b, c in layout.guards)
    lattice = Lattice(layout.lattice.rx_deg, layout.lattice.ry_deg, basis, np.zeros(2))
    kept = tuple(guard for guard in guards if guard[2] == 0)
    return Layout(lattice, i_range, j_range, kept), float(np.hypot(*moved))


def layout_fit(evidence: Evidence, pattern: Pattern, layout: Layout) -> Fit | None:
    """How well the cells that a layout draws predict each other; None for fewer than four in view.

    In the search's features, or in these with the colours, whichever shows more: a chequered floor's cell is
    told from half of it by colour only, and the stones on a board differ in colour only.
    """
    theta = layout.lattice.theta(pattern)
    side = side_of_middle(evidence, pattern, layout)
    features = evidence.config.features
    names = [features] if "rgb" in features.split("+") else [features, features + "+rgb"]
    fits = [_measured(evidence.level_for(side, name=name), pattern, layout, theta) for name in names]
    return max((fit for fit in fits if fit is not None), key=lambda fit: score_of(fit.contrast), default=None)


def _measured(level: Level, pattern: Pattern, layout: Layout, theta: Tensor) -> Fit | None:
    index = cells_in_view(level, pattern, theta, most=4000)
    index = index[torch.from_numpy(layout.holds(index.numpy()))]
    if len(index) < 4:
        return None
    index = index[:: len(index) // 600 + 1]
    found = contrast(
        level, pattern, theta, index, weights=torch.ones(len(index)), grid=sample_grid(_SAMPLES), rounds=4
    )
    area, _ = cell_areas(map_from_index(level, pattern, theta), index, level)
    share = (area / (level.size.width * level.size.height)).float()
    score = float((share * (found.contrast - SUPPORT).clamp(min=0)).sum())
    return Fit(theta, index, found.contrast, share, score)


def refitted(evidence: Evidence, pattern: Pattern, layout: Layout) -> Layout:
    """The layout with camera and lattice fitted once more, to its own objects only and on the fine map.

    What the fit grew on had cells cut anywhere and some beyond the pattern; now each cell holds an object.
    """
    theta = layout.lattice.theta(pattern)
    side = side_of_middle(evidence, pattern, layout)
    level = evidence.level_for(_SHARPER * side, finest=True)
    index = cells_in_view(level, pattern, theta, most=4000)
    index = index[torch.from_numpy(layout.holds(index.numpy()))]
    if len(index) < _FEWEST_REFITTED:
        return layout
    index = index[:: len(index) // _MOST_REFITTED + 1]
    weights = torch.ones(len(index))
    for _ in range(_REFITS):
        found = find_instances(level, pattern, theta, index, weights)
        weights = found.certainty
        if int((weights > 0).sum()) < _FEWEST_REFITTED:
            return layout
        theta = fit_instances(level, pattern, theta, found, weights=weights.double())
    if not sane(pattern, theta):
        return layout
    return Layout(Lattice.of(pattern, theta), layout.i_range, layout.j_range, layout.guards)


def side_of_middle(evidence: Evidence, pattern: Pattern, layout: Layout) -> float:
    """The side, in photo pixels, of the cell in the middle of a layout."""
    middle = np.array([sum(layout.i_range) - 1, sum(layout.j_range) - 1]) / 2
    return side_of_cell(evidence, pattern, layout.lattice.moved_to(middle).theta(pattern))


def _painted(evidence: Evidence, cells: Tensor, matrix: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Where the cells [N, 2] lie in the photo: bool [H, W]."""
    size = evidence.image.size
    canvas = np.zeros((size.height, size.width), np.uint8)
    corners = torch.tensor([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]], dtype=torch.float64)
    index = cells[:, None, :] + corners[None]
    plane = index.numpy() @ lattice.basis + lattice.origin
    moved = np.concatenate([plane, np.ones((*plane.shape[:2], 1))], 2) @ matrix.T
    points = moved[..., :2] / moved[..., 2:]
    for polygon in np.round(points).astype(np.int32):
        cv2.fillConvexPoly(canvas, polygon, 1)
    return canvas.astype(bool)

"""From a fit to a program: which point of the cell is the object, which cells hold one, and the text."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.grammar.ast import Affine, CameraPose, Draw, For, If, Program
from p3i.interp.camera import image_from_plane
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.search.extent.phase import find_phase
from p3i.search.extent.presence import find_extent
from p3i.search.fit.grow import Fit, sane, side_of_cell, weighed
from p3i.search.fit.judged import judged_cells
from p3i.search.fit.settle import objects_of, settled
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.lattice import Lattice, cell_corners, cells_in_view
from p3i.search.look.cells import sample_points
from p3i.search.look.contrast import score_of
from p3i.search.look.evidence import Evidence
from p3i.vision.warp import in_frame

# Fewer objects are not fitted once more.
_FEWEST_REFITTED = 6


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
            return round(float(value), LENGTH_DIGITS)

        body: Draw | If = Draw(
            Affine(length(u[0]), length(v[0]), length(origin[0])),
            Affine(length(u[1]), length(v[1]), length(origin[1])),
        )
        for a, b, c in reversed(self.guards):
            body = If(Affine(a, b, a * i_skip + b * j_skip - c), body)
        inner = For("j", Affine(constant=j_start), Affine(constant=j1 - j_skip), body)
        pose = CameraPose(round(self.lattice.rx_deg, ANGLE_DIGITS), round(self.lattice.ry_deg, ANGLE_DIGITS))
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
    origin = find_phase(image.pixels, image.valid, matrix, lattice.basis, support)
    if origin is None:
        return None
    lattice = Lattice(lattice.rx_deg, lattice.ry_deg, lattice.basis, origin)
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
    seen = in_front & in_frame(points, level.size)
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


def layout_fit(evidence: Evidence, layout: Layout) -> Fit | None:
    """How well the cells that a layout draws predict each other; None for fewer than four in view.

    In the search's features, or in these with the colours, whichever shows more: a chequered floor's cell is
    told from half of it by colour only, and the stones on a board differ in colour only.
    """
    drawn = compile(layout.program())
    found = [one for one in judged_cells(evidence, drawn) if one.whole]
    if not found:
        return None
    best = max(found, key=lambda one: score_of(one.contrast))
    return weighed(best.level, drawn, drawn.theta, best.index, best.contrast)


def refitted(evidence: Evidence, pattern: Pattern, layout: Layout) -> Layout:
    """The layout with camera and lattice fitted once more, to where its own objects lie.

    What the fit grew on had cells cut anywhere and some beyond the pattern; now each place is an object's.
    Objects at the frame count too: they lie farthest apart, and that fixes the pose.
    """
    objects = objects_of(evidence, layout.program(from_zero=False))
    if objects is None or len(objects.index) < _FEWEST_REFITTED:
        return layout
    program = settled(objects).program()
    drawn = compile(program)
    theta = Lattice.of(drawn, drawn.theta).theta(pattern)
    return replace(layout, lattice=Lattice.of(pattern, theta)) if sane(pattern, theta) else layout


def _painted(evidence: Evidence, cells: Tensor, matrix: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Where the cells [N, 2] lie in the photo: bool [H, W]."""
    size = evidence.image.size
    canvas = np.zeros((size.height, size.width), np.uint8)
    points, _ = cell_corners(matrix @ lattice.plane_from_index, cells)
    for polygon in np.round(points).astype(np.int32):
        cv2.fillConvexPoly(canvas, polygon, 1)
    return canvas.astype(bool)

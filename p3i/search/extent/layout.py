"""From a fit to a program: which point of the cell is the object, which cells hold one, and the text."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.grammar.ast import Affine, CameraPose, Draw, For, If, Program
from p3i.interp.camera import image_from_plane
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.search.extent.outline import Outline
from p3i.search.extent.phase import Phase, find_phases
from p3i.search.extent.presence import FEWEST_MISSES, find_extent
from p3i.search.fit.grow import Fit, sane, side_of_cell, weighed
from p3i.search.fit.judged import judged_cells
from p3i.search.fit.robust import fit_instances
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.lattice import Lattice, cell_corners, cells_in_view
from p3i.search.look.cells import sample_points
from p3i.search.look.contrast import score_of
from p3i.search.look.correlate import find_instances
from p3i.search.look.evidence import Evidence, Level
from p3i.search.look.thinned import thinned
from p3i.search.result import Reading
from p3i.vision.warp import in_frame

# The last fit: on a map sharper by this, with so many samples along a cell's side, on at most so many objects
# and at least so few, so many times.
_SHARPER = 0.4
_SIDE = 16
_MOST_REFITTED = 300
_FEWEST_REFITTED = 6
_REFITS = 3
# A place of the cell of at least this share of the likeliest's probability is a rival. Where both have an
# object in each cell but for the fewest that any pattern lacks, every further object doubles the odds.
_RIVAL = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """A lattice with its objects: half-open index ranges and guards (a, b, c) for a*i + b*j >= c.

    `readings` are the places of the cell that may be its object, the likeliest first.
    """

    lattice: Lattice
    i_range: tuple[int, int]
    j_range: tuple[int, int]
    guards: tuple[tuple[int, int, int], ...] = ()
    readings: tuple[Reading, ...] = ()

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

    They lie at the likeliest place of the cell, or at the one that the options ask for where the cell has it.
    None where no object is seen.
    """
    image = evidence.image
    matrix, support = _seen(evidence, lattice, ground)
    phases = find_phases(image.pixels, image.valid, matrix, lattice.basis, support)

    def outline(phase: Phase) -> Outline | None:
        return find_extent(image.pixels, image.valid, matrix, lattice.basis, phase.origin, support)

    if not phases:
        return None
    phases, outlines = _weighed(phases, outline)
    asked = evidence.config.object
    names = [phase.name or str(rank) for rank, phase in enumerate(phases, 1)]
    at = next((k for k, name in enumerate(names) if asked in (name, str(k + 1))), 0)
    drawn = phases[at]
    from_drawn = [(phase.origin - drawn.origin) @ np.linalg.inv(lattice.basis) for phase in phases]
    readings = tuple(
        Reading(name, phase.probability, (float(step[0]), float(step[1])))
        for name, phase, step in zip(names, phases, from_drawn, strict=True)
    )
    found = outlines[at] or outline(drawn)
    return _layout(replace(lattice, origin=drawn.origin), found, readings)


def _weighed(
    phases: Sequence[Phase], outline: Callable[[Phase], Outline | None]
) -> tuple[list[Phase], list[Outline | None]]:
    """Phases with the probability that their objects give them, the likeliest first, with what was outlined.

    `outline` says where a phase has objects. It is asked for the first one and for its rivals.
    """
    first = outline(phases[0])
    outlines = [first, *(None for _ in phases[1:])]
    if first is not None and _whole(first):
        rivals = [k for k, one in enumerate(phases) if k and one.probability > _RIVAL * phases[0].probability]
        for k in rivals:
            outlines[k] = outline(phases[k])
    more = [one.there - first.there if first and one and _whole(one) else 0.0 for one in outlines]
    bits = np.log2([max(phase.probability, 1e-12) for phase in phases]) + more
    odds = 2.0 ** (bits - bits.max())
    odds /= odds.sum()
    order = np.argsort(-odds, kind="stable")
    return [replace(phases[k], probability=float(odds[k])) for k in order], [outlines[k] for k in order]


def _whole(outline: Outline) -> bool:
    """Whether next to all cells of an outline hold an object."""
    return outline.there > (1 - FEWEST_MISSES) * outline.seen


def layout_at(
    evidence: Evidence, lattice: Lattice, ground: Tensor, *, readings: tuple[Reading, ...]
) -> Layout | None:
    """The objects of a lattice that lie at its points, one of the `readings`; else as found_layout."""
    image = evidence.image
    matrix, support = _seen(evidence, lattice, ground)
    found = find_extent(image.pixels, image.valid, matrix, lattice.basis, lattice.origin, support)
    return _layout(lattice, found, readings)


def _layout(lattice: Lattice, found: Outline | None, readings: tuple[Reading, ...]) -> Layout | None:
    if found is None or min(np.diff(found.i_range)[0], np.diff(found.j_range)[0]) < 2:
        return None  # one row fixes no plane
    return Layout(lattice, found.i_range, found.j_range, found.guards, readings)


def _seen(evidence: Evidence, lattice: Lattice, ground: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """The homography of a lattice's camera [3, 3], and where the cells `ground` [N, 2] lie: bool [H, W]."""
    size = evidence.image.size
    matrix = image_from_plane(lattice.rx_deg, lattice.ry_deg, size=size, focal_mm=evidence.focal_mm).numpy()
    return matrix, _painted(evidence, ground, matrix, lattice)


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
    ranges = {"i_range": (int(low[0]), int(high[0])), "j_range": (int(low[1]), int(high[1]))}
    return replace(layout, **ranges, guards=())


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


def _drawn_cells(
    level: Level, pattern: Pattern, layout: Layout, theta: Tensor, *, cut: bool | None = None
) -> Tensor:
    """The cells in view that a layout draws, [N, 2]; `cut` as in `cells_in_view`."""
    index = cells_in_view(level, pattern, theta, most=4000, cut=cut)
    return index[torch.from_numpy(layout.holds(index.numpy()))]


def refitted(evidence: Evidence, pattern: Pattern, layout: Layout) -> Layout:
    """The layout with camera and lattice fitted once more, to its own objects only and on the fine map.

    What the fit grew on had cells cut anywhere and some beyond the pattern; now each cell holds an object.
    Objects at the frame count too: they lie farthest apart, and that fixes the pose.
    """
    theta = layout.lattice.theta(pattern)
    side = side_of_middle(evidence, pattern, layout)
    level = evidence.level_for(_SHARPER * side, finest=True)
    index = _drawn_cells(level, pattern, layout, theta, cut=True)
    if len(index) < _FEWEST_REFITTED:
        return layout
    index = index[thinned(index, _MOST_REFITTED)]
    weights = torch.ones(len(index))
    for _ in range(_REFITS):
        found = find_instances(level, pattern, theta, index, weights, side=_SIDE)
        weights = found.certainty
        if int((weights > 0).sum()) < _FEWEST_REFITTED:
            return layout
        theta = fit_instances(level, pattern, theta, found, weights=weights.double())
    if not sane(pattern, theta):
        return layout
    return replace(layout, lattice=Lattice.of(pattern, theta))


def side_of_middle(evidence: Evidence, pattern: Pattern, layout: Layout) -> float:
    """The side, in photo pixels, of the cell in the middle of a layout."""
    middle = np.array([sum(layout.i_range) - 1, sum(layout.j_range) - 1]) / 2
    return side_of_cell(evidence, pattern, layout.lattice.moved_to(middle).theta(pattern))


def _painted(evidence: Evidence, cells: Tensor, matrix: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Where the cells [N, 2] lie in the photo: bool [H, W]."""
    size = evidence.image.size
    canvas = np.zeros((size.height, size.width), np.uint8)
    points, _ = cell_corners(matrix @ lattice.plane_from_index, cells)
    for polygon in np.round(points).astype(np.int32):
        cv2.fillConvexPoly(canvas, polygon, 1)
    return canvas.astype(bool)

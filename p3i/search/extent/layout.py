"""From a fit to a program: which point of the cell is the object, which cells hold one, and the text."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.camera import image_from_plane
from p3i.interp.compile import compile
from p3i.search.extent.outline import Cells, Outline
from p3i.search.extent.phase import Phase, find_phases
from p3i.search.extent.presence import cells_that_hold
from p3i.search.extent.rows import in_rows
from p3i.search.fit.fitted import Fit
from p3i.search.fit.grow import sane, side_of_cell, weighed
from p3i.search.fit.judged import judged_cells
from p3i.search.fit.settle import with_settled_numbers
from p3i.search.forms.guess import Guess
from p3i.search.forms.lattice import Lattice, cell_corners, cells_in_view
from p3i.search.forms.layout import Layout
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.cells import sample_points
from p3i.search.look.contrast import score_of
from p3i.search.look.edges import edge_directions
from p3i.search.look.evidence import Evidence
from p3i.search.result import Reading
from p3i.vision.cell_bits import MISSES
from p3i.vision.warp import in_frame

# A proposal is shown so many steps to each side.
_SHOWN = (-6, 7)
# A place of the cell of at least this share of the likeliest's probability is a rival. Where both have an
# object in each cell but for the fewest that any pattern lacks, every further object doubles the odds.
_RIVAL = 0.05


def proposed(guess: Guess) -> Program:
    """A guess as a program to show: a lattice's says nothing of its extent."""
    if guess.filling is not lattice_filling():
        return guess.program()
    return Layout(guess.lattice, _SHOWN, _SHOWN).program()


def supported(fit: Fit) -> Program:
    """A fit as a program to show: a lattice's over the box of its support."""
    if fit.filling is not lattice_filling() or not bool(fit.support.any()):
        return fit.program()
    cells = fit.index[fit.support].int()
    low, high = cells.amin(0).tolist(), (cells.amax(0) + 1).tolist()
    return Layout(Lattice.of(fit.pattern, fit.theta), (low[0], high[0]), (low[1], high[1])).program()


def found_layout(evidence: Evidence, lattice: Lattice, ground: Tensor) -> tuple[Layout, str] | None:
    """The objects of a lattice whose cells `ground` [N, 2] are sure: phase, extent and rows from the photo.

    They lie at the likeliest place of the cell, or at the one that the options ask for where the cell has it.
    With a note on other rows that are as natural, else "". None where no object is seen.
    """
    image = evidence.part.image
    matrix, support = _seen(evidence, lattice, ground)
    phases = find_phases(image.pixels, image.valid, matrix, lattice.basis, support)

    @cache
    def cells(origin: tuple[float, float]) -> Cells | None:
        return _cells(evidence, matrix, support, lattice.basis, np.array(origin))

    def held(phase: Phase) -> Cells | None:
        return cells((float(phase.origin[0]), float(phase.origin[1])))

    if not phases:
        return None
    phases = _weighed(phases, lambda phase: None if (found := held(phase)) is None else found.outline())
    asked = evidence.config.object
    names = [phase.name or str(rank) for rank, phase in enumerate(phases, 1)]
    drawn = phases[next((k for k, name in enumerate(names) if asked in (name, str(k + 1))), 0)]
    edges = edge_directions(image.pixels, matrix, support & image.valid)
    there, own = held(drawn), replace(lattice, origin=drawn.origin)
    found = None if there is None else in_rows(there, own, edges=edges, unit_px=evidence.image.size.unit_px)
    if found is None or _is_a_row(found[0]):
        return None
    layout, note = found
    from_drawn = [(phase.origin - drawn.origin) @ np.linalg.inv(layout.lattice.basis) for phase in phases]
    readings = tuple(
        Reading(name, phase.probability, (float(step[0]), float(step[1])))
        for name, phase, step in zip(names, phases, from_drawn, strict=True)
    )
    return replace(layout, readings=readings), note


def _is_a_row(layout: Layout) -> bool:
    """Whether a layout is a single row, which fixes no plane."""
    return min(stop - start for start, stop in (layout.i_range, layout.j_range)) < 2


def _weighed(phases: Sequence[Phase], outline: Callable[[Phase], Outline | None]) -> list[Phase]:
    """Phases with the probability that their objects give them, the likeliest first.

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
    return [replace(phases[k], probability=float(odds[k])) for k in order]


def _whole(outline: Outline) -> bool:
    """Whether next to all cells of an outline hold an object."""
    return outline.there > (1 - MISSES[0]) * outline.seen


def layout_at(evidence: Evidence, lattice: Lattice, ground: Tensor) -> Layout | None:
    """The objects of a lattice that lie at its points, around cells [N, 2]; None where there are none."""
    cells = _cells(evidence, *_seen(evidence, lattice, ground), lattice.basis, lattice.origin)
    found = None if cells is None else cells.outline()
    if found is None:
        return None
    layout = Layout(lattice, found.i_range, found.j_range, found.guards)
    return None if _is_a_row(layout) else layout


def _cells(
    evidence: Evidence, matrix: np.ndarray, support: np.ndarray, basis: np.ndarray, origin: np.ndarray
) -> Cells | None:
    """The cells of a lattice in what is looked at: `cells_that_hold`."""
    image = evidence.part.image
    return cells_that_hold(image.pixels, image.valid, matrix, basis, origin, support, roi=image.roi)


def _seen(evidence: Evidence, lattice: Lattice, ground: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """The homography of a lattice's camera [3, 3], and where the cells `ground` [N, 2] lie: bool [H, W]."""
    size = evidence.image.size
    seen = image_from_plane(lattice.rx_deg, lattice.ry_deg, size=size, focal_mm=evidence.focal_mm)
    matrix = (evidence.part.from_photo @ seen).numpy()
    return matrix, _painted(evidence, ground, matrix, lattice)


def filling_layout(evidence: Evidence, layout: Layout) -> Layout:
    """The layout continued over the whole picture, as the paper assumes (section 3.4).

    All objects whose middle lies in the picture are drawn, also those whose cell the frame cuts.
    """
    pattern = lattice_filling().pattern
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
    return weighed(best.level, best.pattern, best.pattern.theta, best.index, best.contrast)


def refitted(evidence: Evidence, layout: Layout) -> Layout:
    """The layout with camera and lattice fitted once more, to where its own objects lie.

    What the fit grew on had cells cut anywhere and some beyond the pattern; now each place is an object's.
    Objects at the frame count too: they lie farthest apart, and that fixes the pose.
    """
    program = layout.program(from_zero=False)
    moved = with_settled_numbers(evidence, program)
    if moved is program:
        return layout
    drawn = compile(moved)
    if not sane(drawn, drawn.theta):
        return layout
    return replace(layout, lattice=Lattice.of(drawn, drawn.theta))


def _painted(evidence: Evidence, cells: Tensor, matrix: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Where the cells [N, 2] lie in what is looked at: bool [H, W]."""
    size = evidence.part.size
    canvas = np.zeros((size.height, size.width), np.uint8)
    points, _ = cell_corners(matrix @ lattice.plane_from_index, cells)
    for polygon in np.round(points).astype(np.int32):
        cv2.fillConvexPoly(canvas, polygon, 1)
    return canvas.astype(bool)

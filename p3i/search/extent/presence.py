"""Which of a lattice's cells hold an object, in bits for each.

What each cell says for an object is told by p3i.vision.cell_bits; which of them are drawn, the outline says
(outline.py). What lies under a mask or is too small to be judged is unknown: to draw an object there costs a
bit, as a claim that nobody can check.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.alike import at_cells, look_alike, working_size
from p3i.search.extent.outline import GUARD_BITS, Cells, best_outline
from p3i.vision.cell_bits import cell_bits
from p3i.vision.sheet import cell_sides_px, cells_from_basis, project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_SMALLEST_PX = 4.5  # a cell that shows smaller than this is not judged
_UNKNOWN_BITS = 1.0  # what it costs to claim an object that is unknown: as likely true as not


def cells_that_hold(
    pixels: Floats,
    valid: Mask,
    image_from_plane: Array,
    basis: Array,
    origin: Array,
    support: NDArray | None = None,
    *,
    roi: Mask | None = None,
) -> Cells | None:
    """How surely each cell of a lattice holds an object in a photo; None where none is seen to.

    Convention: pixels [H, W, 3] RGB in 0..1, valid [H, W]; `image_from_plane` 3x3 maps plane points in front
    of the camera to positive third coordinates; basis [2, 2] has rows u, v and origin [2] is the middle of an
    object, all in plane coordinates; support [H, W], boolean or in 0..1, may be rough. A cell whose middle
    lies outside `roi` [H, W] holds nothing, whatever is there.
    """
    small, mask, matrix = working_size(pixels, valid, image_from_plane)
    alike = look_alike(small, mask, matrix, basis, origin, support)
    if alike is None:
        return None
    box = alike.sheet.box
    image_from_cells = cells_from_basis(matrix, basis, origin)
    middles = box.indices.astype(float)
    at, front = project(image_from_cells, middles)
    inside = front & ((at >= 0) & (at <= np.array(mask.shape[::-1]) - 1)).all(1)
    large = cell_sides_px(image_from_cells, middles)[1] >= _SMALLEST_PX
    found = cell_bits(alike, inside & large)
    if not (found.whole > 0).any():
        return None
    grid = (box.rows, box.columns)
    bits = np.where(inside & ~found.judged, -_UNKNOWN_BITS, found.whole).reshape(grid)
    halves = found.halves.reshape(4, *grid)
    if support is not None:
        fitted = at_cells(support, image_from_cells, box, shape=mask.shape).reshape(grid)
        bits = np.where(_elsewhere(bits > 0, fitted), -GUARD_BITS, bits)
    if roi is not None:
        asked = at_cells(roi, image_from_cells, box, shape=mask.shape).reshape(grid) > 0
        nothing = min(float(bits.min()), -GUARD_BITS)
        bits, halves = (np.where(asked, one, nothing) for one in (bits, halves))
    return _one_pattern(bits, halves, found.judged.reshape(grid), first=(box.i_start, box.j_start))


def _elsewhere(passing: Mask, fitted: Floats) -> Mask:
    """Cells [R, C] that pass, but hang together with less of what was `fitted` [R, C] than others do.

    A neighbour of nearly the same step drifts in and out of the lattice's, so that its cells follow each
    other; and it may be larger than the pattern itself. An empty cell between two parts is a gap of one.
    """
    wide = cv2.dilate(passing.astype(np.uint8), np.ones((3, 3), np.uint8))
    count, parts = cv2.connectedComponents(wide, connectivity=4)
    own = np.bincount(parts[passing], weights=fitted[passing], minlength=count)
    return passing & (own < own.max() / 2)[parts]


def _one_pattern(bits: Array, halves: Array, judged: Mask, *, first: tuple[int, int]) -> Cells:
    """The cells [R, C] of the pattern with most bits, whatever steps its program will take.

    Along a rim the `halves` [4, R, C] towards the pattern speak, so that these cells are judged by no whole
    one; and beyond an empty row or column is another pattern, of which nothing is drawn.
    """
    rows, columns = bits.shape
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    outlines = best_outline(bits, parts=False), best_outline(bits, halves=halves)
    entire = judged & (bits > 0) & (halves > 0).all(0)
    if outlines[0] is None or outlines[1] is None:
        return Cells(bits, judged, entire, first)
    before, after = (outline.holds(i, j) for outline in outlines if outline is not None)
    rim, beyond = after & ~before, before & ~after & (bits > 0)
    told = np.where(rim, np.maximum(bits, halves.max(0)), np.where(beyond, -GUARD_BITS, bits))
    return Cells(told, judged & ~rim, entire & ~rim, first)

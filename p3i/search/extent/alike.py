"""Which cells of a known lattice look alike: the photo straightened into a sheet of equal cells.

What they share is told by p3i.vision.alike; the phase and the extent both start here.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.look.evidence import FINE
from p3i.vision.alike import Alike, alike_in
from p3i.vision.sheet import Box, cells_from_basis, project, straighten, visible_box

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_SAMPLES = 250_000  # of a sheet, at most about this many


def working_size(pixels: Floats, valid: Mask, image_from_plane: Array) -> tuple[Floats, Mask, Array]:
    """The photo [H, W, 3], its mask [H, W] and its homography [3, 3], at the size for the search."""
    scale = FINE / max(valid.shape)
    if scale >= 1:
        return np.asarray(pixels, np.float32), valid, np.asarray(image_from_plane, float)
    size = (max(1, round(valid.shape[1] * scale)), max(1, round(valid.shape[0] * scale)))
    small = cv2.resize(np.asarray(pixels, np.float32), size, interpolation=cv2.INTER_AREA)
    mask = cv2.resize(valid.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.99
    sx, sy = size[0] / valid.shape[1], size[1] / valid.shape[0]
    small_from_photo = np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1.0]])
    return np.asarray(small, np.float32), mask, small_from_photo @ image_from_plane


def look_alike(
    pixels: Floats,
    valid: Mask,
    image_from_plane: Array,
    basis: Array,
    origin: Array,
    support: NDArray | None = None,
) -> Alike | None:
    """The common cell of a lattice in a photo of working size; None where no cell shows, or nothing in them.

    `support` [H, W] of the same photo, in any size, boolean or in 0..1, says where the pattern is thought
    to be.
    """
    image_from_cells = cells_from_basis(image_from_plane, basis, origin)
    box = visible_box(image_from_cells, valid.shape)
    if box is None:
        return None
    side = int(np.clip(np.sqrt(_SAMPLES / box.count) // 2 * 2, 10, 24))
    sheet = straighten(pixels, valid, image_from_cells, box=box, side=side)
    likely = None if support is None else at_cells(support, image_from_cells, box, shape=valid.shape)
    return alike_in(sheet, likely)


def at_cells(where: NDArray, image_from_cells: Array, box: Box, *, shape: tuple[int, int]) -> Floats:
    """What `where` [H, W] has at the middle of each cell [N] of a photo of `shape`, 0 beyond it."""
    at, front = project(image_from_cells, box.indices.astype(float))
    height, width = where.shape
    scale = np.array([width, height]) / shape[::-1]
    x, y = np.round((np.nan_to_num(at).clip(-1e6, 1e6) + 0.5) * scale - 0.5).astype(int).T
    inside = front & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.where(inside, where[y.clip(0, height - 1), x.clip(0, width - 1)], 0).astype(np.float32)

"""Filling by PatchMatch (Barnes et al., SIGGRAPH 2009) as the library pypatchmatch has it.

The program guides it: a place of the photo is compared with places of the same phase within their cells.
"""

import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.paint.fill.filled import Filled, share_text
from p3i.paint.fill.stack import unlike
from p3i.place.placed import Placed
from p3i.vision.sheet import project
from p3i.vision.warp import pixel_grid

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_RADIUS = 7  # of the patches that are compared, in pixels: the best on photos of lattices


def fill_by_patchmatch(pixels: Floats, known: Mask, hole: Mask, placed: Placed, *, seed: int = 0) -> Filled:
    """The photo [H, W, 3] with its hole filled, in steps of 1/255; what is not `known` is no source.

    Where nothing like the hole is to be seen elsewhere, and on rings, the program guides nothing.

    Raises UsageError where the library is not installed or does not load.
    """
    try:
        from patchmatch import patch_match
    except ImportError:
        raise UsageError(
            "the method patchmatch needs the extra: pip install 'p3i[patchmatch]', or take --method stack"
        ) from None
    if not patch_match.patchmatch_available:
        raise UsageError("pypatchmatch is installed but its library does not load here; take --method stack")
    patch_match.set_random_seed(seed)
    values = np.rint(pixels * 255).clip(0, 255).astype(np.uint8)
    values[hole] = 0
    others = (~known & ~hole).astype(np.uint8)
    guide = _phases(placed)
    options = {"global_mask": others if others.any() else None, "patch_size": _RADIUS}
    mask = hole.astype(np.uint8)
    if guide is None:
        found = patch_match.inpaint(values, mask, **options)
    else:
        found = patch_match.inpaint_regularity(values, mask, guide, **options)
    result = pixels.copy()
    result[hole] = found[hole].astype(np.float32) / 255
    apart = unlike(pixels, known, hole, placed)
    notes: list[str] = []
    if guide is None:
        notes.append("patchmatch is guided by lattices only: here it fills unguided")
    if of_hole := share_text(apart, hole):
        notes.append(f"for {of_hole} the program has nothing like it: patchmatch takes what looks alike")
    return Filled(result, apart, hole if guide is None else apart, tuple(notes))


def _phases(placed: Placed) -> Floats | None:
    """(i, j) of each pixel, fractions too, [H, W, 3]; None for rings, which have no such map."""
    if placed.basis is None:
        return None
    points, front = project(np.linalg.inv(placed.image_from_plane), pixel_grid(placed.size).numpy())
    cells = np.where(front[..., None], (points - placed.origin) @ np.linalg.inv(placed.basis), 0)
    return np.ascontiguousarray(np.concatenate([cells, np.zeros_like(cells[..., :1])], -1), np.float32)

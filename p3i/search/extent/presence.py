"""The extent of a lattice: which of its cells hold an object, and the short outline that says so.

Each cell of the lattice is compared with the common cell (alike.py). How often cells well inside
the pattern fail that test, and cells well outside pass it, is estimated from the photo itself, which
turns agreement into log-odds; the outline of the greatest evidence less description length is the answer
(outline.py). What lies under a mask, behind a person or on the far side of the picture's border
is unknown, and an outline may or may not run over it.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.alike import Alike, Kind, look_alike, working_size
from p3i.search.extent.outline import Outline, best_outline, rectangle_gain
from p3i.vision.cells import agreement, shifted
from p3i.vision.sheet import cell_sides_px, project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_SLACK = 0.09  # of a period: how far an object may lie from its place
_FAILS, _PASSES = 0.3, 0.7  # of the scaled agreement: below no object, above surely one
FEWEST_MISSES = 0.04
"""Share of a pattern's objects that do not look like the others, at the least."""
_MISSES = (FEWEST_MISSES, 0.1, 0.2, 0.35, 0.5)  # such shares that are thought of
_STRAYS = (0.02, 0.06, 0.15)  # shares of other things that do
_LEAST_VISIBLE = 0.25  # of a cell, for it to be judged
_SMALLEST_PX = 4.5  # a cell that shows smaller than this is not judged


def find_extent(
    pixels: Floats,
    valid: Mask,
    image_from_plane: Array,
    basis: Array,
    origin: Array,
    support: NDArray | None = None,
) -> Outline | None:
    """The outline of the cells of a lattice that hold an object in a photo; None where none is seen to.

    Convention: pixels [H, W, 3] RGB in 0..1, valid [H, W]; `image_from_plane` 3x3 maps plane points in front
    of the camera to positive third coordinates; basis [2, 2] has rows u, v and origin [2] is the middle of an
    object, all in plane coordinates; support [H, W], boolean or in 0..1, may be rough.
    """
    small, mask, matrix = working_size(pixels, valid, image_from_plane)
    if support is not None and support.shape != mask.shape:
        support = cv2.resize(np.asarray(support, np.float32), mask.shape[::-1], interpolation=cv2.INTER_AREA)
    alike = look_alike(small, mask, matrix, basis, origin, support)
    if alike is None or alike.level <= 0:
        return None
    passes, trust = _passes(alike, mask.shape)
    box = alike.sheet.box
    grid = _evidence(passes, trust, (box.rows, box.columns)).reshape(box.rows, box.columns)
    outline = best_outline(grid, i_start=box.i_start, j_start=box.j_start)
    if outline is None:
        return None
    inside = outline.holds(*_indices(alike))
    return replace(outline, there=float((trust * passes)[inside].sum()), seen=float(trust[inside].sum()))


def _indices(alike: Alike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    box = alike.sheet.box
    i, j = np.meshgrid(np.arange(box.i_start, box.i_stop), np.arange(box.j_start, box.j_stop))
    return i.ravel(), j.ravel()


def _middle_shows(alike: Alike, shape: tuple[int, int]) -> Mask:
    """Whether the middle of each cell [N] lies in the photo, large enough to be judged."""
    i, j = _indices(alike)
    points = np.stack([i, j], axis=-1).astype(float)
    at, front = project(alike.image_from_cells, points)
    shorter = cell_sides_px(alike.image_from_cells, points)[1]
    inside = (at[:, 0] >= 0) & (at[:, 0] <= shape[1] - 1) & (at[:, 1] >= 0) & (at[:, 1] <= shape[0] - 1)
    return front & inside & (shorter >= _SMALLEST_PX)


def _passes(alike: Alike, shape: tuple[int, int]) -> tuple[Array, Array]:
    """How surely each cell [N] holds an object, 0..1, and how far that is to be trusted [N], 0 for unseen."""
    visible = alike.visible
    judged = _middle_shows(alike, shape) & (visible > _LEAST_VISIBLE)
    if not judged.any():
        return np.zeros(len(visible)), np.zeros(len(visible))
    score = np.maximum.reduce([_score(alike, kind, judged) for kind in alike.kinds])
    passes = np.clip((score - _FAILS) / (_PASSES - _FAILS), 0, 1).astype(float)
    return passes, np.where(judged, np.sqrt(visible), 0).astype(float)


def _evidence(passes: Array, trust: Array, shape: tuple[int, int]) -> Array:
    """Log-odds [N] that each cell holds an object, for cells that lie in so many (rows, columns)."""

    def evidence(misses: float, strays: float) -> Array:
        worst, best = np.log(misses / (1 - strays)), np.log((1 - misses) / strays)
        return (worst + (best - worst) * passes) * trust

    def support(misses: float, strays: float) -> float:
        """Log-likelihood of all cells, with the pattern filling the rectangle that suits it best."""
        without = float((trust * (passes * np.log(strays) + (1 - passes) * np.log(1 - strays))).sum())
        return without + rectangle_gain(evidence(misses, strays).reshape(shape))

    rates = max(((m, s) for m in _MISSES for s in _STRAYS), key=lambda rate: support(*rate))
    return evidence(*rates)


def _score(alike: Alike, kind: Kind, judged: Mask) -> Floats:
    """Agreement [N] of the cells with a kind of cell, scaled: 0 other things, 1 a typical one of the kind."""
    slack = max(1, round(_SLACK * alike.sheet.side))
    near = np.array([(x, y) for x in (-slack, 0, slack) for y in (-slack, 0, slack)])
    fit = agreement(alike.cells, alike.cells_known, shifted(kind.template, near)).max(axis=1)
    inside_level = float(np.average(fit, weights=kind.weights + 1e-9))
    others = judged & (alike.weights < 0.1) & (kind.weights < 0.1)
    outside_level = float(np.clip(np.median(fit[others]), 0, 0.3)) if others.sum() > 8 else 0.15
    return (fit - outside_level) / max(inside_level - outside_level, 0.05)

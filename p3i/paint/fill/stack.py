"""Filling from aligned cells: each hole becomes a mean of its sources, weighted by what they say around it.

The weights are those under which the sources together come closest to the photo around the hole (a regression
drawn towards trusting each by its own misfit); what still differs at the hole's rim is carried into it
smoothly, so that light and seams go over without an edge.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W], True is to be filled.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.light import membrane, rim_of
from p3i.paint.fill.matching import trusted
from p3i.paint.fill.sources import MOST_TRIED, Ground, Hole, Source, hole_of, shown_elsewhere, sources
from p3i.place.moves import nearest
from p3i.place.placed import Placed
from p3i.vision.fill import fill_in
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# A piece of a hole with more cells than this is filled in blocks of two by two.
_MOST_CELLS = 9
# The rim at which the fill is compared with the photo, in pixels.
_RIM_PX = 4.0


def fill_by_stack(
    pixels: Floats,
    known: Mask,
    hole: Mask,
    placed: Placed,
    *,
    most_tried: int = MOST_TRIED,
    progress: Progress | None = None,
) -> tuple[Floats, Mask]:
    """The photo with its hole filled, and where nothing like the hole was found [H, W].

    What is not `known` is no source, and is not filled either unless the hole holds it. Where no source shows
    a pixel, the surroundings are continued smoothly. Fewer objects tried for each piece is faster.
    """
    known = known & ~hole
    ground = Ground.of(pixels, known)
    result = pixels.copy()
    result[hole] = 0
    context = known.copy()  # what the next piece is compared with: also what was filled before it
    bare = np.zeros_like(hole)
    before = np.zeros_like(hole)  # what pieces next to the one in hand have been given
    pieces = _pieces(hole, known, placed)
    for done, points in enumerate(pieces):
        if progress is not None:
            progress("filling", done / len(pieces))
        one = hole_of(points, result, context, placed)
        colours, seen = _filled(one, ground, sources(one, ground, placed, most=most_tried), result, before)
        columns, rows = points.astype(int).T
        result[rows, columns] = colours
        bare[rows, columns] = ~seen
        context[rows[seen], columns[seen]] = True
        before[rows[seen], columns[seen]] = True
    if bare.any():
        fill_in(result, context, bare)
    return result, bare


def unlike(pixels: Floats, known: Mask, hole: Mask, placed: Placed) -> Mask:
    """Where a hole [H, W] is like nothing that the program shows elsewhere on the photo: [H, W]."""
    known = known & ~hole
    ground = Ground.of(pixels, known)
    found = np.zeros_like(hole)
    for points in _pieces(hole, known, placed):
        columns, rows = points.astype(int).T
        found[rows, columns] = ~shown_elsewhere(hole_of(points, pixels, known, placed), ground, placed)
    return found


def _pieces(hole: Mask, known: Mask, placed: Placed) -> list[Array]:
    """The hole piece by piece, pixels [L, 2] each: what hangs together, in blocks where it is large.

    The blocks of a large piece come from its rim inwards, so that each has something beside it.
    """
    count, labels = cv2.connectedComponents(hole.astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(hole)
    order = np.argsort(labels[rows, columns], kind="stable")
    points = np.stack([columns, rows], 1)[order].astype(float)
    ends = np.cumsum(np.bincount(labels[rows, columns], minlength=count)[1:])[:-1]
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    found: list[Array] = []
    deep = None
    for piece in np.split(points, ends):
        on_plane, _ = project(plane_from_image, piece)
        numbers = nearest(placed, on_plane)
        cells = np.flatnonzero(np.bincount(numbers, minlength=len(placed.index)))
        if len(cells) <= _MOST_CELLS:
            found.append(piece)
            continue
        blocks, block_of = np.unique(placed.index[cells] // 2, axis=0, return_inverse=True)
        members = np.zeros(len(placed.index), np.int64)
        members[cells] = block_of.reshape(-1)
        members = members[numbers]
        parts = [piece[members == block] for block in range(len(blocks))]
        if deep is None:
            deep = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)
        depths = [float(deep[tuple(part.astype(int).T[::-1])].mean()) for part in parts]
        found += [parts[place] for place in np.argsort(depths, kind="stable")]
    return found


def _filled(
    hole: Hole, ground: Ground, found: list[Source], shown: Floats, before: Mask
) -> tuple[Floats, Mask]:
    """The colours of a hole's pixels [L, 3], and which of them any source shows [L]."""
    if not found:
        return np.zeros((len(hole.points), 3), np.float32), np.zeros(len(hole.points), bool)
    weights = weighed(hole, ground, found)
    colours, weight = mixed(hole.points, ground, found, weights, sharp=True)
    return np.clip(colours + _carried(hole, ground, found, weights, shown, before), 0, 1), weight > 1e-6


def weighed(hole: Hole, ground: Ground, found: list[Source]) -> Array:
    """How much each source counts, [S], together 1: least squares on the surroundings, drawn to a prior."""
    residuals = []
    for source in found:
        at, front = source.where(hole.around)
        colours = source.gain * taken(ground.pixels, at) + source.offset
        shown = (front & ground.known(at))[:, None]
        residuals.append(np.where(shown, colours - hole.colours, 0))
    return trusted(np.stack(residuals), hole.weights, np.array([source.misfit for source in found]))


def mixed(
    points: Array, ground: Ground, found: list[Source], weights: Array, *, sharp: bool
) -> tuple[Floats, Array]:
    """The sources' colours at the hole's points, mixed [L, 3], and the weight of those that show them [L].

    Each of the `weights` is one number a source, [S], or one for each point, [S, L].
    """
    total, weight = np.zeros((len(points), 3)), np.zeros(len(points))
    for source, share in zip(found, weights, strict=True):
        if np.max(share) < 1e-4:
            continue
        at, front = source.where(points)
        shown = share * (front & ground.known(at))
        total += shown[:, None] * (source.gain * taken(ground.pixels, at, sharp=sharp) + source.offset)
        weight += shown
    return (total / np.maximum(weight, 1e-9)[:, None]).astype(np.float32), weight


def _carried(
    hole: Hole, ground: Ground, found: list[Source], weights: Array, shown: Floats, before: Mask
) -> Floats:
    """What the photo differs by from the sources at the hole's rim, carried to its pixels: [L, 3].

    The rim is of the photo, and of what was filled `before` [H, W]; both are in `shown` [H, W, 3].
    """
    margin = int(np.ceil(_RIM_PX)) + 1
    low = np.maximum(hole.points.min(0).astype(int) - margin, 0)
    width, height = (hole.points.max(0).astype(int) + margin + 1 - low).tolist()
    inside = np.zeros((height, width), np.uint8)
    columns, rows = (hole.points.astype(int) - low).T
    inside[rows, columns] = 1
    known = np.zeros((height, width), bool)
    window = (slice(low[1], low[1] + height), slice(low[0], low[0] + width))
    part = (ground.sure[window] > 0) | before[window]
    known[: part.shape[0], : part.shape[1]] = part
    rim_rows, rim_columns = np.nonzero(rim_of(inside, known, reach_px=_RIM_PX))
    if not len(rim_rows):
        return np.zeros((len(hole.points), 3), np.float32)
    colours, weight = mixed(
        np.stack([rim_columns + low[0], rim_rows + low[1]], 1).astype(float),
        ground,
        found,
        weights,
        sharp=False,
    )
    compared = weight > 0.3
    rim_rows, rim_columns = rim_rows[compared], rim_columns[compared]
    off, rim = np.zeros((height, width, 3), np.float32), np.zeros((height, width), bool)
    off[rim_rows, rim_columns] = shown[rim_rows + low[1], rim_columns + low[0]] - colours[compared]
    rim[rim_rows, rim_columns] = True
    return membrane(off, rim, spacing_px=hole.spacing_px)[rows, columns]

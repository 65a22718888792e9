"""Copies of a hole on ground that is known, to try upon them what fills the hole.

The program's moves lay a hole upon other cells, so that there the same is hidden of the pattern, and as much
of what lies around is seen. Where the whole hole is too large for that, each copy is of its part in one cell.

Convention: masks bool [H, W]; points (x, y) in pixels of the photo.
"""

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.paint.fill.npn.tasks import Task
from p3i.paint.fill.pieces import drawn_on
from p3i.place.moves import moves, nearest_px, pitch_px
from p3i.place.placed import Placed
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST, FEWEST = 8, 3
"""So many copies are made at most; fewer than so many whole ones, and copies are of single cells' parts."""
# They hide as much as this share of the cells that they may lie upon, ...
_MOST_HIDDEN = 0.25
# ... lie this far apart, in distances between objects, ...
_APART = 0.4
# ... and as much of each is known at least.
_LEAST_KNOWN = 0.9
# Beyond the pattern's edge it is not as within: so much of a copy lies as its original does.
_LEAST_ALIKE = 0.8
_LEAST_PX = 12
# So many places are tried for each copy that is wanted.
_TRIES = 8


def copies(
    known: Mask,
    hole: Mask,
    placed: Placed,
    tasks: list[Task],
    places: list[int],
    *,
    cell_px: float,
    seed: int,
) -> list[NDArray[np.int64]]:
    """The pixels [L, 2] of each copy of the `hole`; `places` are the objects upon which copies may lie.

    `known` is what is known beside the hole, `tasks` are the hole's parts; a cell has about `cell_px` pixels.
    """
    drawn = drawn_on(placed) > 0
    room = _MOST_HIDDEN * len(places) * cell_px
    wholes = _components(hole, placed)
    found: list[NDArray[np.int64]] = []
    if min(len(points) for _, points in wholes) * FEWEST <= room:
        found = _laid(wholes, known, drawn, placed, places, room=room, seed=seed)
    if len(found) < FEWEST:
        parts = [(task.number, task.points.astype(np.int64)) for task in tasks]
        found = _laid(parts, known, drawn, placed, places, room=room, seed=seed)
    return found


def _components(hole: Mask, placed: Placed) -> list[tuple[int, NDArray[np.int64]]]:
    """What hangs together of a hole: the object nearest to its middle, its pixels [L, 2]."""
    count, parts, boxes, middles = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)
    found = []
    for number in range(1, count):
        left, top, wide, high = boxes[number, :4]
        inside = np.argwhere(parts[top : top + high, left : left + wide] == number)[:, ::-1]
        found.append((nearest_px(placed, middles[number]), inside + np.array([left, top])))
    return found


def _laid(
    shapes: list[tuple[int, NDArray[np.int64]]],
    known: Mask,
    drawn: Mask,
    placed: Placed,
    places: list[int],
    *,
    room: float,
    seed: int,
) -> list[NDArray[np.int64]]:
    """Copies of shapes, each an object and pixels [L, 2] beside it, laid upon other objects by chance."""
    chance = torch.Generator().manual_seed(seed + 1)
    # The larger its part of the hole, the more a shape counts.
    sizes = torch.tensor([float(len(points)) for _, points in shapes])
    taken = np.zeros(known.shape, bool)
    found: list[NDArray[np.int64]] = []
    hidden = 0
    order = torch.randperm(len(places), generator=chance)[: MOST * _TRIES]
    for place in order.tolist():
        if len(found) == MOST:
            break
        origin, points = shapes[int(torch.multinomial(sizes, 1, generator=chance))]
        copy = _moved(points, origin, places[place], placed)
        if copy is None or not _fits(copy, points, known & ~taken, drawn) or hidden + len(copy) > room:
            continue
        found.append(copy[known[copy[:, 1], copy[:, 0]]])
        hidden += len(copy)
        _mark(taken, copy, round(_APART * pitch_px(placed, places[place])))
    return found


def _fits(copy: NDArray[np.int64], original: NDArray[np.int64], free: Mask, drawn: Mask) -> bool:
    """Whether a copy [L, 2] lies on `free` ground, and as its original does in the pattern or beyond it."""
    columns, rows = copy.T
    if len(copy) < _LEAST_PX or free[rows, columns].mean() < _LEAST_KNOWN:
        return False
    shares = [float(drawn[points[:, 1], points[:, 0]].mean()) for points in (copy, original)]
    return abs(shares[0] - shares[1]) <= 1 - _LEAST_ALIKE


def _moved(points: NDArray[np.int64], origin: int, place: int, placed: Placed) -> NDArray[np.int64] | None:
    """The pixels [L, 2] that show at object `place` what `points` [K, 2] show at object `origin`.

    None where they would lie beyond the photo.
    """
    matrix = placed.image_from_plane @ moves(placed, origin)[place] @ np.linalg.inv(placed.image_from_plane)
    if not np.isfinite(matrix).all():
        return None
    there, front = project(matrix, points.astype(float))
    low, high = np.floor(there.min(0)).astype(int), np.ceil(there.max(0)).astype(int)
    if not front.all() or (low < 0).any() or (high >= [placed.size.width, placed.size.height]).any():
        return None
    first, last = points.min(0), points.max(0)
    mask = np.zeros((last - first + 1)[::-1], bool)
    mask[points[:, 1] - first[1], points[:, 0] - first[0]] = True
    pixels = np.stack(np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)), -1)
    pixels = pixels.reshape(-1, 2)
    back, seen = project(np.linalg.inv(matrix), pixels.astype(float))
    within = np.rint(back).astype(int) - first
    inside = seen & (within >= 0).all(1) & (within <= last - first).all(1)
    inside[inside] = mask[within[inside, 1], within[inside, 0]]
    return pixels[inside]


def _mark(taken: Mask, copy: NDArray[np.int64], reach_px: int) -> None:
    """Mark what lies within `reach_px` of a copy's pixels [L, 2]."""
    height, width = taken.shape
    left, top = np.maximum(copy.min(0) - reach_px, 0)
    right, bottom = np.minimum(copy.max(0) + reach_px + 1, [width, height])
    part = np.zeros((bottom - top, right - left), np.uint8)
    part[copy[:, 1] - top, copy[:, 0] - left] = 1
    taken[top:bottom, left:right] |= cv2.dilate(part, np.ones((2 * reach_px + 1,) * 2, np.uint8)) > 0

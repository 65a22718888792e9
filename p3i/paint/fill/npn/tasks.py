"""What is to be painted: the hidden part of each cell, as an outline in its patch and as pixels of the photo.

Convention: masks bool [H, W]; points (x, y) in pixels of the photo.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from p3i.paint.fill.npn.cells import Cells, laid
from p3i.place.moves import nearest
from p3i.place.placed import Placed
from p3i.vision.sheet import project
from p3i.vision.warp import sample

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A part of a hole is a sliver where it has less than this share of the pixels of the largest.
_SLIVER = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A hidden cell: its object's number, its outline [1, h, w] in its patch, its pixels [L, 2] of the
    photo."""

    number: int
    outline: torch.Tensor
    points: Array


def tasks_of(cells: Cells, placed: Placed, hole: Mask) -> list[Task]:
    """The hidden cells: the hole [H, W] split by the program's centres, as far as each patch reaches."""
    points = np.argwhere(hole)[:, ::-1].astype(float)
    on_plane, front = project(np.linalg.inv(placed.image_from_plane), points)
    own = np.where(front, nearest(placed, on_plane), -1)
    # A sliver of a cell is painted with the largest part beside it: alone it would hang on that one's fill.
    numbers, counts = np.unique(own[own >= 0], return_counts=True)
    large = numbers[counts >= _SLIVER * counts.max(initial=0)]
    owners = dataclasses.replace(placed, points=placed.points[large], index=placed.index[large])
    own = np.where(front, large[nearest(owners, on_plane)] if len(large) else -1, -1)
    order = np.argsort(own, kind="stable")
    found: list[Task] = []
    marked = torch.from_numpy(hole.astype(np.float32))[None]
    photo_from_small = torch.from_numpy(np.linalg.inv(cells.from_photo))
    plane_from_photo = np.linalg.inv(placed.image_from_plane)
    for part in np.split(order, np.flatnonzero(np.diff(own[order])) + 1):
        number = int(own[part[0]]) if len(part) else -1
        if number < 0 or not bool(torch.isfinite(cells.views[number]).all()):
            continue
        # A patch's pixel is hidden where the photo's pixel nearest to it is, and it is this cell's own.
        at, seen = laid(photo_from_small @ cells.views[number].cpu(), cells.patch)
        ground, _ = project(plane_from_photo, at.numpy().reshape(-1, 2).astype(float))
        mine = torch.from_numpy(large[nearest(owners, ground)] == number).reshape(seen.shape)
        outline = (sample(marked, at)[..., 0] > 0.01) & seen & mine
        if outline.any():
            found.append(Task(number, outline.float()[None], points[part]))
    return found

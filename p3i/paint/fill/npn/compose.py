"""From what the network says of a patch to colours of the photo's own pixels.

Which source to believe, and what to add, is smooth enough to be magnified; the sources themselves are read
anew at the photo's full size, so that the fill is as sharp as they are.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from p3i.paint.fill.ground import Ground
from p3i.paint.fill.npn.cells import Cells
from p3i.paint.fill.npn.network import PaintingNetwork
from p3i.paint.fill.npn.stacks import Pool, finer, stacks_of
from p3i.paint.fill.npn.tasks import Task
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# So many hidden cells are laid out and painted at once.
_AT_ONCE = 8
# A source that counts for less than this everywhere is not read; a pixel is painted where its sources have
# more than this share of the say.
_LEAST_SAY, _LEAST_SEEN = 1e-3, 0.3


def painted(
    network: PaintingNetwork, cells: Cells, fine: Cells, pool: Pool, ground: Ground, tasks: list[Task]
) -> list[tuple[Floats, Mask]]:
    """The colours [L, 3] of each task's pixels, and for which of them [L] its sources have something to
    say."""
    found: list[tuple[Floats, Mask]] = []
    for start in range(0, len(tasks), _AT_ONCE):
        part = tasks[start : start + _AT_ONCE]
        numbers = torch.tensor([task.number for task in part], device=cells.device)
        outlines = torch.stack([task.outline for task in part]).to(cells.device)
        batch, laid, able = stacks_of(cells, pool, numbers, outlines)
        with torch.no_grad():
            said = network(batch)
        attention = said.attention[:, :, 0].cpu().numpy()
        smooth = (said.fill - (said.attention * batch.sources).sum(1)).movedim(1, -1).cpu().numpy()
        laid = finer(laid, batch, cells, fine, numbers)
        own = cells.views[numbers].cpu().numpy(), fine.views[numbers].cpu().numpy()
        views, gains, offsets = (part.cpu().numpy() for part in (laid.views, laid.gains, laid.offsets))
        for place, task in enumerate(part):
            if not able[place]:
                found.append((np.zeros((len(task.points), 3), np.float32), np.zeros(len(task.points), bool)))
                continue
            patch_from_photo = np.linalg.inv(own[0][place]) @ cells.from_photo
            fine_from_photo = np.linalg.inv(own[1][place]) @ fine.from_photo
            from_hole = np.linalg.inv(fine.from_photo) @ views[place] @ fine_from_photo
            light = gains[place], offsets[place]
            found.append(
                _composed(
                    task.points, ground, patch_from_photo, from_hole, light, attention[place], smooth[place]
                )
            )
    return found


def _composed(
    points: Array,
    ground: Ground,
    patch_from_photo: Array,
    from_hole: Array,
    light: tuple[Floats, Floats],
    attention: Floats,
    smooth: Floats,
) -> tuple[Floats, Mask]:
    """One task's colours [L, 3]: sources under `from_hole` [K, 3, 3] in their `light`, by `attention` [K, h,
    w]."""
    at, front = project(patch_from_photo, points)
    height, width = attention.shape[1:]
    inside = front & (at >= -0.5).all(1) & (at <= np.array([width, height]) - 0.5).all(1)
    total, weight = np.zeros((len(points), 3), np.float32), np.zeros(len(points), np.float32)
    for matrix, gain, offset, plane in zip(from_hole, *light, attention, strict=True):
        if plane.max() < _LEAST_SAY:
            continue
        places, seen = project(matrix, points)
        share = taken(plane, at) * (seen & ground.known(places))
        total += share[:, None] * (gain * taken(ground.pixels, places, sharp=True) + offset)
        weight += share
    colours = total / np.maximum(weight, 1e-6)[:, None] + taken(np.ascontiguousarray(smooth), at)
    return np.clip(colours, 0, 1).astype(np.float32), inside & (weight > _LEAST_SEEN)

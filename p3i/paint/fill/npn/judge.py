"""Is the network surer than the stack? Both fill cells that neither the training nor they themselves see.

A few cells of the photo are set aside, far enough from one another, each with the outline that is hidden in
one of the cells to be painted. The stack fills them as it fills a photo; the network paints them; and what is
there in truth tells which mix of the two is nearest.
"""

from dataclasses import dataclass

import numpy as np
import torch

from p3i.paint.fill.npn.cells import Cells, laid
from p3i.paint.fill.npn.compose import Task, painted
from p3i.paint.fill.npn.lessons import teachers
from p3i.paint.fill.npn.network import PaintingNetwork
from p3i.paint.fill.npn.stacks import Pool, pool_of
from p3i.paint.fill.sources import Floats, Ground, Mask
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.sheet import project
from p3i.vision.warp import taken

MIXES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""How much of the network's fill may be taken, the rest being the stack's."""
# So many cells are set aside, one in four of those that can teach at most, and with fewer nothing is sure.
_MOST, _ONE_IN, _FEWEST = 8, 4, 3
# Two of them lie at least this far apart, in least distances between objects.
_APART = 1.9
_LEAST_PX = 12


@dataclass(frozen=True, slots=True, eq=False)
class Jury:
    """Cells set aside to judge by: their objects' `numbers` [J], the photo's pixels `hidden` [H, W] in
    them."""

    photo: Image
    known: Mask
    hidden: Mask
    tasks: list[Task]
    by_stack: Floats

    @property
    def numbers(self) -> torch.Tensor:
        """The objects whose cells are set aside [J]."""
        return torch.tensor([task.number for task in self.tasks])

    def errors(self, network: PaintingNetwork, cells: Cells, fine: Cells) -> Floats:
        """The mean L1 (0..1) of each mix over each cell set aside [J, mixes]; `cells` and `fine` must
        hide them."""
        numbers = self.numbers.to(cells.device)
        ground = Ground.of(self.photo.pixels, self.known & ~self.hidden)
        found = []
        for task, (colours, seen) in zip(
            self.tasks,
            painted(network, cells, fine, pool_of(cells, numbers), ground, self.tasks),
            strict=True,
        ):
            columns, rows = task.points.astype(int).T
            start, truth = self.by_stack[rows, columns], self.photo.pixels[rows, columns]
            change = np.where(seen[:, None], colours - start, 0)
            found.append([float(np.abs(start + mix * change - truth).mean()) for mix in MIXES])
        return np.array(found, np.float32)

    def verdict(self, network: PaintingNetwork, cells: Cells, fine: Cells) -> float:
        """The mix that is nearest to the truth; 0 where it is not nearer by more than chance explains."""
        errors = self.errors(network, cells, fine)
        place = int(errors.mean(0).argmin())
        # Cells differ in how hard they are: what is won in each, beside how much that varies.
        won = errors[:, 0] - errors[:, place]
        sure = won.mean() > won.std(ddof=1) / np.sqrt(len(won))
        return MIXES[place] if sure else 0.0


def judged(
    photo: Image, placed: Placed, hole: Mask, cells: Cells, pool: Pool, tasks: list[Task], *, seed: int
) -> Jury | None:
    """Cells set aside, filled by the stack; None where the photo has too few.

    `cells` must hide the `hole` [H, W].
    """
    places = teachers(cells, pool).cpu()
    chance = torch.Generator().manual_seed(seed + 1)
    known = photo.valid & ~hole
    hidden = np.zeros_like(hole)
    chosen: list[Task] = []
    sizes = torch.tensor([float(len(task.points)) for task in tasks])
    apart = _APART * _least_distance(placed)
    for place in places[torch.randperm(len(places), generator=chance)].tolist():
        if len(chosen) >= min(_MOST, len(places) // _ONE_IN):
            break
        number = int(pool.numbers[place])
        away = placed.points[[task.number for task in chosen]] - placed.points[number]
        if len(chosen) and np.hypot(*away.T).min() < apart:
            continue
        # The larger its part of the hole, the more an outline counts.
        outline = tasks[int(torch.multinomial(sizes, 1, generator=chance))].outline
        points = _points_of(cells, number, outline, known)
        if len(points) < _LEAST_PX:
            continue
        columns, rows = points.astype(int).T
        hidden[rows, columns] = True
        chosen.append(Task(number, outline, points))
    if len(chosen) < _FEWEST:
        return None
    by_stack, _ = fill_by_stack(photo.pixels, known, hidden, placed)
    return Jury(photo, known, hidden, chosen, by_stack)


def _points_of(cells: Cells, number: int, outline: torch.Tensor, known: Mask) -> np.ndarray:
    """The photo's known pixels [L, 2] under an outline [1, h, w] in the patch of a cell."""
    photo_from_patch = np.linalg.inv(cells.from_photo) @ cells.views[number].cpu().numpy()
    at, front = laid(torch.from_numpy(photo_from_patch), cells.patch)
    corners = at[front].reshape(-1, 2).numpy()
    height, width = known.shape
    low = np.clip(np.floor(corners.min(0)), 0, [width, height]).astype(int)
    high = np.clip(np.ceil(corners.max(0)) + 1, 0, [width, height]).astype(int)
    points = np.stack(np.meshgrid(*(np.arange(*ends) for ends in zip(low, high, strict=True))), -1).reshape(
        -1, 2
    )
    within, seen = project(np.linalg.inv(photo_from_patch), points.astype(float))
    inside = seen & (within >= 0).all(1) & (within <= [cells.patch.width - 1, cells.patch.height - 1]).all(1)
    points = points[inside & known[points[:, 1], points[:, 0]]]
    within, _ = project(np.linalg.inv(photo_from_patch), points.astype(float))
    return points[taken(outline[0].cpu().numpy(), within) > 0.5].astype(float)


def _least_distance(placed: Placed) -> float:
    """How far the nearest other object lies from that which is usual, in program units."""
    asked = placed.points[np.linspace(0, len(placed.points) - 1, min(64, len(placed.points))).astype(int)]
    far = np.hypot(*(asked[:, None] - placed.points).transpose(2, 0, 1))
    return float(np.median(np.where(far > 1e-9, far, np.inf).min(1)))

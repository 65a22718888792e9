"""How much of the network's fill to take? Both fill copies of the hole that neither has learned from.

The rest is the stack's fill. The share that comes nearest to what the copies hide is an estimate like any
other: it has an error, told by how the copies differ, and is drawn towards what other photos say of it.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from p3i.paint.fill.ground import Floats, Ground, Mask
from p3i.paint.fill.npn.cells import Cells, cells_of, finer
from p3i.paint.fill.npn.compose import painted
from p3i.paint.fill.npn.copies import FEWEST, copies
from p3i.paint.fill.npn.lessons import teachers
from p3i.paint.fill.npn.network import PaintingNetwork
from p3i.paint.fill.npn.stacks import Pool, pool_of
from p3i.paint.fill.npn.tasks import Task, tasks_of
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.placed import Placed
from p3i.vision.image import Image

PRIOR, PRIOR_SPREAD = 0.5, 0.25
"""The share that is best, in the mean of photos, and its standard deviation from one to another: of nine
photos (docs/npn.md), 0.52 and 0.24 by the method of moments."""


@dataclass(frozen=True, slots=True, eq=False)
class Jury:
    """Copies of the hole to judge by, the pixels [L, 2] of each, `hidden` [H, W] together.

    `truth` [H, W, 3] is the photo, `by_stack` the same with the copies filled by the stack. `ground`, `cells`
    and `fine` are the photo's with the copies and the hole hidden; `tasks` are what is to be painted.
    """

    ground: Ground
    truth: Floats
    hidden: Mask
    copies: list[NDArray[np.int64]]
    by_stack: Floats
    cells: Cells
    fine: Cells
    tasks: list[Task]

    @property
    def numbers(self) -> torch.Tensor:
        """The objects in whose cells the copies lie [T]."""
        return torch.tensor([task.number for task in self.tasks], device=self.cells.device)

    def share(self, network: PaintingNetwork) -> float:
        """How much of this network's fill to take, 0..1; 0 where on the copies that comes no nearer."""
        filled = self.by_stack.copy()
        pool = pool_of(self.cells, self.numbers)
        found = painted(network, self.cells, self.fine, pool, self.ground, self.tasks)
        for task, (colours, seen) in zip(self.tasks, found, strict=True):
            columns, rows = task.points[seen].astype(int).T
            filled[rows, columns] = colours[seen]
        changes, lacks = (
            [pixels[copy[:, 1], copy[:, 0]] - self.by_stack[copy[:, 1], copy[:, 0]] for copy in self.copies]
            for pixels in (filled, self.truth)
        )
        return share_of(changes, lacks)


def judged(
    photo: Image, placed: Placed, hole: Mask, cells: Cells, pool: Pool, tasks: list[Task], *, seed: int
) -> Jury | None:
    """Copies of the hole [H, W], filled by the stack; None where the photo has room for too few.

    `cells` must hide the hole, whose parts are the `tasks`.
    """
    known = photo.valid & ~hole
    places = pool.numbers[teachers(cells, pool)].tolist()
    # The photo's pixels of the cell that is as large as is usual.
    cell_px = float(cells.cell.sum() / np.linalg.det(cells.from_photo))
    found = copies(known, hole, placed, tasks, places, cell_px=cell_px, seed=seed)
    if len(found) < FEWEST:
        return None
    hidden = np.zeros_like(hole)
    for copy in found:
        hidden[copy[:, 1], copy[:, 0]] = True
    by_stack, bare = fill_by_stack(photo.pixels, known, hidden, placed)
    seen, unknown = Image(by_stack, photo.valid), hole | hidden
    own = cells_of(seen, placed, unknown, hole | bare, device=cells.device)
    fine = finer(own, seen, unknown, hole | bare)
    ground = Ground.of(photo.pixels, known & ~hidden)
    return Jury(ground, photo.pixels, hidden, found, by_stack, own, fine, tasks_of(own, placed, hidden))


def share_of(changes: list[Floats], lacks: list[Floats]) -> float:
    """The share of the `changes` that comes nearest to what `lacks`, [L, 3] for each of some copies: 0..1.

    By least squares, drawn to the prior as far as copies differ in what they say.
    """
    pairs = list(zip(changes, lacks, strict=True))
    together = np.array([float((change * lack).mean()) for change, lack in pairs])
    square = np.array([float((change**2).mean()) for change, _ in pairs])
    if square.sum() <= 0:
        return 0.0
    share = together.sum() / square.sum()
    # Copies are independent of one another, pixels of one are not.
    count = len(pairs)
    variance = count / (count - 1) * ((together - share * square) ** 2).sum() / square.sum() ** 2
    weight = PRIOR_SPREAD**2 / (PRIOR_SPREAD**2 + variance)
    return float(np.clip(weight * share + (1 - weight) * PRIOR, 0, 1))

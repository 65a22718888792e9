"""Instances: where each object really lies, by correlation with the mean cell.

Gauss-Newton on features sees as far as their blur. Searching each cell's surroundings for the mean cell sees
a third of a cell, and tells a cell that is there from one that is not.
"""

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.look.cells import mean_of_others, read_cells
from p3i.search.look.evidence import Level

SIDE = 12
"""Samples along a cell's side."""

# An instance counts where its peak beats the rim of the search by this much.
_LEAST_LEAD = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Instances:
    """What correlation with the mean cell says of each cell, N of them.

    `offsets` [N, 2]: where the object lies, in index units from where the program puts it. `peak` [N]: the
    agreement with the mean cell there; `lead` [N]: by how much that beats the best at the search's rim.
    """

    index: Tensor
    offsets: Tensor
    peak: Tensor
    lead: Tensor

    @property
    def certainty(self) -> Tensor:
        """How much each instance counts in a fit, [N]: its agreement, where that has a clear place."""
        return self.peak.clamp(min=0) * (self.lead > _LEAST_LEAD)


def find_instances(
    level: Level, pattern: Pattern, theta: Tensor, index: Tensor, weights: Tensor, *, side: int = SIDE
) -> Instances:
    """Search around each cell of `index` [N, 2] for the mean cell; `weights` [N] make that mean.

    A cell takes no part in the mean that it is compared with, and is read at `side` samples along its side.
    """
    wide = side + 2 * reach_of(side)
    steps = (torch.arange(wide, dtype=torch.float64) - (wide - 1) / 2) / side
    cells = read_cells(level, pattern, theta, index, torch.cartesian_prod(steps, steps))
    planes = cells.values.reshape(len(index), wide, wide, -1).permute(0, 3, 1, 2)  # [N, C, a, b]
    return located(index, planes, cells.known.reshape(len(index), wide, wide), weights, side=side)


def reach_of(side: int) -> int:
    """The samples to each side by which what is `side` samples wide is searched for: a third of it."""
    return round(side / 3)


def located(index: Tensor, planes: Tensor, known: Tensor, weights: Tensor, *, side: int) -> Instances:
    """Where in planes [N, C, w, w] what lies in the middle of all others is; known [N, w, w] bool.

    `side` is how wide that is; offsets are (row, column) in sides, w = side + 2 * reach_of(side).
    """
    seen = known[:, None].float()
    middle = slice(reach_of(side), reach_of(side) + side)
    templates = mean_of_others(planes[:, :, middle, middle], seen[:, :, middle, middle], weights)
    offsets, peak, lead = correlate(planes, seen, templates)
    return Instances(index, offsets / side, peak, lead)


def correlate(planes: Tensor, known: Tensor, templates: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Where in each plane its template fits best.

    Shapes: planes [N, C, w, w], known [N, 1, w, w] 0 or 1, templates [N, C, s, s] with w - s even ->
    offsets [N, 2] in samples (row, column), the agreement there [N], and its lead over the rim [N].
    """
    count, channels, wide, _ = planes.shape
    side = templates.shape[-1]
    kernel = templates.reshape(-1, 1, side, side)
    inner = F.conv2d(planes.reshape(1, count * channels, wide, wide), kernel, groups=kernel.shape[0])
    inner = inner.reshape(count, channels, *inner.shape[-2:]).sum(1)
    energy = F.conv2d(planes.square().sum(1, keepdim=True), torch.ones(1, 1, side, side))[:, 0]
    squared = templates.square().sum(1)
    of_template = F.conv2d(known.reshape(1, count, wide, wide), squared[:, None], groups=count)[0]
    return _peaks(2 * inner / (energy + of_template).clamp(min=1e-6))


def _peaks(value: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The best place in each table of agreements [N, S, S], finer than the samples: see `correlate`."""
    count, side, _ = value.shape
    flat = value.reshape(count, -1)
    peak, place = flat.max(1)
    row, column = place // side, place % side
    inside = (row > 0) & (row < side - 1) & (column > 0) & (column < side - 1)
    r, c = row.clamp(1, side - 2), column.clamp(1, side - 2)
    each = torch.arange(count)

    def vertex(before: Tensor, at: Tensor, after: Tensor) -> Tensor:
        bend = before - 2 * at + after
        return torch.where(bend < -1e-6, 0.5 * (before - after) / bend.clamp(max=-1e-6), 0).clamp(-0.5, 0.5)

    at = value[each, r, c]
    fine_a = vertex(value[each, r - 1, c], at, value[each, r + 1, c])
    fine_b = vertex(value[each, r, c - 1], at, value[each, r, c + 1])
    offsets = torch.stack([row + fine_a, column + fine_b], 1).double() - (side - 1) / 2
    rim = torch.ones(side, side, dtype=torch.bool)
    rim[1:-1, 1:-1] = False
    lead = torch.where(inside, peak - value[:, rim].amax(1), 0.0)
    return offsets, peak, lead

"""Cells: the stretch of plane around each draw, read off the feature map and compared.

A cell is what fractional loop indices sweep: the points of (i + a, j + b) with a, b in [-1/2, 1/2). Under a
lattice that is the fundamental cell, under concentric rings a sector of a ring, and so for any program. The
neighbours of equation 2 are whole steps of the index; half steps of it are where the pattern must NOT look
the same, else the cell is a multiple of the true one, or there is no pattern but a smooth picture.

Convention: N cells, K samples a cell, C channels; `index` float64 [N, 2]; values [N, K, C], known [N, K].
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Level
from p3i.vision.warp import sample, sample_valid

HALF_STEPS = torch.tensor([[0.5, 0.0], [0.0, 0.5], [0.5, 0.5]], dtype=torch.float64)
"""The half steps of a two-directional index."""
SIDE = 6
"""Samples along a cell's side wherever cells are compared."""
# A mean that rests on less than this weight is of none.
_LEAST_WEIGHT = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """The features of N cells at K samples each: values [N, K, C], 0 where not known; known [N, K] bool."""

    values: Tensor
    known: Tensor


def sample_grid(side: int = SIDE) -> Tensor:
    """`side` x `side` offsets (a, b) that sweep a cell evenly, [side * side, 2] within (-1/2, 1/2)."""
    steps = (torch.arange(side, dtype=torch.float64) + 0.5) / side - 0.5
    return torch.cartesian_prod(steps, steps)


def sample_points(level: Level, pattern: Pattern, theta: Tensor, at: Tensor) -> tuple[Tensor, Tensor]:
    """Where fractional indices [M, 2] lie on the map: ([M, 2] map pixels, [M] in front of the camera)."""
    return project(level.map_from_plane(pattern, theta), pattern.points_at(at, theta))


def read_cells(level: Level, pattern: Pattern, theta: Tensor, index: Tensor, grid: Tensor) -> Cells:
    """The features of the cells around `index` [N, 2], at the offsets `grid` [K, 2]."""
    at = (index[:, None, :] + grid[None]).reshape(-1, 2)
    points, in_front = sample_points(level, pattern, theta, at)
    points = points.float()
    known = sample_valid(level.valid, points) & in_front
    values = sample(level.values, points) * known[:, None]
    shape = (len(index), len(grid))
    return Cells(values.reshape(*shape, -1), known.reshape(shape))


def members(index: Tensor, of: Tensor) -> Tensor:
    """Which rows of `index` [N, 2] stand in `of` [M, 2], [N] bool."""
    rows = {tuple(row) for row in of.tolist()}
    return torch.tensor([tuple(row) in rows for row in index.tolist()], dtype=torch.bool)


def agreement(a: Tensor, b: Tensor, known: Tensor) -> Tensor:
    """2 <a, b> / (|a|^2 + |b|^2) over the known samples: 1 equal, 0 unrelated; [..., K, C] -> [...].

    Unlike a correlation it falls, too, where one of the two is much fainter.
    """
    mask = known[..., None]
    inner = (a * b * mask).sum((-2, -1))
    energy = ((a * a + b * b) * mask).sum((-2, -1))
    return 2 * inner / energy.clamp(min=1e-6)


def mean_cell(cells: Cells, weights: Tensor) -> tuple[Tensor, Tensor]:
    """The weighted mean of the cells [K, C] and the weight [K] that each sample of it rests on."""
    weights = weights.to(cells.values)
    total = weights @ cells.known.to(weights)
    return _weighted_sum(cells.values, weights) / total.clamp(min=1e-6)[:, None], total


def mean_of_others(own: Tensor, known: Tensor, weights: Tensor) -> Tensor:
    """For each of `own` [N, ...] the weighted mean of all others, by sample.

    `known` says which samples count, in as many dimensions; `weights` [N]. 0 where no other is known: what is
    alone agrees with nothing.
    """
    weight = known * weights.to(own).reshape(-1, *[1] * (own.dim() - 1))
    total = weight.sum(0, keepdim=True)
    mean = (weight * own).sum(0, keepdim=True) / total.clamp(min=1e-6)
    rest = total - weight
    others = (mean * total - weight * own) / rest.clamp(min=1e-6)
    return torch.where(rest > _LEAST_WEIGHT, others, 0.0)


def agreement_with_others(cells: Cells, weights: Tensor) -> Tensor:
    """Each cell's agreement with the weighted mean of all the others, [N]."""
    return _with_others(cells, _over_channels(cells.values.square()), weights.to(cells.values))


def _with_others(cells: Cells, energy: Tensor, weights: Tensor) -> Tensor:
    """`agreement_with_others` of cells whose samples have this `energy` [N, K].

    The mean of all but one is the sum S of all less that one's share, over what is left of their weight, so
    that its products are those of S: nothing as large as the cells is made but the product with S.
    """
    own, known = weights[:, None], cells.known.to(weights)
    total = _weighted_sum(cells.values, weights)
    left = weights @ known - own * known
    share = torch.where(left > _LEAST_WEIGHT, 1 / left.clamp(min=_LEAST_WEIGHT), 0.0)
    crossed = _over_channels(cells.values * total)
    inner = (share * (crossed - own * energy)).sum(1)
    squared = _over_channels(total.square()) - 2 * own * crossed + own.square() * energy
    others = (known * share.square() * squared).sum(1)
    return 2 * inner / (energy.sum(1) + others).clamp(min=1e-6)


def _weighted_sum(values: Tensor, weights: Tensor) -> Tensor:
    """The sum over cells [N, K, C] by their weights [N]: [K, C]."""
    return (weights @ values.flatten(1)).reshape(values.shape[1:])


def _over_channels(values: Tensor) -> Tensor:
    """The sum over the last of [..., C] numbers, which are few: as a product it takes half of the time."""
    return values @ values.new_ones(values.shape[-1])


def contrast(
    level: Level,
    pattern: Pattern,
    theta: Tensor,
    index: Tensor,
    *,
    weights: Tensor,
    grid: Tensor,
    rounds: int = 2,
) -> Tensor:
    """How well each cell about `index` [N, 2] is predicted by the others: `contrast_of`."""
    # All in one reading: what a cell costs is little, what a call costs is not.
    steps = torch.cat([torch.zeros(1, 2, dtype=index.dtype), HALF_STEPS, -HALF_STEPS])
    every = read_cells(level, pattern, theta, (index[None] + steps[:, None]).reshape(-1, 2), grid)
    values = every.values.reshape(len(steps), len(index), *every.values.shape[1:])
    known = every.known.reshape(len(steps), len(index), -1)
    return contrast_of(Cells(values, known), weights=weights, rounds=rounds)


def contrast_of(cells: Cells, *, weights: Tensor, rounds: int) -> Tensor:
    """The contrast [N] of cells that were read whole and at half steps.

    It is each cell's agreement with the mean of all others, less the best that the mean reaches half a step
    away: what a pattern has, and a smooth or striped picture has not.

    Shapes: cells.values [1 + 2 * M, N, K, C] and known [1 + 2 * M, N, K]: the whole cells, then those M half
    steps ahead, then those behind. `weights` [N] start the mean; then the contrast itself weighs.
    """
    whole, weights = Cells(cells.values[0], cells.known[0]), weights.float()
    energy = _over_channels(cells.values.square())
    half, seen, own = cells.values[1:].flatten(2), cells.known[1:].to(weights), energy[1:].sum(-1)
    found = torch.zeros(half.shape[1])
    for _ in range(rounds):
        others = _with_others(whole, energy[0], weights)
        mean, _ = mean_cell(whole, weights)
        its = seen @ _over_channels(mean.square())
        at_half = (2 * (half @ mean.flatten()) / (own + its).clamp(min=1e-6)).unflatten(0, (2, -1))
        found = others - at_half.mean(0).amax(0).clamp(min=0)
        weights = found.clamp(min=0)
        if float(weights.sum()) <= 0:
            break
    return found

"""What the network learns from: holes cut into the photo's other cells, where the truth is known.

Most of them have the outline that is hidden in one of the cells to be painted, in place or shifted; the
others are whole cells and boxes. All are cut at once, as tensors on the network's device.
"""

from dataclasses import fields, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.paint.fill.npn.cells import Cells
from p3i.paint.fill.npn.network import Batch
from p3i.paint.fill.npn.stacks import Pool, stacks_of

# A cell can teach where so much of its own ground is known, and of its surroundings.
_LEAST_OWN, _LEAST_AROUND = 0.7, 0.4
# Of the lessons of a photo, so many have the outline that is to be painted; of these half stand as they do
# there.
_OWN = 0.6
_LEAST_PX = 12
# A step sees so many sources at most: the more, the slower, and a few teach as much.
_AT_MOST = 6
# So many lessons are cut at once.
_AT_ONCE = 16


def teachers(cells: Cells, pool: Pool) -> Tensor:
    """The places [T] in the pool whose cells can be learned from: all is known in them, and much around."""
    own = torch.from_numpy(cells.cell).to(cells.device)[None]
    known = pool.known[:, 0]
    inside = (known * own).sum((1, 2)) / own.sum()
    around = (known * ~own).sum((1, 2)) / (~own).sum().clamp(min=1)
    return ((inside >= _LEAST_OWN) & (around >= _LEAST_AROUND)).nonzero()[:, 0]


def lessons(
    cells: Cells, pool: Pool, places: Tensor, outlines: Tensor, *, count: int, seed: int
) -> list[Batch]:
    """About `count` lessons cut into the cells at these places of the pool, a list of batches.

    `outlines` [T, 1, h, w] are those of the holes to be painted; none, [0, 1, h, w], where there are none
    yet.
    """
    chance = torch.Generator().manual_seed(seed)
    if not len(places):
        return []
    turns = torch.cat(
        [torch.randperm(len(places), generator=chance) for _ in range(-(-count // len(places)))]
    )[:count]
    holes = torch.cat([_cut(cells, outlines, chance) for _ in range(count)])
    chosen = places.cpu()[turns]
    found: list[Batch] = []
    for start in range(0, count, _AT_ONCE):
        part = chosen[start : start + _AT_ONCE].to(cells.device)
        hidden = holes[start : start + _AT_ONCE].to(cells.device) * pool.known[part]
        batch, _, able = stacks_of(cells, pool, pool.numbers[part], hidden)
        able &= hidden.sum((1, 2, 3)) >= _LEAST_PX
        if able.any():
            found.append(part_of(batch, able.nonzero()[:, 0]))
    return found


def _cut(cells: Cells, outlines: Tensor, chance: torch.Generator) -> Tensor:
    """One hole [1, 1, h, w], on the CPU."""

    def draw(count: int) -> list[float]:
        return torch.rand(count, generator=chance).tolist()

    height, width = cells.cell.shape
    kind, which, shifted, across, down = draw(5)
    if len(outlines) and kind < _OWN:
        hole = outlines[int(which * len(outlines))][None].cpu()
        if shifted < 0.5:
            return hole
        reach = 0.25 * cells.pitch_px
        return _moved(hole, round((2 * across - 1) * reach), round((2 * down - 1) * reach))
    if kind > 0.85:
        return torch.from_numpy(cells.cell)[None, None].float()
    wide, high = (max(3, round((0.3 + 0.9 * side) * cells.pitch_px)) for side in (across, down))
    left, top = (
        round(at * side - size / 2)
        for at, side, size in zip(draw(2), (width, height), (wide, high), strict=True)
    )
    box = torch.zeros(1, 1, height, width)
    box[..., max(0, top) : max(0, top + high), max(0, left) : max(0, left + wide)] = 1
    return box


def _moved(hole: Tensor, across: int, down: int) -> Tensor:
    return F.pad(hole, (across, -across, down, -down))


def part_of(batch: Batch, places: Tensor) -> Batch:
    """Those of a batch's stacks at these places [T]."""
    return Batch(*(getattr(batch, one.name)[places] for one in fields(Batch)))


def varied(batch: Batch, generator: torch.Generator) -> Batch:
    """The batch as it might look in other light: turned over, colours swapped, gain and light changed.

    Sources are left out by chance, so that no single one is relied on. Chance comes from `generator` (CPU).
    """

    def draw(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator)

    flips = [axis for axis in (-1, -2) if float(draw(1)) < 0.5]
    turned = bool(draw(1) < 0.5)
    colours = torch.randperm(3, generator=generator)
    gain, light = 0.7 + 0.6 * float(draw(1)), 0.2 * float(draw(1)) - 0.1
    size, count = batch.weights.shape
    # Sampled without replacement, each by its weight (Gumbel's way); sources of weight 0 come last.
    noise = -torch.log(-torch.log(draw(size, count).clamp(1e-9, 1 - 1e-7)))
    liking = torch.log(batch.weights.cpu().clamp(min=1e-12)) + noise
    few = min(count, int(torch.randint(2, _AT_MOST + 1, (1,), generator=generator)))
    some = min(count, _AT_MOST) if float(draw(1)) < 0.7 else few
    used = liking.topk(some, dim=1).indices.to(batch.weights.device)
    weights = batch.weights.gather(1, used)
    weights = weights / weights.sum(1, keepdim=True)
    rows = torch.arange(size, device=used.device)[:, None]

    def view(values: Tensor) -> Tensor:
        values = values.flip(flips) if flips else values
        return values.transpose(-1, -2) if turned else values

    def coloured(values: Tensor, shift: float) -> Tensor:
        return view(values.index_select(-3, colours.to(values.device))) * gain + shift

    return replace(
        batch,
        target=coloured(batch.target, light),
        hole=view(batch.hole),
        context=view(batch.context),
        sources=coloured(batch.sources[rows, used], light),
        lift=coloured(batch.lift, 0.0),
        known=view(batch.known[rows, used]),
        weights=weights,
        asked=view(batch.asked),
    )

"""What the network learns from: holes cut into the photo's other cells, where the truth is known.

Most of them are the very hole that is to be painted, laid onto other cells; the others are boxes of 0.3 to
1.2 cells and whole cells. Cells that any hole touches are never the target of a lesson.
"""

import time

import numpy as np
import torch

from p3i.paint.fill.npn.network import Batch
from p3i.paint.fill.npn.window import Stack, Window, gather
from p3i.paint.fill.sources import Mask

# One in so many of the cells is kept to judge by.
_JUDGE = 6
# So many are tried to be cut however late it is.
_FEWEST = 12
# A step sees so many sources at most: the more, the slower, and a few teach as much.
_AT_MOST = 6


def lessons(
    window: Window, *, count: int, most: int, seed: int, until: float | None = None
) -> tuple[list[Stack], list[Stack]]:
    """Stacks to learn from and stacks to judge by, of different cells, with at most so many sources each.

    About `count` together; fewer, or none, where few cells are known, or where the clock (time.monotonic)
    says it is after `until`.
    """
    chance = np.random.default_rng(seed)
    known = [window.seen(view)[1] for view in window.views]
    able = [place for place in range(1, len(known)) if _teaches(window.hole, known[place])]
    if len(able) < 2:
        return [], []
    order = [able[place] for place in chance.permutation(len(able))]
    judges = set(order[: max(1, len(order) // _JUDGE)])
    learned: list[Stack] = []
    judged: list[Stack] = []
    for turn in range(2 * count):
        late = until is not None and turn >= _FEWEST and time.monotonic() > until
        if len(learned) + len(judged) >= count or late:
            break
        place = order[turn % len(order)]
        cut = known[place] & _cut(window, chance, own=turn < len(order) or bool(chance.random() < 0.6))
        found = gather(window, cut, window.views[place], most=most) if cut.sum() >= 4 else None
        if found is not None:
            (judged if place in judges else learned).append(found)
    if not learned:
        return judged, []
    return learned, judged


def _teaches(hole: Mask, known: Mask) -> bool:
    """Whether the truth under the hole [h, w] is known in a view, and some of its surroundings."""
    return bool(known[hole].mean() >= 0.98 and known[~hole].mean() >= 0.4)


def _cut(window: Window, chance: np.random.Generator, *, own: bool) -> Mask:
    """A hole [h, w] in another view: the true one, perhaps shifted; else a box."""
    hole, pitch = window.hole, window.pitch_px
    height, width = hole.shape
    if own:
        # Straight from the task itself; some shifted, that the network does not learn one outline by heart.
        if chance.random() < 0.5:
            return hole
        by = np.round(chance.uniform(-0.25, 0.25, 2) * pitch).astype(int)
        moved = np.zeros_like(hole)
        rows, columns = np.nonzero(hole)
        rows, columns = rows + by[0], columns + by[1]
        kept = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        moved[rows[kept], columns[kept]] = True
        return moved
    rows, columns = np.nonzero(hole)
    sides = np.maximum(2, np.round(chance.uniform(0.3, 1.2, 2) * pitch)).astype(int)
    middle = chance.integers(len(rows))
    top, left = rows[middle] - sides[0] // 2, columns[middle] - sides[1] // 2
    box = np.zeros_like(hole)
    box[max(0, top) : top + sides[0], max(0, left) : left + sides[1]] = True
    return box


def batch_of(stacks: list[Stack], *, device: torch.device) -> Batch:
    """Stacks of one size as one batch; those with fewer sources get places that hold none."""
    most = max(len(stack.weights) for stack in stacks)

    def planes(arrays: list[np.ndarray]) -> torch.Tensor:
        return torch.from_numpy(np.stack(arrays)).float().movedim(-1, -3).contiguous().to(device)

    def filled(array: np.ndarray) -> np.ndarray:
        missing = most - len(array)
        return np.concatenate([array, np.repeat(array[:1], missing, axis=0)]) if missing else array

    def silent(array: np.ndarray) -> np.ndarray:
        missing = np.zeros((most - len(array), *array.shape[1:]), array.dtype)
        return np.concatenate([array, missing])

    return Batch(
        planes([stack.target for stack in stacks]),
        planes([stack.hole[:, :, None] for stack in stacks]),
        planes([stack.context[:, :, None] for stack in stacks]),
        planes([filled(stack.sources) for stack in stacks]),
        planes([filled(stack.lifts) for stack in stacks]),
        planes([silent(stack.known)[..., None] for stack in stacks]),
        torch.from_numpy(np.stack([silent(stack.weights) for stack in stacks])).float().to(device),
    )


def varied(batch: Batch, generator: torch.Generator) -> Batch:
    """The batch as it might look in other light: turned over, colours swapped, gain and light changed.

    Sources are left out by chance, so that no single one is relied on. Chance comes from `generator` (CPU).
    """

    def draw(*shape: int) -> torch.Tensor:
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
    some = _AT_MOST if float(draw(1)) < 0.7 else few
    used = liking.topk(min(count, some), dim=1).indices.to(batch.weights.device)
    weights = batch.weights.gather(1, used)
    weights = weights / weights.sum(1, keepdim=True)
    rows = torch.arange(size, device=used.device)[:, None]

    def view(values: torch.Tensor) -> torch.Tensor:
        values = values.flip(flips) if flips else values
        return values.transpose(-1, -2) if turned else values

    def coloured(values: torch.Tensor, shift: float) -> torch.Tensor:
        return view(values.index_select(-3, colours.to(values.device))) * gain + shift

    return Batch(
        coloured(batch.target, light),
        view(batch.hole),
        view(batch.context),
        coloured(batch.sources[rows, used], light),
        coloured(batch.lifts[rows, used], 0.0),
        view(batch.known[rows, used]),
        weights,
    )

"""`paint`: the neural painting network from a photo and a hole to the filled photo."""

import time

import numpy as np
import torch

from p3i.errors import UsageError
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.filled import Filled, share_text
from p3i.paint.fill.ground import Floats, Ground, Mask
from p3i.paint.fill.npn import checkpoint
from p3i.paint.fill.npn.blend import blended
from p3i.paint.fill.npn.cells import Cells, cells_of, finer
from p3i.paint.fill.npn.compose import painted
from p3i.paint.fill.npn.judge import judged
from p3i.paint.fill.npn.lessons import lessons, teachers
from p3i.paint.fill.npn.network import PaintingNetwork
from p3i.paint.fill.npn.shipped import shipped
from p3i.paint.fill.npn.stacks import pool_of
from p3i.paint.fill.npn.tasks import Task, tasks_of
from p3i.paint.fill.npn.training import Progress, begun, train
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.threads import limited_threads

# So many lessons are cut into a photo.
_LESSONS = 64
# The rate of learning on a photo, that which the shipped weights began with.
_RATE = 2e-3
# Fewer objects than this are no pattern to learn from.
_FEWEST = 4


def paint(
    photo: Image,
    placed: Placed,
    hole: np.ndarray,
    options: NetworkOptions,
    *,
    progress: Progress | None = None,
) -> Filled:
    """The photo [H, W, 3] float32 with the hole (bool [H, W]) filled; pixels outside stay bit-identical.

    One network is trained on the photo, from the weights that p3i ships with, and paints every hidden cell.
    Copies of the hole on cells that it never learned from are filled by it and by the stack too, and tell how
    much of its fill is taken, the rest being the stack's; where that is nothing, or no copies can be made,
    the stack's fill stands, and `notes` and `fallback` tell. Pixels of the hole are never
    read. `progress` is told the step, of how many, and the latest mean L1 (0 to 255). Raises ValueError for a
    hole of another size, UsageError for a device that is not there, FileError for a checkpoint of another
    photo.
    """
    if hole.shape != photo.valid.shape or hole.dtype != np.bool_:
        raise ValueError(f"the hole is bool {photo.valid.shape}, not {hole.dtype} {hole.shape}")
    device = device_of(options.device)
    with limited_threads(options.threads):
        result, bare = fill_by_stack(photo.pixels, photo.valid, hole, placed)
        stack = Image(result.copy(), photo.valid & ~hole)
        outcome = _by_network(photo, stack, bare, placed, hole, options, device, progress)
    notes: list[str] = []
    if isinstance(outcome, str):
        left, why = hole & ~bare, outcome
    else:
        fill, by_it, share = outcome
        result[by_it] = fill
        left, why = hole & ~bare & ~by_it, "no other cell shows the like of it"
        notes.append(
            f"{share:.0%} of the say is the network's, the rest the stack's, as copies of the hole tell"
        )
    if of_hole := share_text(bare, hole):
        notes.append(f"for {of_hole} the program has nothing like it: the surroundings are continued")
    if of_hole := share_text(left, hole):
        notes.append(f"for {of_hole} {why}: the stack's fill stands")
    return Filled(result, bare, bare | left, tuple(notes))


def _by_network(
    photo: Image,
    stack: Image,
    bare: Mask,
    placed: Placed,
    hole: Mask,
    options: NetworkOptions,
    device: torch.device,
    progress: Progress | None,
) -> "tuple[Floats, Mask, float] | str":
    """What is painted over the stack's fill: colours [L, 3], where [H, W], the network's share (0..1) of
    them; or why nothing is.

    `stack` is the photo with that fill, where it is not valid.
    """
    too_few = "too few other cells show the like to learn from"
    if placed.in_sight().sum() < _FEWEST:
        return too_few
    seen = Image(stack.pixels, photo.valid)
    cells = cells_of(seen, placed, hole, bare, device=device)
    tasks = tasks_of(cells, placed, hole)
    if not tasks:
        return too_few
    numbers = torch.tensor([task.number for task in tasks], device=device)
    # What the stack filled is no lesson.
    certain = cells.without(hole)
    jury = judged(photo, placed, hole, certain, pool_of(certain, numbers), tasks, seed=options.seed)
    if jury is None:
        return too_few
    taught = certain.without(jury.hidden)
    network = _trained(photo, placed, taught, jury.numbers, tasks, options, device, progress)
    share = jury.share(network)
    if share == 0:
        return "the network is not surer than the stack on cells that it did not learn from"
    ground, fine = Ground.of(photo.pixels, photo.valid & ~hole), finer(cells, seen, hole, bare)
    filled, by_it = stack.pixels.copy(), np.zeros_like(hole)
    pool = pool_of(cells, numbers)
    for task, (colours, shown) in zip(tasks, painted(network, cells, fine, pool, ground, tasks), strict=True):
        columns, rows = task.points[shown].astype(int).T
        filled[rows, columns] = colours[shown]
        by_it[rows, columns] = True
    by_it &= ~bare
    return blended(stack.pixels, filled, by_it, share)[by_it], by_it, share


def _trained(
    photo: Image,
    placed: Placed,
    cells: Cells,
    kept: torch.Tensor,
    tasks: list[Task],
    options: NetworkOptions,
    device: torch.device,
    progress: Progress | None,
) -> PaintingNetwork:
    """The photo's network; the cells `kept` [J] to judge by are hidden in `cells`, and no lesson is cut
    there."""
    training = begun(seed=options.seed, device=device, rate=_RATE, weights=shipped())
    until = None if options.time_s is None else time.monotonic() + options.time_s
    path, save = options.checkpoint, None
    if path is not None:
        key = checkpoint.fingerprint(photo, placed, options)
        checkpoint.load(path, key, training)
        save = lambda state: checkpoint.save(path, key, state)  # noqa: E731
    if training.step < options.steps:
        numbers = torch.tensor([task.number for task in tasks], device=device)
        pool = pool_of(cells, numbers)
        able = teachers(cells, pool)
        able = able[~torch.isin(pool.numbers[able], kept)]
        outlines = torch.stack([task.outline for task in tasks])
        learned = lessons(cells, pool, able, outlines, count=_LESSONS, seed=options.seed)
        if learned:
            train(
                training,
                learned,
                steps=options.steps,
                seed=options.seed,
                until=until,
                save=save,
                progress=progress,
            )
    return training.mean


def device_of(name: str) -> torch.device:
    """The device of that name. Raises UsageError where there is none."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise UsageError(f"there is no device {name!r} to train on: say cpu or auto ({error})") from None
    return device

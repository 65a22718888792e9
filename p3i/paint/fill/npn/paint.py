"""`paint`: the neural painting network from a photo and a hole to the filled photo."""

import time
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import torch

from p3i.errors import UsageError
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.filled import Filled, share_text
from p3i.paint.fill.npn import checkpoint
from p3i.paint.fill.npn.lessons import batch_of, lessons
from p3i.paint.fill.npn.network import Painted, painted_all_ways, plain
from p3i.paint.fill.npn.training import EVERY, Progress, begun, train
from p3i.paint.fill.npn.window import gather, window_of
from p3i.paint.fill.sources import Floats, Ground, Mask
from p3i.paint.fill.stack import fill_by_stack, mixed
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.sheet import project
from p3i.vision.threads import limited_threads
from p3i.vision.warp import taken

# Of the change that held-out cells ask for, so much is made: they are few, and choose weights that suit them.
# Measured (docs/npn.md): all of it wins as often, but where it loses it loses twice as much.
_TAKEN = 0.5


def paint(
    photo: Image,
    placed: Placed,
    hole: np.ndarray,
    options: NetworkOptions,
    *,
    progress: Progress | None = None,
) -> Filled:
    """The photo [H, W, 3] float32 with the hole (bool [H, W]) filled; pixels outside stay bit-identical.

    The network starts from the stack's fill and adds what it has learned. Each part of the hole that hangs
    together is learned for on its own, with an equal share of the time; a part that too few other cells show
    stays as the stack fills it, and `notes` says so. Pixels of the hole are never read. `progress` is told
    the step, of how many, and the latest mean L1 (0 to 255). Raises ValueError for a hole of another size,
    UsageError for a device that is not there, FileError for a checkpoint of another photo and hole.
    """
    if hole.shape != photo.valid.shape or hole.dtype != np.bool_:
        raise ValueError(f"the hole is bool {photo.valid.shape}, not {hole.dtype} {hole.shape}")
    device = _device(options.device)
    result, bare = fill_by_stack(photo.pixels, photo.valid, hole, placed)
    untaught, useless = bare.copy(), np.zeros_like(hole)
    filled = Image(result.copy(), photo.valid & ~hole)
    key = checkpoint.fingerprint(photo, placed, hole, options) if options.checkpoint else ""
    begin = time.monotonic()
    count, labels = cv2.connectedComponents(hole.astype(np.uint8), connectivity=8)
    with limited_threads(options.threads):
        for place in range(1, count):
            part = labels == place
            until = None if options.time_s is None else begin + options.time_s * place / (count - 1)
            turn = _Turn(place, count - 1, key, until, device, progress)
            outcome = _change(filled, placed, part, options, turn)
            if isinstance(outcome, str):
                (untaught if outcome == "untaught" else useless)[part] = True
            else:
                result[part] = np.clip(result[part] + outcome, 0, 1)
    notes: list[str] = []
    if of_hole := share_text(bare, hole):
        notes.append(f"for {of_hole} the program has nothing like it: the surroundings are continued")
    if of_hole := share_text(untaught & ~bare, hole):
        notes.append(
            f"for {of_hole} too few other cells show the like to learn from: the stack's fill stands"
        )
    if of_hole := share_text(useless & ~bare, hole):
        notes.append(f"for {of_hole} the network learned nothing that helps: the stack's fill stands")
    return Filled(result, bare, untaught | useless, tuple(notes))


@dataclass(frozen=True, slots=True)
class _Turn:
    """Which part of the hole it is, of how many, the checkpoint's key, and the clock's end for it."""

    place: int
    parts: int
    key: str
    until: float | None
    device: torch.device
    progress: Progress | None

    def told(self, step: int, steps: int, error: float) -> None:
        if self.progress is not None:
            self.progress((self.place - 1) * steps + step, self.parts * steps, error)


def _change(
    filled: Image, placed: Placed, part: Mask, options: NetworkOptions, turn: _Turn
) -> "Floats | Literal['untaught', 'useless']":
    """What the network adds [L, 3] to the stack's fill of a part [H, W] of the hole, or why it adds nothing.

    `filled` is the photo with that fill, where it is not valid.
    """
    window = window_of(filled, placed, part, working_px=options.working_px)
    stack = gather(window, window.hole, window.views[0], most=options.sources)
    if stack is None:
        return "untaught"
    training = begun(seed=options.seed, device=turn.device)
    path = options.checkpoint
    if path is not None:
        checkpoint.load(path, turn.key, turn.place, training)
    # A training that ended between two judgements is judged at its end, each time it is read back.
    if options.steps > training.step or training.step % EVERY:
        # A third of the time for cutting lessons is much; a photo of few and small cells takes a second.
        now = time.monotonic()
        stop = None if turn.until is None else now + (turn.until - now) / 3
        learned, judged = lessons(
            window, count=options.examples, most=options.sources, seed=options.seed, until=stop
        )
        if not learned:
            return "untaught"
        train(
            training,
            learned,
            judged,
            steps=options.steps,
            seed=options.seed,
            adversarial=options.adversarial,
            until=turn.until,
            save=None if path is None else lambda state: checkpoint.save(path, turn.key, turn.place, state),
            progress=turn.told,
        )
    if not training.best_weights or training.best_share == 0:
        return "useless"
    training.mean.load_state_dict(training.best_weights)
    batch = batch_of([stack], device=turn.device)
    ground, found = Ground.of(filled.pixels, filled.valid), [window.on_photo(one) for one in stack.found]
    points = np.argwhere(part)[:, ::-1].astype(float)
    at, _ = project(np.linalg.inv(window.views[0]) @ window.from_photo, points)

    def composed(said: Painted) -> Floats:
        """What was said on the window's pixels, as colours [L, 3] of the photo's.

        Attention, membranes and correction are smooth enough to be magnified; the sources are read anew, so
        that detail finer than the window's is kept. Where none shows the ground there is nothing to tell of.
        """
        attention = np.stack([taken(plane, at) for plane in said.attention[0, :, 0].cpu().numpy()])
        smooth = (said.fill - (said.attention * batch.sources).sum(1))[0].movedim(0, -1).cpu().numpy()
        colours, weight = mixed(points, ground, found, attention, sharp=True)
        return np.where((weight > 1e-2)[:, None], colours + taken(np.ascontiguousarray(smooth), at), 0)

    before, after = composed(plain(batch)), composed(painted_all_ways(training.mean, batch))
    # A correction of one mean of the sources is no correction of another: where the stack's fill is farther
    # from the mean that the network started from than this was wrong on other cells, less of it is taken.
    apart = float(np.abs(np.clip(before, 0, 1) - filled.pixels[part]).mean())
    trust = _TAKEN * training.best_share * min(1.0, training.best_error / max(apart, 1e-6))
    return (trust * (after - before)).astype(np.float32)


def _device(name: str) -> torch.device:
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        raise UsageError(f"there is no device {name!r} to train on: say cpu or auto ({error})") from None
    return device

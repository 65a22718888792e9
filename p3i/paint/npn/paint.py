"""`paint`: the neural painting network from a photo and a hole to the filled photo."""

import time
from dataclasses import replace

import cv2
import numpy as np
import torch

from p3i.paint.npn import checkpoint
from p3i.paint.npn.gather import Stack, gather
from p3i.paint.npn.lessons import batch_of, lessons
from p3i.paint.npn.network import Painted, blend, plain_logits
from p3i.paint.npn.options import NetworkOptions
from p3i.paint.npn.training import Progress, Training, begun, threads, train
from p3i.paint.npn.window import Bank, Window, bank_of, project, step_px, window_of
from p3i.paint.placed import Placed
from p3i.vision.image import Image

# Photos larger than this many pixels are blended in parts.
_ROWS = 64


def paint(
    photo: Image,
    placed: Placed,
    hole: np.ndarray,
    options: NetworkOptions,
    *,
    progress: Progress | None = None,
) -> np.ndarray:
    """The photo [H, W, 3] float32 with the hole (bool [H, W]) filled; pixels outside stay bit-identical.

    Each part of the hole that hangs together is learned for on its own, with an equal share of the time. A
    part that no other cell shows is filled from its rim. Pixels of the hole are never read. Raises ValueError
    for a hole of another size, FileError for a checkpoint that is not of this photo and hole.
    """
    if hole.shape != photo.valid.shape or hole.dtype != np.bool_:
        raise ValueError(f"the hole is bool {photo.valid.shape}, not {hole.dtype} {hole.shape}")
    result = photo.pixels.copy()
    corrupted = replace(photo, valid=photo.valid & ~hole)
    key = checkpoint.fingerprint(photo, placed, hole, options) if options.checkpoint else ""
    begin = time.monotonic()
    count, labels = cv2.connectedComponents(hole.astype(np.uint8), connectivity=8)
    left_over = np.zeros_like(hole)
    with threads(options.threads):
        for place in range(1, count):
            part = labels == place
            until = None if options.time_s is None else begin + options.time_s * place / (count - 1)
            found = _painted(corrupted, placed, part, options, (place, key, until), progress)
            if found is None:
                left_over |= part
                continue
            colours, some = found
            rows, columns = np.nonzero(part)
            result[rows[some], columns[some]] = colours[some]
            left_over[rows[~some], columns[~some]] = True
    if left_over.any():
        result[left_over] = _from_rim(result, left_over)[left_over]
    return result


def _painted(
    photo: Image,
    placed: Placed,
    part: np.ndarray,
    options: NetworkOptions,
    turn: tuple[int, str, float | None],
    progress: Progress | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Colours [P, 3] of the pixels of one part of the hole, and which of them [P] any source shows."""
    place, key, until = turn
    window = window_of(placed, part, working_px=options.working_px)
    bank = bank_of(photo, placed, window)
    seen = _seen(part, window)
    stack = gather(bank, seen, most=options.sources)
    if stack is None:
        return None
    device = torch.device(options.device)
    training = begun(seed=options.seed, device=device)
    resumed = options.checkpoint is not None and checkpoint.load(options.checkpoint, key, place, training)
    if options.steps > training.step or resumed:
        learned, judged = lessons(bank, seen, count=options.examples, most=options.sources, seed=options.seed)
        if learned:
            keep = None
            if (path := options.checkpoint) is not None:

                def keep(state: Training) -> None:
                    checkpoint.save(path, key, place, state)

            train(
                training,
                learned,
                judged,
                steps=options.steps,
                seed=options.seed,
                adversarial=options.adversarial,
                until=until,
                save=keep,
                progress=progress,
            )
    return _composed(bank, stack, _said(training, stack, device), part)


def _seen(part: np.ndarray, window: Window) -> np.ndarray:
    """The hole on the window's pixels: all that it touches."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    wide = part.astype(np.float32)
    if window.scale < 1:
        reach = 2 * int(np.ceil(0.5 / window.scale)) + 1
        wide = cv2.dilate(wide, np.ones((reach, reach), np.uint8))
    return (
        cv2.warpPerspective(wide, window.photo_from_window, (window.width, window.height), flags=flags) > 0.01
    )


def _said(training: Training, stack: Stack, device: torch.device) -> Painted:
    """What the trained network says of a stack: the mean over its eight mirrorings, mixed by its share."""
    batch = batch_of([stack], device=device)
    plain = torch.softmax(plain_logits(batch), 1)
    share = training.best_share if training.best_weights else 0.0
    attention, strength = plain, torch.ones_like(batch.hole)
    correction = torch.zeros_like(batch.target)
    if share > 0:
        network = training.mean
        network.load_state_dict(training.best_weights)
        with torch.no_grad():
            said = network(batch)
        attention = plain + share * (said.attention - plain)
        strength = 1 + share * (said.strength - 1)
        correction = share * said.correction
    return Painted(attention, strength, correction, blend(batch, attention, strength, correction))


def _composed(bank: Bank, stack: Stack, said: Painted, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The photo's own pixels of one part, from what was said on the window's: sources read at full size."""
    window = bank.window
    rows, columns = np.nonzero(part)
    places = project(np.linalg.inv(window.photo_from_window), np.stack([columns, rows], 1).astype(float))

    core = places - [window.core[1].start, window.core[0].start]

    def lifted(values: torch.Tensor | np.ndarray) -> np.ndarray:
        """[C, h, w] read at the hole's pixels: [P, C]."""
        array = values.cpu().numpy() if isinstance(values, torch.Tensor) else values
        x, y = (np.ascontiguousarray(core[None, :, axis], np.float32) for axis in (0, 1))
        return np.concatenate(
            [_at(np.ascontiguousarray(plane), x, y)[0][:, None] for plane in array],
            axis=1,
        )

    attention = lifted(said.attention[0, :, 0])
    strength, correction = lifted(said.strength[0]), lifted(said.correction[0])
    total, weight = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for source, matrix in enumerate(stack.matrices):
        points = project(matrix, places)
        known = bank.pyramid.read_known(points)
        step = step_px(matrix, window) * window.scale
        colours = bank.pyramid.read(points, step_px=step, cubic=True)
        colours = colours * stack.gains[source] + stack.offsets[source]
        colours = colours + strength * lifted(np.moveaxis(stack.lifts[source], -1, 0))
        share = attention[:, source] * known
        total += share[:, None] * colours
        weight += share
    some = weight > 1e-4
    filled = total / np.maximum(weight, 1e-4)[:, None] + correction
    return np.clip(filled, 0, 1).astype(np.float32), some


def _at(plane: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """One plane [h, w] read at points [1, P] each; OpenCV takes fewer than 32768 at a time."""
    part = 30_000
    return np.concatenate(
        [
            cv2.remap(
                plane,
                x[:, at : at + part],
                y[:, at : at + part],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
            for at in range(0, x.shape[1], part)
        ],
        axis=1,
    )


def _from_rim(pixels: np.ndarray, hole: np.ndarray) -> np.ndarray:
    """What no cell shows, from what surrounds it (Telea 2004)."""
    eight = np.round(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    return cv2.inpaint(eight, hole.astype(np.uint8), 3, cv2.INPAINT_TELEA).astype(np.float32) / 255

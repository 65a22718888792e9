"""Where a cell differs from all others, and where all differ from one another: each cell beside its likest.

Each place of a cell is compared with the same place of other cells, in the cell's own light. What the few
likest of them leave is its difference: small where the pattern holds several kinds of cell (a chessboard, a
board with stones), large where nothing else is like it. At a place of the cell where that is large for most
cells (letters on keys, numbers on a clock) what a hole there would show is a guess; where it is large for one
cell only, that cell is marred there.

Convention: cells on a square grid about their objects, [N, side, side]; Lab, 0 to 100, is what is compared.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.paint.fill.sampled import sampled_cells
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.lab import lab_of

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# A cell is compared with so many others, nearest and farther ones; so many of the likest are passed over.
_MOST_OTHERS = 40
_LIKEST = 3
_FEWEST = 6
# A cell is judged where so much of it is seen; beside a hole so many cells, and so many others.
_LEAST_SEEN_OF_CELL = 0.3
_MOST_ASKED = 40
# Differences are those of places around, over this share of the distance between objects.
_AROUND = 0.04
# At a place where the cells differ by this share of the pattern's own contrast, what they show is no pattern.
_GUESS = 0.5
# Less than this no eye sees as a difference of things: some times what it just sees side by side.
_LEAST_SEEN = 6.0
# Deviations of logarithms are taken for no less than this.
_LEAST_DEVIATION = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Differing:
    """How the cells of a program differ on its photo; `step` is the grid's distance in program units.

    `bits` [N, side, side] float32 say how much likelier a place is another thing than one of the pattern, 0
    where that is not known, `difference` by how much it differs from the likest others, in Lab; `guess`
    [side, side] where cells differ from one another; `own` [side, side] how far inside its cell a place lies,
    in distances. `contrast` is that of what repeats, in Lab.
    """

    bits: Floats
    difference: Floats
    guess: Mask
    own: Array
    step: float
    contrast: float


def differing(placed: Placed, photo: Image, *, hole: Mask | None = None) -> Differing | None:
    """How the cells of a straight photo differ; None for too few.

    With a `hole` [H, W], which is not looked at, only cells that it takes a part of are told of, and no more
    others than it takes to know what is usual.
    """
    sampled = sampled_cells(placed, photo, hole=hole)
    # Every other place, of means over three: what is looked for is no finer.
    own, places, step = sampled.own[::2, ::2], sampled.places / 2, 2 * sampled.step
    seen = sampled.seen[:, ::2, ::2] & (own > 0)
    known = seen & ~sampled.hidden[:, ::2, ::2]
    judged = np.flatnonzero(known.sum((1, 2)) > _LEAST_SEEN_OF_CELL * (own > 0).sum())
    if len(judged) < _FEWEST:
        return None
    asked = np.arange(len(judged))
    if hole is not None:
        hidden = (seen & ~known)[judged].any((1, 2))
        asked = np.union1d(_evenly(np.flatnonzero(hidden)), _evenly(np.flatnonzero(~hidden)))
    colours = np.stack([lab_of(cv2.blur(sampled.cells[one], (3, 3))[::2, ::2]) for one in judged])
    known = known[judged]
    colours = _in_one_light(colours, known)
    others = _others(placed.points[judged], asked)
    least = _least_differences(colours, known, asked, others, places)
    usual, spread = _usual(least)
    tall = np.clip((np.log(np.maximum(least, 1e-3)) - usual) / spread, 0, None)
    bits = -torch.special.log_ndtr(torch.from_numpy(-tall)).numpy() / np.log(2)
    bits = np.where(np.isfinite(least) & (least > _LEAST_SEEN), bits, 0)
    found = np.zeros(seen.shape, np.float32)
    found[judged[asked]] = bits
    difference = np.zeros(seen.shape, np.float32)
    difference[judged[asked]] = np.nan_to_num(least)
    inner = own > 0
    contrast = float(np.linalg.norm(_median(colours, known)[inner].std(0)))
    typical = np.where(np.isfinite(usual), np.exp(usual), 0)
    guess = (typical > max(_GUESS * contrast, _LEAST_SEEN)) & inner
    return Differing(found, difference, guess, own, step, contrast)


def _median(colours: Floats, known: Mask) -> Floats:
    with np.errstate(all="ignore"):
        values = np.where(known[..., None], colours, np.nan)
        chosen = values[np.linspace(0, len(values) - 1, min(len(values), 60)).astype(int)]
        middle = np.ma.median(np.ma.masked_invalid(chosen), axis=0)
    return np.asarray(np.ma.filled(middle, 0), np.float32)


def _in_one_light(colours: Floats, known: Mask) -> Floats:
    """The cells [N, side, side, 3] less what most of their places differ by from the median cell."""
    middle = _median(colours, known)
    off = np.stack(
        [np.median((cell - middle)[where], axis=0) for cell, where in zip(colours, known, strict=True)]
    )
    return colours - off[:, None, None].astype(np.float32)


def _evenly(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Some of many, evenly."""
    return numbers[np.linspace(0, len(numbers) - 1, min(len(numbers), _MOST_ASKED)).astype(int)]


def _others(points: Array, asked: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each of the objects `asked` [n] the others that it is compared with, half the nearest: [n, K]."""
    count = len(points)
    most = min(_MOST_OTHERS, count - 1)
    found = np.empty((len(asked), most), np.int64)
    for number, point in enumerate(points[asked]):
        order = np.argsort(np.hypot(*(points - point).T), kind="stable")[1:]
        near = most - most // 2
        far = order[near:][np.linspace(0, len(order) - near - 1, most - near).astype(int)]
        found[number] = np.concatenate([order[:near], far])
    return found


def _least_differences(
    colours: Floats,
    known: Mask,
    asked: NDArray[np.int64],
    others: NDArray[np.int64],
    places: float,
) -> Floats:
    """What the likest others leave of each cell `asked` [n]: [n, side, side]; nan where not known."""
    sigma = max(0.8, _AROUND * places)
    result = np.full((len(asked), *known.shape[1:]), np.nan, np.float32)
    for place, (number, beside) in enumerate(zip(asked, others, strict=True)):
        apart = np.linalg.norm(colours[beside] - colours[number], axis=-1)
        both = (known[beside] & known[number]).astype(np.float32)
        stack = []
        for one, where in zip(apart * both, both, strict=True):
            weight = cv2.GaussianBlur(where, (0, 0), sigma)
            mean = cv2.GaussianBlur(one, (0, 0), sigma) / np.maximum(weight, 0.1)
            stack.append(np.where(weight > 0.5, mean, np.inf))
        rank = min(_LIKEST, len(stack)) - 1
        least = np.partition(np.stack(stack), rank, axis=0)[rank]
        result[place] = np.where(known[number] & np.isfinite(least), least, np.nan)
    return result


def _usual(least: Floats) -> tuple[Array, Array]:
    """The median of the differences' logarithms at each place, and their deviation: [side, side] each."""
    logs = np.ma.masked_invalid(np.log(np.maximum(least, 1e-3)))
    usual = np.ma.median(logs, axis=0)
    spread = 1.4826 * np.ma.median(np.ma.abs(logs - usual), axis=0)
    return (
        np.asarray(np.ma.filled(usual, np.inf), float),
        np.maximum(np.asarray(np.ma.filled(spread, 1.0), float), _LEAST_DEVIATION),
    )

"""The pieces of a hole: each hidden pixel belongs to the nearest object's cell, inside the pattern or
beyond it.

Of few cells a hole is one piece in the pattern and one beyond: what is seen around binds them together.

Convention: masks bool [H, W].
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.place.moves import nearest, nearest_px, pitch_px
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]

# Where cells are larger than this many pixels, only every so manyth pixel is asked whose it is.
_FINE = 24
_COARSEST = 8
# So many rows are asked at a time.
_STRIP = 256
# A hole of as many cells is one piece.
_FEW = 6.0
# Pixels so near to a hole have a piece too.
_NEAR_PX = 8
# The pattern reaches this many pixels beyond its cells' outlines.
_SLACK_PX = 1


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A part of a hole, seen from one object: what lies in its cell, or a small hole of its own.

    `number` is that of its pixels; `box` (left, top, right, bottom; half-open) holds them all. What lies
    `beyond` the pattern is like nothing of it, nor the other way round.
    """

    number: int
    target: int
    beyond: bool
    box: Box


def drawn_on(placed: Placed) -> NDArray[np.uint8]:
    """Where on the photo the pattern's cells lie, 1 [H, W]."""
    drawn = cells_on(placed, most_px=4 * max(placed.size.width, placed.size.height))
    return np.asarray(cv2.dilate(drawn, np.ones((2 * _SLACK_PX + 1,) * 2, np.uint8)), np.uint8)


def cells_on(placed: Placed, *, most_px: float) -> NDArray[np.uint8]:
    """Where on the photo the program's cells lie, 1 [H, W], but those with a corner beyond `most_px`."""
    drawn = np.zeros((placed.size.height, placed.size.width), np.uint8)
    pixels, front = project(placed.image_from_plane, polygons(chart_of(placed.pattern), placed.index))
    for outline in pixels[front.all(1) & (np.abs(pixels) < most_px).all((1, 2))]:
        # In sixteenths of a pixel, so that outlines are met as closely as pixels allow.
        cv2.fillPoly(drawn, [np.rint(outline * 16).astype(np.int32)], 1, shift=4)
    return drawn


def pieces_of(
    hole: Mask, drawn: NDArray[np.uint8], placed: Placed, *, few: float = _FEW
) -> tuple[list[Piece], NDArray[np.int32]]:
    """The pieces, and the number of each pixel's piece [H, W], in the hole and near it; else -1.

    What hangs together and is worth so `few` cells is one piece.
    """
    labels = np.full(hole.shape, -1, np.int32)
    count, parts, boxes, _ = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)
    pieces: list[Piece] = []
    for part in range(1, count):
        left, top, right, bottom = padded(boxes[part], hole.shape, by_px=_NEAR_PX)
        window = (slice(top, bottom), slice(left, right))
        inside = parts[window] == part
        found = 2 * _nearest_in((left, top, right, bottom), placed) + (drawn[window] == 0)
        kinds: dict[int, tuple[int, bool]] = {}
        # What lies in the pattern and what lies beyond it are unlike, however small the hole.
        for beyond in (0, 1):
            side = inside & (found % 2 == beyond)
            numbers, counts = np.unique(found[side], return_counts=True)
            if not len(numbers):
                continue
            if not beyond and _as_many(counts) <= few:
                target = _nearest_to_middle(side, (left, top), placed)
                found[found % 2 == beyond] = 2 * target + beyond
                numbers = [2 * target + beyond]
            kinds |= {int(number): (int(number) // 2, beyond == 1) for number in numbers}
        # What lies near two holes is the nearer's: of its own pixels, else of the first.
        given = inside | (labels[window] < 0)
        lasting = np.full(int(found.max()) + 1, -1, np.int32)
        for number, (target, beyond) in kinds.items():
            lasting[number] = len(pieces)
            pieces.append(Piece(len(pieces), target, beyond, (0, 0, 0, 0)))
        labels[window] = np.where(given, lasting[found], labels[window])
        extents = _boxes(np.where(inside, labels[window], -1), left, top)
        for number, box in extents.items():
            pieces[number] = replace(pieces[number], box=box)
    return pieces, labels


def _as_many(counts: NDArray) -> float:
    """How many cells of one size a hole is worth of so many pixels each: slivers count as slivers."""
    sizes = counts.astype(float)
    return float(sizes.sum() ** 2 / (sizes**2).sum())


def _nearest_to_middle(inside: Mask, corner: tuple[int, int], placed: Placed) -> int:
    """The object nearest to the middle of what is `inside` [h, w] of a window at `corner`."""
    rows, columns = np.nonzero(inside)
    middle = np.array([[corner[0] + columns.mean(), corner[1] + rows.mean()]])
    return int(nearest(placed, project(np.linalg.inv(placed.image_from_plane), middle)[0])[0])


def padded(box: NDArray, shape: tuple[int, ...], *, by_px: int) -> Box:
    """A box (x, y, width, height, ...) as OpenCV tells it, wider on each side within a picture [H, W]."""
    left, top, wide, high = (int(value) for value in box[:4])
    return (
        max(0, left - by_px), max(0, top - by_px),
        min(shape[1], left + wide + by_px), min(shape[0], top + high + by_px),
    )  # fmt: skip


def _nearest_in(box: Box, placed: Placed) -> NDArray[np.int32]:
    """The object nearest to each pixel of a box [h, w]; where cells are large, to a block of pixels."""
    left, top, right, bottom = box
    target = nearest_px(placed, np.array([(left + right) / 2, (top + bottom) / 2]))
    step = int(np.clip(pitch_px(placed, target) / _FINE, 1, _COARSEST))
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    x = left + np.arange(0, right - left, step) + (step - 1) / 2
    found = np.empty((bottom - top, right - left), np.int32)
    for start in range(top, bottom, _STRIP):
        stop = min(bottom, start + _STRIP)
        y = start + np.arange(0, stop - start, step) + (step - 1) / 2
        points = np.stack(np.meshgrid(x, y), -1)
        numbers = nearest(placed, project(plane_from_image, points.reshape(-1, 2))[0])
        blocks = numbers.reshape(points.shape[:2]).astype(np.int32)
        blocks = np.repeat(np.repeat(blocks, step, 0), step, 1)
        found[start - top : stop - top] = blocks[: stop - start, : right - left]
    return found


def _boxes(labels: NDArray[np.int32], left: int, top: int) -> dict[int, Box]:
    """The box of each number that is not below 0."""
    rows, columns = np.nonzero(labels >= 0)
    numbers = labels[rows, columns]
    order = np.argsort(numbers, kind="stable")
    rows, columns, numbers = rows[order], columns[order], numbers[order]
    starts = np.flatnonzero(np.r_[True, np.diff(numbers) > 0])
    low = [np.minimum.reduceat(at, starts) for at in (columns, rows)]
    high = [np.maximum.reduceat(at, starts) for at in (columns, rows)]
    return {
        int(number): (left + int(x0), top + int(y0), left + int(x1) + 1, top + int(y1) + 1)
        for number, x0, y0, x1, y1 in zip(numbers[starts], *low, *high, strict=True)
    }

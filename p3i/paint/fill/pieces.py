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
from p3i.vision.strips import strips_of, wider_by

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]
Labels = NDArray[np.int16] | NDArray[np.int32]
"""Of pieces: as large numbers as there are pieces."""

# Where cells are larger than this many pixels, only every so manyth pixel is asked whose it is.
_FINE = 24
_COARSEST = 8
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
) -> tuple[list[Piece], Labels]:
    """The pieces, and the number of each pixel's piece [H, W], in the hole and near it; else -1.

    What hangs together and is worth so `few` cells is one piece.
    """
    labels = np.full(hole.shape, -1, np.int16)
    count, parts, boxes, _ = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)
    pieces: list[Piece] = []
    for part in range(1, count):
        left, top, right, bottom = box = padded(boxes[part], hole.shape, by_px=_NEAR_PX)
        window = (slice(top, bottom), slice(left, right))
        inside = parts[window] == part
        found = _sides_in(box, drawn, placed)
        counts = _counts(found, inside)
        lasting = np.full(len(counts), -1, np.int32)
        # What lies in the pattern and what lies beyond it are unlike, however small the hole.
        for beyond in (0, 1):
            numbers = np.flatnonzero(counts[beyond::2]) * 2 + beyond
            if not len(numbers):
                continue
            if not beyond and _as_many(counts[numbers]) <= few:
                target = _nearest_to_middle(inside, found, (left, top), placed)
                lasting[beyond::2] = len(pieces)
                pieces.append(Piece(len(pieces), target, False, (0, 0, 0, 0)))
                continue
            for number in numbers.tolist():
                lasting[number] = len(pieces)
                pieces.append(Piece(len(pieces), number // 2, beyond == 1, (0, 0, 0, 0)))
        if len(pieces) > np.iinfo(labels.dtype).max:
            labels = labels.astype(np.int32)
        extents: dict[int, Box] = {}
        for rows in strips_of(len(found)):
            own, here = inside[rows], labels[window][rows]
            # What lies near two holes is the nearer's: of its own pixels, else of the first.
            np.copyto(here, lasting[found[rows]], where=own | (here < 0))
            _extend(extents, here, own, left, top + rows.start)
        for number, extent in extents.items():
            pieces[number] = replace(pieces[number], box=extent)
    return pieces, labels


def _counts(sides: NDArray[np.int32], inside: Mask) -> NDArray[np.int64]:
    """How many pixels `inside` [h, w] each number of a part [h, w] has."""
    counts = np.zeros(int(sides.max()) + 1, np.int64)
    for rows in strips_of(len(sides)):
        counts += np.bincount(sides[rows][inside[rows]], minlength=len(counts))
    return counts


def _as_many(counts: NDArray) -> float:
    """How many cells of one size a hole is worth of so many pixels each: slivers count as slivers."""
    sizes = counts.astype(float)
    return float(sizes.sum() ** 2 / (sizes**2).sum())


def _nearest_to_middle(
    inside: Mask, sides: NDArray[np.int32], corner: tuple[int, int], placed: Placed
) -> int:
    """The object nearest to the middle of what is `inside` [h, w] the pattern in a window at `corner`."""
    within = inside & (sides % 2 == 0)
    middle = [
        start + float(within.sum(1 - axis) @ np.arange(within.shape[axis])) / np.count_nonzero(within)
        for axis, start in ((1, corner[0]), (0, corner[1]))
    ]
    return int(nearest(placed, project(np.linalg.inv(placed.image_from_plane), np.array([middle]))[0])[0])


def padded(box: NDArray, shape: tuple[int, ...], *, by_px: int) -> Box:
    """A box (x, y, width, height, ...) as OpenCV tells it, wider on each side within a picture [H, W]."""
    left, top, wide, high = (int(value) for value in box[:4])
    rows, columns = wider_by((slice(top, top + high), slice(left, left + wide)), by_px, shape)
    return columns.start, rows.start, columns.stop, rows.stop


def _sides_in(box: Box, drawn: NDArray[np.uint8], placed: Placed) -> NDArray[np.int32]:
    """Of each pixel of a box [h, w] twice the number of the nearest object, and 1 more beyond the pattern.

    Where cells are large blocks of pixels are asked, not each.
    """
    left, top, right, bottom = box
    target = nearest_px(placed, np.array([(left + right) / 2, (top + bottom) / 2]))
    step = int(np.clip(pitch_px(placed, target) / _FINE, 1, _COARSEST))
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    x = left + np.arange(0, right - left, step) + (step - 1) / 2
    found = np.empty((bottom - top, right - left), np.int32)
    for rows in strips_of(bottom - top):
        y = top + rows.start + np.arange(0, rows.stop - rows.start, step) + (step - 1) / 2
        points = np.stack(np.meshgrid(x, y), -1)
        numbers = nearest(placed, project(plane_from_image, points.reshape(-1, 2))[0])
        blocks = 2 * numbers.reshape(points.shape[:2]).astype(np.int32)
        blocks = np.repeat(np.repeat(blocks, step, 0), step, 1)[: rows.stop - rows.start, : right - left]
        found[rows] = blocks + (drawn[top:bottom, left:right][rows] == 0)
    return found


def _extend(boxes: dict[int, Box], labels: Labels, inside: Mask, left: int, top: int) -> None:
    """Make the box of each number `inside` [h, w] hold its pixels of a strip at (left, top) too."""
    rows, columns = np.nonzero(inside & (labels >= 0))
    numbers = labels[rows, columns]
    order = np.argsort(numbers, kind="stable")
    rows, columns, numbers = rows[order], columns[order], numbers[order]
    starts = np.flatnonzero(np.diff(numbers, prepend=-1) > 0)
    low = [np.minimum.reduceat(at, starts) for at in (columns, rows)] if len(starts) else [[], []]
    high = [np.maximum.reduceat(at, starts) for at in (columns, rows)] if len(starts) else [[], []]
    for number, x0, y0, x1, y1 in zip(numbers[starts].tolist(), *low, *high, strict=True):
        box = (left + int(x0), top + int(y0), left + int(x1) + 1, top + int(y1) + 1)
        before = boxes.get(number, box)
        boxes[number] = (
            min(before[0], box[0]), min(before[1], box[1]), max(before[2], box[2]), max(before[3], box[3]),
        )  # fmt: skip

"""How a fill looks, beside how close it comes: is it as sharp as the pattern, and does its rim show?

Both compare the hole with what the program shows at the same places of other cells, so that neither asks
for the truth, and what is soft by itself may be soft.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W].
"""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.pieces import drawn_on, pieces_of
from p3i.place.moves import moves
from p3i.place.placed import Placed
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Each place is compared with so many of the nearest cells that show it, out of so many.
_COMPARED, _ASKED = 8, 40
# Of a hole and of its rim, about so many pixels are compared.
_MOST = 40_000
# A cell that is seen this much smaller cannot tell how sharp the pattern is.
_LEAST_SEEN = 0.7


def sharpness(filled: Floats, known: Mask, hole: Mask, placed: Placed) -> float:
    """The gradient energy in a filled hole over that of the pattern at the same places: 1 is as sharp.

    `filled` [H, W, 3] is the photo with its `hole` [H, W] filled, `known` [H, W] what is the photo's own. nan
    where no other cell shows the like.
    """
    energy = _energy(filled)
    within = cv2.erode(hole.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    whole = cv2.erode((known & ~hole).astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0) > 0
    got, wanted = 0.0, 0.0
    for points, others in _likened(within, whole, placed):
        columns, rows = points.astype(int).T
        for at, shown, area in others:
            got += float(energy[rows, columns][shown].sum())
            # Steps between pixels are as much smaller as the cell is larger there, and there are more of
            # them.
            wanted += float((taken(energy, at) * area)[shown].sum())
    return got / wanted if wanted > 0 else float("nan")


def seam(filled: Floats, known: Mask, hole: Mask, placed: Placed) -> float:
    """The mean step across a hole's [H, W] rim over that of the pattern at the same places: 1 shows no seam.

    Arguments and nan as for `sharpness`.
    """
    own = known & ~hole
    whole = cv2.erode(own.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0) > 0
    got, wanted = 0.0, 0.0
    for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        beside = np.roll(own, (-step[1], -step[0]), (0, 1))
        beside[{(1, 0): np.s_[:, -1], (-1, 0): np.s_[:, 0], (0, 1): np.s_[-1], (0, -1): np.s_[0]}[step]] = (
            False
        )
        for points, others in _likened(hole & beside, whole, placed, step=step):
            across = np.abs(taken(filled, points) - taken(filled, points + step)).mean(1)
            for at, shown, beyond in others:
                there = np.abs(taken(filled, at) - taken(filled, beyond)).mean(1)
                got += float(across[shown].sum())
                wanted += float(there[shown].sum())
    return got / wanted if wanted > 0 else float("nan")


def _energy(pixels: Floats) -> Floats:
    """The squared slopes of each pixel, of all channels: [H, W]."""
    found = np.zeros(pixels.shape[:2], np.float32)
    found[:, :-1] += (np.diff(pixels, axis=1) ** 2).sum(2)
    found[:-1] += (np.diff(pixels, axis=0) ** 2).sum(2)
    return found


def _likened(
    asked: Mask, whole: Mask, placed: Placed, *, step: tuple[int, int] = (0, 0)
) -> Iterator[tuple[Array, list[tuple[Array, Mask, Array]]]]:
    """The pixels that are asked about, cell by cell [L, 2], and where the same is seen in others.

    For each other cell: the places [L, 2], which of them lie on what is `whole`, and with a `step` where that
    leads to there [L, 2], without one how many pixels there are one here [L].
    """
    pieces, labels = pieces_of(asked, drawn_on(placed), placed, few=0)
    every = max(1, int(asked.sum()) // _MOST)
    centers, _ = placed.centers_px()
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    sure = whole.astype(np.float32)
    limits = np.array([placed.size.width, placed.size.height]) - 1
    for piece in pieces:
        left, top, right, bottom = piece.box
        here = (labels[top:bottom, left:right] == piece.number) & asked[top:bottom, left:right]
        points = (np.argwhere(here)[:, ::-1] + np.array([left, top])).astype(float)[::every]
        plane_moves = moves(placed, piece.target)
        away = np.hypot(*(centers - centers[piece.target]).T)
        usable = placed.in_sight() & np.isfinite(plane_moves).all((1, 2))
        usable[piece.target] = False
        others: list[tuple[Array, Mask, Array]] = []
        for number in [number for number in np.argsort(away, kind="stable") if usable[number]][:_ASKED]:
            matrix = placed.image_from_plane @ plane_moves[number] @ plane_from_image
            at, shown = project(matrix, points)
            shown = shown & ((at >= 0) & (at <= limits)).all(1)
            shown &= taken(sure, at) > 0.99
            beside, below = (project(matrix, points + move)[0] - at for move in ((1.0, 0.0), (0.0, 1.0)))
            area = np.abs(beside[:, 0] * below[:, 1] - beside[:, 1] * below[:, 0])
            shown &= area > _LEAST_SEEN**2
            if shown.any():
                others.append((at, shown, project(matrix, points + step)[0] if any(step) else area))
            if len(others) == _COMPARED:
                break
        yield points, others

"""The ground round a hole, and the same ground as every other cell shows it.

A window is a box of the photo, perhaps made smaller, so that the hole's own surroundings are not resampled
where they need not be. The window of another cell is the photo read through the move that lays the hole's
cell onto that one: alike in size, turn and perspective.

Convention: window pixels have their centres at whole numbers; a window s times the photo's size has its
pixel u at the photo's (u + 0.5) / s - 0.5 + corner. Arrays of pixels are float32 [h, w, 3] in 0..1.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch

from p3i.place.moves import moves, pitch_px
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.image import Image, resized
from p3i.vision.sheet import project as project_with_front
from p3i.vision.warp import pixel_grid, taken

# So much of the hole's surroundings is looked at, in distances between cells.
_MARGIN = 0.6
# No window has a longer side than this.
_MOST_PX = 112
# The network itself sees less: so much round the hole.
_CORE_MARGIN = 0.2
# Colours are carried so far into what is unknown.
_SOFT_PX = 8
# So many cells are looked at, the nearest first.
_MOST_CELLS = 160


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A box round one hole: `photo_from_window` [3, 3], its `width` and `height`, `scale` (window px a photo
    px), the object `anchor` whose cell the hole lies in, `pitch`, the window px between two objects, and
    `core`, the rows and columns that the network sees: those of the hole and a little more."""

    photo_from_window: np.ndarray
    width: int
    height: int
    scale: float
    anchor: int
    pitch: float
    core: tuple[slice, slice]


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """One window as each of M cells shows it.

    `cells` [M] their objects, the hole's own first; `photo_from_window` [M, 3, 3]; `pixels` [M, h, w, 3];
    `known` bool [M, h, w]; `home` bool [M, h, w], where an object is near: beyond the pattern's end none is.
    """

    window: Window
    pyramid: "Pyramid"
    cells: np.ndarray
    photo_from_window: np.ndarray
    pixels: np.ndarray
    known: np.ndarray
    home: np.ndarray


class Pyramid:
    """A photo at halved sizes, to be read at points without aliasing. `known` True where it is evidence."""

    def __init__(self, photo: Image) -> None:
        # Unknown pixels take the colour of their surroundings, or cubic reading would ring beside them.
        pixels = photo.pixels
        if not photo.valid.all():
            pixels = pixels.copy()
            rows, columns = np.nonzero(~photo.valid)
            box = (
                slice(max(0, rows.min() - _SOFT_PX), rows.max() + _SOFT_PX + 1),
                slice(max(0, columns.min() - _SOFT_PX), columns.max() + _SOFT_PX + 1),
            )
            valid = photo.valid[box]
            soft = valid.astype(np.float32)
            weight = cv2.GaussianBlur(soft, (0, 0), 2.0)[:, :, None]
            mean = cv2.GaussianBlur(pixels[box] * soft[:, :, None], (0, 0), 2.0) / np.maximum(weight, 1e-3)
            pixels[box][~valid] = mean[~valid]
        self.known = cv2.erode(
            photo.valid.astype(np.uint8), np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE
        ).astype(np.float32)
        self._levels = [pixels]
        full = Image(pixels, np.ones(pixels.shape[:2], bool))
        while full.size.longer / 2 ** len(self._levels) >= 64 and len(self._levels) < 8:
            self._levels.append(resized(full, max(1, full.size.longer // 2 ** len(self._levels))).pixels)

    @property
    def full(self) -> np.ndarray:
        """The photo itself, unknown pixels smoothed over."""
        return self._levels[0]

    def read(self, points: np.ndarray, *, step_px: float = 1.0, cubic: bool = False) -> np.ndarray:
        """The colours [..., 3] at points [..., 2] of the photo that lie `step_px` apart from each other."""
        level = int(np.clip(round(np.log2(max(step_px, 1.0))), 0, len(self._levels) - 1))
        pixels = self._levels[level]
        shrink = self._levels[0].shape[1] / pixels.shape[1], self._levels[0].shape[0] / pixels.shape[0]
        places = (points + 0.5) / np.array(shrink) - 0.5
        return _read(pixels, places, sharp=cubic)

    def read_known(self, points: np.ndarray) -> np.ndarray:
        """Which points [..., 2] of the photo are read from evidence alone."""
        height, width = self.known.shape
        x, y = points[..., 0], points[..., 1]
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
        return inside & (_read(self.known, points) > 0.99)


def _read(pixels: np.ndarray, points: np.ndarray, *, sharp: bool = False) -> np.ndarray:
    """A picture read at points [..., 2]; those that have no place read any pixel."""
    flat = np.clip(np.nan_to_num(points, nan=-1e4), -1e4, 1e6).reshape(-1, 2)
    return taken(pixels, flat, sharp=sharp).reshape(*points.shape[:-1], *pixels.shape[2:])


def project(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points [..., 2] through a homography; nan for those at or behind the camera."""
    at, front = project_with_front(matrix, points)
    return np.where(front[..., None], at, np.nan)


def grid(width: int, height: int) -> np.ndarray:
    """The pixel centres [height, width, 2] of a window."""
    return pixel_grid(Size(width, height), dtype=torch.float64).numpy()


def window_of(placed: Placed, hole: np.ndarray, *, working_px: int) -> Window:
    """The window round a hole (bool [H, W]) in which cells are at most `working_px` wide."""
    rows, columns = np.nonzero(hole)
    middle = np.array([columns.mean(), rows.mean()])
    pixels, front = placed.centers_px()
    anchor = int(np.argmin(np.where(front, np.hypot(*(pixels - middle).T), np.inf)))
    pitch = pitch_px(placed, anchor)
    margin = max(6, round(_MARGIN * pitch))
    height, width = hole.shape
    top, left = max(0, rows.min() - margin), max(0, columns.min() - margin)
    bottom, right = min(height, rows.max() + margin + 1), min(width, columns.max() + margin + 1)
    scale = min(1.0, working_px / pitch, _MOST_PX / max(bottom - top, right - left))
    matrix = np.array(
        [[1 / scale, 0, 0.5 / scale - 0.5 + left], [0, 1 / scale, 0.5 / scale - 0.5 + top], [0, 0, 1.0]]
    )
    size = max(8, round((right - left) * scale)), max(8, round((bottom - top) * scale))
    core = max(4.0, _CORE_MARGIN * pitch * scale)
    spans = [
        slice(
            max(0, int((first - corner) * scale - core)),
            min(side, int((last - corner + 1) * scale + core) + 1),
        )
        for first, last, corner, side in (
            (rows.min(), rows.max(), top, size[1]),
            (columns.min(), columns.max(), left, size[0]),
        )
    ]
    return Window(matrix, *size, scale, anchor, pitch * scale, (spans[0], spans[1]))


def bank_of(pyramid: Pyramid, placed: Placed, window: Window) -> Bank:
    """The window as every cell in sight shows it, as far as the photo of the pyramid is evidence."""
    image_from_plane = placed.image_from_plane
    plane_from_image = np.linalg.inv(image_from_plane)
    laid = moves(placed, window.anchor)
    centers, _ = placed.centers_px()
    seen = placed.in_sight() & np.isfinite(laid).all((1, 2))
    seen[window.anchor] = False
    apart = np.hypot(*(centers - centers[window.anchor]).T)
    order = [int(cell) for cell in np.argsort(apart, kind="stable") if seen[cell]][: _MOST_CELLS - 1]
    cells = np.array([window.anchor, *order])
    matrices = np.array(
        [image_from_plane @ laid[cell] @ plane_from_image @ window.photo_from_window for cell in cells]
    )
    points = grid(window.width, window.height)
    near = _reach(placed)
    pixels = np.empty((len(cells), window.height, window.width, 3), np.float32)
    known, home = (np.zeros(pixels.shape[:3], bool) for _ in range(2))
    plane = project(plane_from_image @ window.photo_from_window, points)
    for place, (cell, matrix) in enumerate(zip(cells, matrices, strict=True)):
        places = project(matrix, points)
        pixels[place] = pyramid.read(places, step_px=step_px(matrix, window), cubic=True)
        known[place] = pyramid.read_known(places)
        home[place] = _near_object(placed, project(laid[cell], plane[::4, ::4]), near)[
            : window.height, : window.width
        ]
    return Bank(window, pyramid, cells, matrices, np.clip(pixels, 0, 1), known, home)


def step_px(matrix: np.ndarray, window: Window) -> float:
    """How far two neighbouring pixels amid a window lie apart on the photo, the geometric mean."""
    middle = np.array([window.width / 2, window.height / 2])
    corner, right, down = project(matrix, middle + np.array([[0, 0], [1, 0], [0, 1]]))
    return float(np.sqrt(abs(np.linalg.det(np.array([right - corner, down - corner])))))


def _reach(placed: Placed) -> float:
    """Three quarters of the least distance between objects: farther from all of them nothing is drawn."""
    if len(placed.points) < 2:
        return np.inf
    some = placed.points[:: max(1, len(placed.points) // 500)]
    squares = ((some[:, None] - placed.points[None]) ** 2).sum(2)
    return 0.75 * float(np.sqrt(np.partition(squares, 1, axis=1)[:, 1].min()))


def _near_object(placed: Placed, points: np.ndarray, reach: float) -> np.ndarray:
    """Where an object is near, for every fourth point [h, w, 2]; repeated to four times the size."""
    flat = np.nan_to_num(points.reshape(-1, 2), nan=1e9)
    # Only objects near the window can count; large programs would cost much otherwise.
    low, high = flat.min(0) - reach, flat.max(0) + reach
    centers = placed.points[((placed.points >= low) & (placed.points <= high)).all(1)]
    near = np.zeros(len(flat), bool)
    if len(centers):
        squares = (flat**2).sum(1)[:, None] - 2 * flat @ centers.T + (centers**2).sum(1)[None]
        near = squares.min(1) <= reach**2
    return near.reshape(points.shape[:2]).repeat(4, axis=0).repeat(4, axis=1)

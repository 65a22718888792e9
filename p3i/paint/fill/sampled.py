"""The cells of all objects of a photo, laid onto one another by the program's own frames (place/moves.py).

Convention: a cell is sampled on a square grid about its object, `SIDE` x `SIDE` places, `step` program units
apart; RGB in 0..1.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.place.moves import frames
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

SIDE = 65
"""Places of the grid along a side."""

REACH = 0.75
"""The grid reaches this far from the object, in distances between objects."""


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """A picture float32 [H, W, 3] and its halves, so that it can be read where it is shrunk."""

    pictures: tuple[Floats, ...]

    @classmethod
    def of(cls, pixels: Floats) -> "Levels":
        """The picture down to a side of about 32 pixels."""
        found = [pixels]
        while min(found[-1].shape[:2]) >= 64:
            found.append(np.asarray(cv2.pyrDown(found[-1]), np.float32))
        return cls(tuple(found))

    def read(self, at: NDArray, shrink: float) -> Floats:
        """The colours [K, 3] at pixels [K, 2], read `shrink` pixels apart."""
        level = int(np.clip(np.round(np.log2(max(shrink, 1e-6)) + 0.2), 0, len(self.pictures) - 1))
        return taken(
            self.pictures[level], np.asarray(at, float) / 2**level, sharp=level == 0 and shrink < 0.8
        )


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """The cells of all objects as the photo has them: `cells` [M, side, side, 3], `seen` [M, side, side].

    `hidden` [M, side, side] is what a hole takes of them, wholly or at its edge. `own` [side, side] is how
    far inside its own cell a place lies, in distances, `step` that of places in program units, `places` how
    many there are from an object to the next.
    """

    cells: Floats
    seen: Mask
    hidden: Mask
    own: Array
    step: float
    places: float


def sampled_cells(placed: Placed, photo: Image, *, hole: Mask | None = None) -> Sampled:
    """The cells of all objects of a straight photo, and what a `hole` [H, W] takes of them."""
    spacing = pitch(chart_of(placed.pattern))
    half = (SIDE - 1) // 2
    step = REACH * spacing / half
    line = (np.arange(SIDE) - half) * step
    local = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2).astype(np.float64)
    maps = frames(placed)
    height, width = photo.valid.shape
    values = np.zeros((len(maps), len(local), 3), np.float32)
    seen, hidden = np.zeros((2, len(maps), len(local)), bool)
    valid = photo.valid.astype(np.float32)
    # Cells are read with what is beside each place.
    wide = None if hole is None else cv2.dilate(hole.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    levels = Levels.of(photo.pixels)
    for number, frame in enumerate(maps):
        at, front = project(placed.image_from_plane, local @ frame[:2, :2].T + frame[:2, 2])
        inside = front & (at >= 0).all(1) & (at[:, 0] <= width - 1) & (at[:, 1] <= height - 1)
        apart = np.hypot(*np.diff(at.reshape(SIDE, SIDE, 2)[SIDE // 2], axis=0).T)
        shrink = float(np.median(apart))
        at = np.where(inside[:, None], at, 0)
        x, y = at.astype(np.float32).T.reshape(2, 1, -1)
        values[number] = levels.read(np.stack([x[0], y[0]], 1), shrink)
        seen[number] = inside & (cv2.remap(valid, x, y, cv2.INTER_LINEAR)[0] > 0.99)
        if wide is not None:
            columns, rows = np.rint(at).astype(int).T
            hidden[number] = inside & wide[rows, columns]
    shape = (len(maps), SIDE, SIDE)
    own = _own_ground(placed, local, spacing)
    return Sampled(
        values.reshape(*shape, 3), seen.reshape(shape), hidden.reshape(shape), own, step, spacing / step
    )


def _own_ground(placed: Placed, local: Array, spacing: float) -> Array:
    """How far inside its own cell each place [K] lies, in distances to the next object: [side, side].

    The border is half way to the nearest other objects, drawn or not drawn, of an object in the middle.
    """
    chosen = np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T))
    frame = frames(placed)[chosen]
    points = local @ frame[:2, :2].T + frame[:2, 2]
    index = placed.index[chosen]
    near = index + np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2]), -1).reshape(-1, 2)
    others = np.concatenate([placed.at(near), placed.points])
    middle = placed.points[chosen]
    others = others[np.hypot(*(others - middle).T) > 0.3 * spacing]
    inside = np.full(len(points), np.inf)
    for other in others:
        away = other - middle
        length = float(np.hypot(*away))
        inside = np.minimum(inside, length / 2 - (points - middle) @ away / length)
    # Single rows have no neighbours across: there the cell is as wide as it is long.
    inside = np.minimum(inside, 0.5 * spacing * 1.2 - np.hypot(*(points - middle).T) * 0.8)
    return (inside / spacing).reshape(SIDE, SIDE)

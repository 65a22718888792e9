"""The square grid that a cell is sampled on, about its object, and the same with its ring laid straight.

What goes round with a ring, the rim of a disc or a circle of marks, is a straight line on the straight grid.

Convention: layers [side, side] or [side, side, C], places `step` program units apart, x to the right, y down;
on rings the upright points outwards (place/moves.py).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Polar
from p3i.interp.unroll import nest
from p3i.place.moves import frames, ring_radii
from p3i.place.placed import Placed

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """The way from a grid to its straight one and back: None of either where nothing is bent.

    `directions` [D, 2] are those of the pattern's steps, and of the diagonals of its cells, on the straight
    grid; on rings round and outwards.
    """

    there: Floats | None
    back: Floats | None
    directions: Array

    @classmethod
    def of(cls, placed: Placed, *, side: int, step: float) -> "Straight":
        """The straight grid of a program's cells."""
        if not isinstance(nest(placed.pattern.program).draw.x, Polar):
            return cls(None, None, _steps(placed))
        radius = float(np.median(ring_radii(placed))) / step
        half = (side - 1) / 2
        directions = np.array([(1.0, 0), (0, 1)])
        if radius <= half:  # the cell holds the ring's middle: nothing is straight there
            return cls(None, None, directions)
        y, x = (np.mgrid[:side, :side] - half).astype(float)
        there = (radius - y) * np.sin(x / radius), radius - (radius - y) * np.cos(x / radius)
        back = radius * np.arctan2(x, radius - y), radius - np.hypot(x, radius - y)
        there, back = (np.stack(each, -1).astype(np.float32) + np.float32(half) for each in (there, back))
        return cls(there, back, directions)

    def laid(self, layer: Floats) -> Floats:
        """A layer of the grid on the straight one."""
        return _read(layer, self.there)

    def bent(self, layer: Floats) -> Floats:
        """A layer of the straight grid on the grid."""
        return _read(layer, self.back)


def _read(layer: Floats, at: Floats | None) -> Floats:
    if at is None:
        return layer
    return np.asarray(
        cv2.remap(layer, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),  # pyright: ignore[reportCallIssue, reportArgumentType]
        np.float32,
    )


def _steps(placed: Placed) -> Array:
    """The steps of a lattice about its middle object and the diagonals between them, as its cell has them."""
    chosen = np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T))
    middle = placed.index[chosen].astype(float)
    turn = frames(placed)[chosen][:2, :2]
    steps = (placed.at(middle + np.eye(2)) - placed.at(middle[None])) @ turn
    steps = steps[np.hypot(*steps.T) > 1e-6]
    if not len(steps):
        return np.array([(1.0, 0), (0, 1)])
    if len(steps) == 1:
        steps = np.concatenate([steps, [(-steps[0][1], steps[0][0])]])
    return np.concatenate([steps, [steps[0] + steps[1], steps[0] - steps[1]]])

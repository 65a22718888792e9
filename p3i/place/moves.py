"""The cells of a program on its photo: whose ground a point is, and how one cell is laid onto another.

Any program splits its plane by its centres (Voronoi, as in the paper's supplement). One cell lies on another
by a translation in a lattice; on rings by a rotation, and by a scale where the rings differ in radius.

Convention: program units, arrays of float64; objects are counted as in `Placed`.
"""

import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Affine, Polar
from p3i.interp.unroll import nest
from p3i.place.placed import Placed

Array = NDArray[np.float64]

# Points are compared with the centres in parts of so many distances.
_PART = 4_000_000
# Two rings whose radii differ by more than this factor show nothing alike.
_MOST_SCALED = 4.0


def nearest(placed: Placed, points: Array) -> NDArray[np.int64]:
    """The cell that each of the points [K, 2] lies in: the number [K] of the nearest object."""
    part = max(1, _PART // max(1, len(placed.points)))
    centers = placed.points
    squares = (centers**2).sum(1)
    found = []
    for start in range(0, len(points), part):
        away = points[start : start + part] @ (-2 * centers.T)
        away += squares
        found.append(np.argmin(away, axis=1))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def moves(placed: Placed, target: int) -> Array:
    """The maps of the plane [M, 3, 3] that lay the cell of object `target` onto that of each object.

    A map of nan stands where none does: between rings that differ too much in radius.
    """
    turns, sizes = _turns_rad(placed), ring_radii(placed)
    scale = sizes / sizes[target] if sizes[target] > 0 else np.ones(len(sizes))
    turn = turns - turns[target]
    found = np.tile(np.eye(3), (len(turns), 1, 1))
    found[:, 0, 0] = found[:, 1, 1] = scale * np.cos(turn)
    found[:, 1, 0] = scale * np.sin(turn)
    found[:, 0, 1] = -found[:, 1, 0]
    found[:, :2, 2] = placed.points - np.einsum("mij,j->mi", found[:, :2, :2], placed.points[target])
    found[(scale > _MOST_SCALED) | (scale < 1 / _MOST_SCALED)] = np.nan
    return found


def frames(placed: Placed) -> Array:
    """The maps [M, 3, 3] that lay the plane about the origin, as it stands, upon each object.

    Nothing turns in a lattice; on rings the upright points outwards, as at the top of a clock.
    """
    turns = _turns_rad(placed)
    if isinstance(nest(placed.pattern.program).draw.x, Polar):
        turns = turns + np.pi / 2
    found = np.tile(np.eye(3), (len(turns), 1, 1))
    found[:, 0, 0] = found[:, 1, 1] = np.cos(turns)
    found[:, 1, 0] = np.sin(turns)
    found[:, 0, 1] = -found[:, 1, 0]
    found[:, :2, 2] = placed.points
    return found


def nearest_px(placed: Placed, pixel: Array) -> int:
    """The object in front of the camera that lies nearest to a pixel [2] of the photo."""
    pixels, front = placed.centers_px()
    return int(np.argmin(np.where(front, np.hypot(*(pixels - pixel).T), np.inf)))


def pitch_px(placed: Placed, target: int) -> float:
    """How far the nearest other object lies from object `target` on the photo, in pixels, at least 2."""
    pixels, front = placed.centers_px()
    apart = np.hypot(*(pixels - pixels[target]).T)
    others = apart[front & (apart > 0.5)]
    return max(2.0, float(others.min())) if len(others) else 2.0


def ring_radii(placed: Placed) -> Array:
    """The radius of the ring that each object [M] lies on; 1 in a lattice."""
    draw = nest(placed.pattern.program).draw
    if not isinstance(draw.x, Polar):
        return np.ones(len(placed.index))
    return np.abs(_values(draw.x.radius, placed.index))


def _turns_rad(placed: Placed) -> Array:
    """How far each object [M] is turned about its ring's centre; nothing turns in a lattice."""
    draw = nest(placed.pattern.program).draw
    if not isinstance(draw.x, Polar):
        return np.zeros(len(placed.index))
    quarter = 0 if draw.x.function == "Cos" else -np.pi / 2
    return np.radians(_values(draw.x.angle, placed.index)) + quarter


def _values(form: Affine, index: NDArray[np.int64]) -> Array:
    return form.i * index[:, 0] + form.j * index[:, 1] + form.constant

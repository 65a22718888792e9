"""Where else on the photo the same is to be seen: a hole's sources, laid upon it by the program.

A source is the ground of another object, brought over by the program's own move (place/moves.py). Around the
hole source and photo show the same, so there the source is shifted by the little that the program is off
(Lucas and Kanade, IJCAI 1981), its light is matched, and its misfit tells how far to believe it inside.

Convention: points are pixels of the photo [L, 2]; colours RGB in 0..1.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.matching import aligned
from p3i.place.moves import moves, nearest, pitch_px
from p3i.place.placed import Placed
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# The surroundings that a hole is judged by reach this far, in distances to the next object.
_MARGIN = 0.4
_MOST_SURROUNDING = 3000
# The nearer to the hole, the more a place tells: weights fall to 1/e over this share of the margin.
_FADING = 0.4
# So many of the nearest objects are tried, and so many of the best kept, ...
MOST_TRIED = 80
_MOST_KEPT = 12
# ... none with a misfit above this many times the best's; a source shows this much of hole and surroundings.
_WORSE = 1.6
_WORSE_ANYWAY = 0.002
_LEAST_OF_HOLE, _LEAST_AROUND = 0.25, 0.25
# Of a hole, about this many pixels tell how much of it a source shows.
_MOST_ASKED = 100_000
# A source lies on drawn ground where an object is as near as this, in distances; so must this share of it.
_GROUND = 0.75
_LEAST_ON_GROUND = 0.6
_PROBES = 400
# Shifts reach this far, in distances to the next object.
_MOST_SHIFT = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class Hole:
    """One piece of what is to be filled, seen from the object `target` in its middle.

    `points` [L, 2] are its pixels; `around` [K, 2] pixels beside it, with `weights` [K] by nearness and the
    `colours` [K, 3] that the photo has there. `spacing_px` is how far the next object lies.
    """

    target: int
    points: Array
    around: Array
    weights: Floats
    colours: Floats
    spacing_px: float


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A source of a hole: the photo's matrix `from_hole` [3, 3] and `shift_px` [2] take a pixel to its like.

    `gain` and `offset` [3] bring its colours to the hole's light; `misfit` is the mean difference around.
    """

    from_hole: Array
    shift_px: Array
    gain: Array
    offset: Array
    misfit: float

    def where(self, points: Array) -> tuple[Array, Mask]:
        """The points [L, 2] like these, and which lie in front of the camera."""
        at, front = project(self.from_hole, points)
        return at + self.shift_px, front


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A photo with its hole as a place to take colours from: `pixels` [H, W, 3], `sure` float [H, W]."""

    pixels: Floats
    sure: Floats

    @classmethod
    def of(cls, pixels: Floats, known: Mask) -> "Ground":
        """What is known, and one pixel away from what is not, since samples mix neighbours."""
        padded = np.pad(known.astype(np.uint8), 1)
        return cls(pixels, cv2.erode(padded, np.ones((3, 3), np.uint8))[1:-1, 1:-1].astype(np.float32))

    def known(self, points: Array) -> Mask:
        """Which of the points [L, 2] can be read."""
        height, width = self.sure.shape
        x, y = points[:, 0], points[:, 1]
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        return inside & (taken(self.sure, points) > 0.99)


def hole_of(points: Array, shown: Floats, known: Mask, placed: Placed) -> Hole:
    """A piece of the hole, its pixels [L, 2], with its surroundings: what is `known` [H, W] of `shown`."""
    pixels, front = placed.centers_px()
    away = np.hypot(*(pixels - points.mean(0)).T)
    target = int(np.argmin(np.where(front, away, np.inf)))
    spacing = pitch_px(placed, target)
    margin = max(4, round(_MARGIN * spacing))
    low = np.maximum(points.min(0).astype(int) - margin, 0)
    high = points.max(0).astype(int) + margin + 1
    free = known[low[1] : high[1], low[0] : high[0]]
    outside = np.ones(free.shape, np.uint8)
    columns, rows = (points.astype(int) - low).T
    outside[rows, columns] = 0
    distance = cv2.distanceTransform(outside, cv2.DIST_L2, 5)
    near_rows, near_columns = np.nonzero((distance <= margin) & free)
    spread = np.linspace(0, len(near_rows) - 1, min(len(near_rows), _MOST_SURROUNDING)).astype(int)
    near_rows, near_columns = near_rows[spread], near_columns[spread]
    weights = np.exp(-distance[near_rows, near_columns] / (_FADING * margin)).astype(np.float32)
    around = np.stack([near_columns, near_rows], 1) + low
    colours = shown[around[:, 1], around[:, 0]]
    return Hole(target, points, around.astype(float), weights, colours, spacing)


def sources(
    hole: Hole, ground: Ground, placed: Placed, *, most: int = MOST_TRIED, kept: int = _MOST_KEPT
) -> list[Source]:
    """The sources of a hole among the `most` nearest objects, the likest first, so many as are `kept`.

    There are none where the program draws nothing like it in sight.
    """
    if not len(hole.around):
        return []
    found = [_aligned(hole, ground, matrix) for matrix in laid_on(hole, ground, placed, most=most)]
    alike = sorted((one for one in found if one is not None), key=lambda source: source.misfit)
    return [one for one in alike if one.misfit <= _WORSE * alike[0].misfit + _WORSE_ANYWAY][:kept]


def shown_elsewhere(hole: Hole, ground: Ground, placed: Placed, *, most: int = MOST_TRIED) -> Mask:
    """Which of a hole's pixels [L] the photo knows on the ground of one of the `most` nearest objects."""
    shown = np.zeros(len(hole.points), bool)
    for matrix in laid_on(hole, ground, placed, most=most):
        at, front = project(matrix, hole.points)
        shown |= front & ground.known(at)
        if shown.all():
            break
    return shown


def laid_on(hole: Hole, ground: Ground, placed: Placed, *, most: int) -> Iterator[Array]:
    """The photo's matrices [3, 3] that take the hole to its like on other drawn ground, the nearest first."""
    pixels, _ = placed.centers_px()
    away = np.hypot(*(pixels - pixels[hole.target]).T)
    plane_moves = moves(placed, hole.target)
    usable = placed.in_sight() & np.isfinite(plane_moves).all((1, 2))
    usable[hole.target] = False
    # What is itself to be filled in its middle comes last: around a picture that grows there is much of it.
    order = np.lexsort((away, ~ground.known(pixels)))
    tried = [number for number in order if usable[number]][:most]
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    probes = hole.points[:: max(1, len(hole.points) // _PROBES)]
    probes, _ = project(plane_from_image, probes)
    spacing = _spacing(placed, hole.target)
    drawn = _apart(placed, probes) <= _GROUND * spacing
    for number in tried:
        moved, _ = project(plane_moves[number], probes)
        scale = np.sqrt(abs(np.linalg.det(plane_moves[number][:2, :2])))
        on_ground = _apart(placed, moved) <= _GROUND * spacing * scale
        if (on_ground | ~drawn).mean() < _LEAST_ON_GROUND:
            continue
        yield placed.image_from_plane @ plane_moves[number] @ plane_from_image


def _aligned(hole: Hole, ground: Ground, from_hole: Array) -> Source | None:
    """The source under this matrix, shifted and in the hole's light; None where too little of it shows."""
    at, front = project(from_hole, hole.points[:: max(1, len(hole.points) // _MOST_ASKED)])
    if (front & ground.known(at)).mean() < _LEAST_OF_HOLE:
        return None
    at, front = project(from_hole, hole.around)
    weights = hole.weights * (front & ground.known(at))
    if (weights > 0).mean() < _LEAST_AROUND:
        return None

    def read(shift: Array) -> Floats:
        return taken(ground.pixels, at + shift)

    most_px = _MOST_SHIFT * hole.spacing_px
    return Source(from_hole, *aligned(read, hole.colours, weights=weights, most_px=most_px))


def _spacing(placed: Placed, target: int) -> float:
    """How far the next object lies on the plane, in program units."""
    apart = np.hypot(*(placed.points - placed.points[target]).T)
    apart[target] = np.inf
    return float(apart.min()) if len(apart) > 1 else np.inf


def _apart(placed: Placed, points: Array) -> Array:
    """How far the nearest object lies from points [K, 2] of the plane: [K]."""
    return np.hypot(*(points - placed.points[nearest(placed, points)]).T)

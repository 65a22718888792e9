"""Where the cells of an annotated pattern lie on its photo, for lattices and for rings.

Convention: a cell (i, j) is the square [i - 1/2, i + 1/2] x [j - 1/2, j + 1/2] of cell coordinates; i and j
count steps u and v in a lattice; on a ring j counts slots round it, i is 0, and 1/2 half a cell outwards.
Points of the photo are pixels, (x, y).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

from p3i.evaluation.truth import Ring, Truth
from p3i.size import Size
from p3i.vision.sheet import project

_SIDE_POINTS = 24
_CONCENTRIC = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The cells with a marked object that the photo shows, of a lattice or of one ring.

    `plane_of` takes cell coordinates [K, 2] to the plane, `image_from_plane` [3, 3] the plane to pixels.
    `turn` is the number of slots round a ring, None in a lattice.
    """

    size: Size
    image_from_plane: np.ndarray
    plane_of: Callable[[np.ndarray], np.ndarray]
    cells: tuple[tuple[int, int], ...]
    turn: int | None = None

    def pixels(self, places: np.ndarray) -> np.ndarray:
        """Cell coordinates [K, 2] in pixels [K, 2]; nan where they lie behind the camera."""
        pixels, front = project(self.image_from_plane, self.plane_of(np.asarray(places, float)))
        return np.where(front[:, None], pixels, np.nan)

    def centers(self) -> np.ndarray:
        """The marked objects in pixels [K, 2]."""
        return self.pixels(np.array(self.cells))

    def outline(self, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
        """The rectangle of cell coordinates between two corners, in pixels [K, 2]; its sides may be bent."""
        (a, b), (c, d) = low, high
        corners = np.array([(a, b), (c, b), (c, d), (a, d), (a, b)])
        share = np.arange(_SIDE_POINTS)[:, None] / _SIDE_POINTS
        sides = [first + share * (last - first) for first, last in pairwise(corners)]
        return self.pixels(np.concatenate(sides))

    def about(self, center: Sequence[float], width: float, height: float) -> np.ndarray:
        """The outline of width x height cells about a place."""
        half = np.array([width, height]) / 2
        return self.outline(tuple(np.asarray(center) - half), tuple(np.asarray(center) + half))

    def mask(self) -> np.ndarray:
        """All cells, bool [H, W]."""
        found = np.zeros((self.size.height, self.size.width), bool)
        for cell in self.cells:
            found |= drawn(self.about(cell, 1, 1), self.size)
        return found


def drawn(outline: np.ndarray, size: Size) -> np.ndarray:
    """What an outline [K, 2] encloses, bool [H, W]; nothing where a part of it lies behind the camera."""
    found = np.zeros((size.height, size.width), np.uint8)
    if np.isfinite(outline).all() and np.abs(outline).max() < 1e5:
        # In sixteenths of a pixel, so that the outline is met as closely as pixels allow.
        cv2.fillPoly(found, [np.rint(outline * 16).astype(np.int32)], (1,), shift=4)
    return found > 0


def grounds(entry: Mapping[str, Any], truth: Truth) -> tuple[Ground, ...]:
    """The lattice, or each of the rings, of an annotation `entry` and the `truth` read from it."""
    image_from_plane = truth.camera.image_from_plane(truth.size).numpy() @ np.diag(
        [1 / truth.size.unit_px, 1 / truth.size.unit_px, 1]
    )
    plane_from_image = np.linalg.inv(image_from_plane)
    hidden = set(entry.get("hidden") or ())
    if truth.lattice is not None:
        base, basis = truth.lattice
        seen = np.array([point for k, point in enumerate(entry["centers"]) if k not in hidden], float)
        steps = (project(plane_from_image, seen)[0] - base) @ np.linalg.inv(basis)
        cells = sorted({(int(i), int(j)) for i, j in np.rint(steps)})
        return (Ground(truth.size, image_from_plane, lambda at: base + at @ basis, tuple(cells)),)
    told, first = [], 0
    for ring, said in zip(truth.rings, entry["rings"], strict=True):
        # A scene's `hidden` counts the objects of all its rings in one row.
        own = [point for k, point in enumerate(said["centers"], first) if k not in hidden]
        first += len(said["centers"])
        if own:
            points = project(plane_from_image, np.array(own, float))[0]
            told.append((ring, (points - ring.center) @ np.linalg.inv(ring.plane_from_circle).T))
    return tuple(
        _ring(truth.size, image_from_plane, ring, circle, [other for other in told if other[0] is not ring])
        for ring, circle in told
    )


def _ring(
    size: Size,
    image_from_plane: np.ndarray,
    ring: Ring,
    circle: np.ndarray,
    others: Sequence[tuple[Ring, np.ndarray]],
) -> Ground:
    """The ground of a ring from its objects [K, 2] where it is a circle about the origin."""
    radius = float(np.linalg.norm(circle, axis=1).mean())
    angles = np.arctan2(circle[:, 1], circle[:, 0])
    step = 2 * np.pi / ring.count
    slots = {round(float(angle - angles[0]) / step) % ring.count for angle in angles}
    # A cell is as wide across the ring as it is long, as far as the next ring about the same middle allows.
    width = min(
        [step]
        + [
            abs(float(np.linalg.norm(places, axis=1).mean()) / radius - 1)
            for other, places in others
            if np.linalg.norm(other.center - ring.center)
            < _CONCENTRIC * np.linalg.norm(ring.plane_from_circle @ (radius, 0))
        ]
    )

    def plane_of(at: np.ndarray) -> np.ndarray:
        around = angles[0] + step * at[:, 1]
        out = radius * (1 + width * at[:, 0])
        return ring.center + np.c_[out * np.cos(around), out * np.sin(around)] @ ring.plane_from_circle.T

    return Ground(size, image_from_plane, plane_of, tuple((0, slot) for slot in sorted(slots)), ring.count)

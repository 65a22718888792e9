"""Outlines cut off: before the camera, and at the edge of the photo.

Convention: polygons are corners [K, 2] in order, not closed; one that vanishes is [0, 2].
"""

import numpy as np

from p3i.size import Size

_NEAR = 0.02
"""Cells are cut off where they come closer to the camera than this share of the distance to the plane."""


def cut_before_camera(polygon: np.ndarray, image_from_plane: np.ndarray) -> np.ndarray:
    """The part of a polygon of the plane that lies in front of the camera."""
    depth = polygon @ image_from_plane[2, :2] + image_from_plane[2, 2]
    return _kept(polygon, depth - _NEAR * image_from_plane[2, 2])


def clipped_to_canvas(polygon: np.ndarray, size: Size) -> np.ndarray:
    """The part of a polygon (pixels) that lies on the photo, out to the edge of its outermost pixels."""
    for axis, last in ((0, size.width - 1), (1, size.height - 1)):
        polygon = _kept(polygon, polygon[:, axis] + 0.5)
        polygon = _kept(polygon, last + 0.5 - polygon[:, axis])
    return polygon if len(polygon) >= 3 and area(polygon) > 1e-6 else np.zeros((0, 2))


def without_straight_corners(polygon: np.ndarray) -> np.ndarray:
    """The polygon [K, 2] without the corners at which it does not turn."""
    before, after = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
    turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    turning = turn > 1e-9 * lengths
    return polygon[turning] if turning.sum() >= 3 else polygon


def area(polygon: np.ndarray) -> float:
    """The area of a polygon [K, 2], 0 for fewer than three corners."""
    x, y = np.asarray(polygon, float).reshape(-1, 2).T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


def _kept(polygon: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """The part of a polygon where a linear function, `inside` [K] at its corners, is >= 0."""
    if (inside >= 0).all():
        return polygon
    corners = []
    for here, after, value, following in zip(
        polygon, np.roll(polygon, -1, axis=0), inside, np.roll(inside, -1), strict=True
    ):
        if value >= 0:
            corners.append(here)
        if (value >= 0) != (following >= 0):
            corners.append(here + value / (value - following) * (after - here))
    return np.array(corners).reshape(-1, 2)

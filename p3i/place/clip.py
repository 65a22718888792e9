"""Lines and outlines cut off by half-planes: before the camera, and at the edge of the photo.

Convention: polygons are corners [K, 2] in order, not closed; one that vanishes is [0, 2].
"""

import numpy as np

from p3i.size import Size

_NEAR = 0.02
"""Cells are cut off where they come closer to the camera than this share of the distance to the plane."""


def cut_before_camera(polygon: np.ndarray, image_from_plane: np.ndarray) -> np.ndarray:
    """The part of a polygon [K, 2] of the plane that lies in front of the camera of a homography [3, 3]."""
    depth = polygon @ image_from_plane[2, :2] + image_from_plane[2, 2]
    return cut_polygon(polygon, depth - _NEAR * image_from_plane[2, 2])


def clipped_to_canvas(polygon: np.ndarray, size: Size) -> np.ndarray:
    """The part of a polygon [K, 2] (pixels) that lies on the photo, out to its outermost pixels' edge."""
    for axis, last in ((0, size.width - 1), (1, size.height - 1)):
        polygon = cut_polygon(polygon, polygon[:, axis] + 0.5)
        polygon = cut_polygon(polygon, last + 0.5 - polygon[:, axis])
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


def cut(segments: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The parts of segments [S, 2, D] where a linear function is >= 0, and which have such a part [S].

    `inside` [S, 2] is the function at their ends; it must be finite for a part to be kept.
    """
    kept = np.asarray((inside >= 0).any(axis=1) & np.isfinite(inside).all(axis=1))
    segments, inside = segments[kept], inside[kept]
    first, second = inside[:, :1], inside[:, 1:]
    gap = np.where(first == second, 1, first - second)
    crossing = segments[:, 0] + (first / gap) * (segments[:, 1] - segments[:, 0])
    ends = [np.where(inside[:, end : end + 1] >= 0, segments[:, end], crossing) for end in (0, 1)]
    return np.stack(ends, axis=1), kept


def cut_polygon(polygon: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """The part of a polygon [K, 2] where a linear function, `inside` [K] at its corners, is >= 0."""
    if (inside >= 0).all():
        return polygon
    values = np.stack([inside, np.roll(inside, -1)], axis=1)
    sides, kept = cut(np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1), values)
    # Each side that is left begins with a corner; one that leaves the half-plane ends with another.
    leaving = values[kept][:, 1] < 0
    corners = np.repeat(sides[:, 0], 1 + leaving, axis=0)
    corners[np.cumsum(1 + leaving)[leaving] - 1] = sides[leaving, 1]
    return corners.reshape(-1, 2)

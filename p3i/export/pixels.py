"""Pixels as other programs count them.

p3i: pixel centres at whole numbers, so the photo covers -0.5 to width - 0.5. Here: pixel edges at whole
numbers, so it covers 0 to width. That is how COCO's polygons and boxes, YOLO, labelme and QuPath count.
"""

import numpy as np

from p3i.place.clip import clipped_to_canvas
from p3i.place.objects import Polygon
from p3i.size import Size


def to_edges(polygon: Polygon) -> list[list[float]]:
    """The corners with pixel edges at whole numbers."""
    return [[round(x + 0.5, 3), round(y + 0.5, 3)] for x, y in polygon]


def on_photo(polygon: Polygon, size: Size) -> np.ndarray:
    """The part of a polygon that the photo shows [K, 2], centres at whole numbers; empty without area."""
    return clipped_to_canvas(np.array(polygon, float).reshape(-1, 2), size)


def within(corners: np.ndarray, size: Size) -> list[list[float]]:
    """Corners [K, 2] on the photo with pixel edges at whole numbers, none rounded beyond its edge."""
    edges = to_edges(tuple(map(tuple, corners.tolist())))
    return [[min(max(x, 0.0), size.width), min(max(y, 0.0), size.height)] for x, y in edges]


def box_of(polygon: list[list[float]]) -> tuple[float, float, float, float]:
    """Left, top, width and height of the upright box around a polygon."""
    x, y = zip(*polygon, strict=True)
    return min(x), min(y), round(max(x) - min(x), 3), round(max(y) - min(y), 3)

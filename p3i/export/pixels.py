"""Pixels as other programs count them.

p3i: pixel centres at whole numbers, so the photo covers -0.5 to width - 0.5. Here: pixel edges at whole
numbers, so it covers 0 to width. That is how COCO's polygons and boxes, labelme and QuPath count.
"""

from p3i.place.objects import Polygon
from p3i.size import Size


def to_edges(polygon: Polygon) -> list[list[float]]:
    """The corners with pixel edges at whole numbers."""
    return [[round(x + 0.5, 3), round(y + 0.5, 3)] for x, y in polygon]


def within(polygon: list[list[float]], size: Size) -> list[list[float]]:
    """The corners, no rounding left of which could stick out of the photo."""
    return [[min(max(x, 0.0), size.width), min(max(y, 0.0), size.height)] for x, y in polygon]

"""YOLO labels: a line an object, `class x_center y_center width height`, as shares of the photo's sides.

Convention: 0 and 1 are the edges of the photo. The one class is 0; its name stands in the data set's own
file. The box is that of the cell, cut off at the photo's edge.
"""

from p3i.export.pixels import box_of, on_photo, within
from p3i.grammar.printer import number_text
from p3i.place.objects import Objects

_DIGITS = 8
"""To less than 1/1000 pixel of the widest photos."""


def yolo(found: Objects) -> str:
    """`found` as a label file; objects without any area on the photo are left out."""
    width, height = found.size.width, found.size.height
    lines = []
    for each in found.objects:
        corners = on_photo(each.cell_px, found.size)
        if not len(corners):
            continue
        left, top, wide, high = box_of(within(corners, found.size))
        shares = ((left + wide / 2) / width, (top + high / 2) / height, wide / width, high / height)
        lines.append(" ".join(["0", *(number_text(round(share, _DIGITS)) for share in shares)]) + "\n")
    return "".join(lines)

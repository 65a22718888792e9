"""labelme: each cell as a polygon and each middle as a point, of one group, the name in the description.

Convention: pixel edges at whole numbers, as labelme draws. The photo itself is not in the file: it is looked
for beside it, under the name that `imagePath` gives.
"""

from typing import Any

from p3i.export.pixels import to_edges
from p3i.place.objects import Objects


def labelme(found: Objects) -> dict[str, Any]:
    """`found` as a labelme file."""
    shapes = []
    for number, each in enumerate(found.objects, start=1):
        parts = [("point", [[round(each.x_px + 0.5, 3), round(each.y_px + 0.5, 3)]])]
        if each.cell_px:
            parts.insert(0, ("polygon", to_edges(each.cell_px)))
        flags = {} if each.presence is None else {"there": each.presence >= 0.5}
        shapes += [
            {
                "label": found.label,
                "points": points,
                "group_id": number,
                "description": each.name,
                "shape_type": kind,
                "flags": flags,
                "mask": None,
            }
            for kind, points in parts
        ]
    return {
        "version": "5.5.0",
        "flags": {},
        "imagePath": found.image or "",
        "imageData": None,
        "imageHeight": found.size.height,
        "imageWidth": found.size.width,
        "shapes": shapes,
    }

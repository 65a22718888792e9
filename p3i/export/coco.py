"""COCO instances: one annotation an object, its cell as the segmentation, its middle as a keypoint.

Convention: polygons, boxes and areas count pixel edges at whole numbers, the keypoint counts pixel centres at
whole numbers, as COCO's own files and tools do. Cells are cut off at the photo's edge.
"""

from typing import Any

from p3i.export.pixels import box_of, on_photo, within
from p3i.place.clip import area
from p3i.place.objects import Objects


def coco(found: Objects) -> dict[str, Any]:
    """`found` as a COCO dataset of one picture; objects without any area on the photo are left out."""
    annotations = []
    for each in found.objects:
        corners = on_photo(each.cell_px, found.size)
        if not len(corners):
            continue
        polygon = within(corners, found.size)
        annotations.append(
            {
                "id": len(annotations) + 1,
                "image_id": 1,
                "category_id": 1,
                "segmentation": [[value for corner in polygon for value in corner]],
                "bbox": list(box_of(polygon)),
                "area": round(area(corners), 3),
                "iscrowd": 0,
                "keypoints": [each.x_px, each.y_px, 2] if each.inside else [0, 0, 0],
                "num_keypoints": int(each.inside),
                "attributes": {
                    "name": each.name,
                    "row": each.row + 1,
                    "column": each.column + 1,
                    "i": each.i,
                    "j": each.j,
                    "presence": each.presence,
                },
            }
        )
    picture = {
        "id": 1,
        "file_name": found.image or "",
        "width": found.size.width,
        "height": found.size.height,
    }
    category = {"id": 1, "name": found.label, "supercategory": "", "keypoints": ["center"], "skeleton": []}
    return {
        "info": {"description": "objects of a p3i program", "version": "1.0"},
        "licenses": [],
        "images": [picture],
        "categories": [category],
        "annotations": annotations,
    }

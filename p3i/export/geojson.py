"""GeoJSON in pixels: each cell as a polygon, its middle and the rest as properties.

Convention: x right, y down, pixel edges at whole numbers, as QuPath and rasterio's pixel windows count; rings
are closed, and counterclockwise in the sense of RFC 7946 (as if y pointed up).
"""

from typing import Any

from p3i.export.pixels import to_edges
from p3i.place.objects import Objects


def geojson(found: Objects) -> dict[str, Any]:
    """`found` as a FeatureCollection; an object whose cell vanishes has a point instead."""
    return {"type": "FeatureCollection", "features": [_feature(found, k) for k in range(len(found.objects))]}


def _feature(found: Objects, number: int) -> dict[str, Any]:
    each = found.objects[number]
    middle = [round(each.x_px + 0.5, 3), round(each.y_px + 0.5, 3)]
    if each.cell_px:
        ring = to_edges(each.cell_px)
        turn = sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(ring, ring[1:] + ring[:1], strict=True))
        ring = ring if turn > 0 else ring[::-1]
        geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    else:
        geometry = {"type": "Point", "coordinates": middle}
    return {
        "type": "Feature",
        "id": each.name,
        "geometry": geometry,
        "properties": {
            "objectType": "annotation",
            "classification": {"name": found.label},
            "name": each.name,
            "row": each.row + 1,
            "column": each.column + 1,
            "i": each.i,
            "j": each.j,
            "center": middle,
            "presence": each.presence,
        },
    }

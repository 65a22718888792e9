"""A list of objects as the bytes of a file, format by format."""

import csv
import io
import json
from collections.abc import Callable
from typing import Any

from p3i.errors import UsageError
from p3i.export.coco import coco
from p3i.export.dxf import dxf
from p3i.export.geojson import geojson
from p3i.export.labelme import labelme
from p3i.export.svg import svg
from p3i.grammar.printer import format_program, number_text
from p3i.place.objects import Objects, Polygon

COLUMNS = ("name", "row", "column", "i", "j", "x_px", "y_px", "x", "y", "presence", "inside", "cell_px")
"""The head of the CSV."""


def encode(found: Objects, form: str) -> bytes:
    """`found` in the format `form`; raises UsageError for an unknown one, or where its extra is missing."""
    if form not in _WRITERS:
        raise UsageError(f"points writes {', '.join(_WRITERS)}, not {form!r}")
    return _WRITERS[form](found).encode("utf-8")


def table(found: Objects) -> str:
    """CSV: a line an object, its cell as WKT; pixel centres at whole numbers, rows and columns from 1.

    Numbers are as short as they can be and still read back the same, as in programs.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for each in found.objects:
        presence = "" if each.presence is None else number_text(each.presence)
        writer.writerow(
            [
                each.name,
                each.row + 1,
                each.column + 1,
                each.i,
                each.j,
                *map(number_text, (each.x_px, each.y_px, each.x, each.y)),
                presence,
                str(each.inside).lower(),
                _wkt(each.cell_px),
            ]
        )
    return stream.getvalue()


def record(found: Objects) -> dict[str, Any]:
    """All that is known, as JSON has it; pixel centres at whole numbers, rows and columns from 1."""
    return {
        "image": found.image,
        "width": found.size.width,
        "height": found.size.height,
        "arrangement": found.arrangement,
        "columns": found.columns,
        "rows": found.rows,
        "camera": {"rx": found.camera.rx_deg, "ry": found.camera.ry_deg, "focal": found.camera.focal_mm},
        "program": format_program(found.program),
        "objects": [
            {
                "name": each.name,
                "row": each.row + 1,
                "column": each.column + 1,
                "i": each.i,
                "j": each.j,
                "center_px": [each.x_px, each.y_px],
                "center": [each.x, each.y],
                "presence": each.presence,
                "inside": each.inside,
                "cell_px": [list(corner) for corner in each.cell_px],
                "cell": [list(corner) for corner in each.cell],
            }
            for each in found.objects
        ],
    }


def lines(found: dict[str, Any], key: str) -> str:
    """A JSON object whose list `key` stands an entry a line: short enough to read, and to compare."""
    rest = {name: value for name, value in found.items() if name != key}
    head = json.dumps(rest, ensure_ascii=False)[1:-1]
    body = ",\n ".join(json.dumps(entry, ensure_ascii=False) for entry in found[key])
    return f'{{{head}{", " if head else ""}"{key}": [\n {body}\n]}}\n'


def _wkt(polygon: Polygon) -> str:
    if not polygon:
        return "POLYGON EMPTY"
    return (
        "POLYGON (("
        + ", ".join(f"{number_text(x)} {number_text(y)}" for x, y in (*polygon, polygon[0]))
        + "))"
    )


_WRITERS: dict[str, Callable[[Objects], str]] = {
    "csv": table,
    "json": lambda found: lines(record(found), "objects"),
    "coco": lambda found: lines(coco(found), "annotations"),
    "labelme": lambda found: lines(labelme(found), "shapes"),
    "geojson": lambda found: lines(geojson(found), "features"),
    "svg": svg,
    "dxf": dxf,
}

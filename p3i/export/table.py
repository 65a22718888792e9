"""The list as a table: CSV for spreadsheets, and all that is known as JSON.

Convention: pixels of the photo, pixel centres at whole numbers; rows and columns count from 1.
"""

import csv
import io
from typing import Any

from p3i.grammar.printer import format_program, number_text
from p3i.place.objects import Object, Objects, Polygon

COLUMNS = ("name", "row", "column", "i", "j", "x_px", "y_px", "x", "y", "presence", "inside", "cell_px")
"""The head of the CSV; with a cell's true size the place in its unit follows: x_mm, y_mm."""


def table(found: Objects) -> str:
    """CSV: a line an object, its cell as WKT.

    Numbers are as short as they can be and still read back the same, as in programs.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    unit = None if found.cell_size is None else found.cell_size.unit
    writer.writerow(COLUMNS if unit is None else (*COLUMNS, f"x_{unit}", f"y_{unit}"))
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
                *map(number_text, each.true or ()),
            ]
        )
    return stream.getvalue()


def record(found: Objects) -> dict[str, Any]:
    """All that is known, as JSON has it; with a cell's true size also lengths, and their unit."""
    cell = found.cell_size
    return {
        "image": found.image,
        "width": found.size.width,
        "height": found.size.height,
        "arrangement": found.arrangement,
        "columns": found.columns,
        "rows": found.rows,
        "camera": {"rx": found.camera.rx_deg, "ry": found.camera.ry_deg, "focal": found.camera.focal_mm},
        "program": format_program(found.program),
        **({} if cell is None else {"unit": cell.unit, "cell_size": list(cell.sides)}),
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
                **_true(each),
            }
            for each in found.objects
        ],
    }


def _true(each: Object) -> dict[str, Any]:
    """Place and cell in lengths, where they are known."""
    if each.true is None:
        return {}
    return {"center_true": list(each.true), "cell_true": [list(corner) for corner in each.cell_true]}


def _wkt(polygon: Polygon) -> str:
    if not polygon:
        return "POLYGON EMPTY"
    return (
        "POLYGON (("
        + ", ".join(f"{number_text(x)} {number_text(y)}" for x, y in (*polygon, polygon[0]))
        + "))"
    )

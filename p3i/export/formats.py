"""A list of objects as the bytes of a file, format by format."""

import json
from collections.abc import Callable
from typing import Any

from p3i.errors import UsageError
from p3i.export.coco import coco
from p3i.export.dxf import dxf
from p3i.export.geojson import geojson
from p3i.export.labelme import labelme
from p3i.export.svg import svg
from p3i.export.table import record, table
from p3i.export.yolo import yolo
from p3i.place.objects import Objects


def encode(found: Objects, form: str) -> bytes:
    """`found` in the format `form`; raises UsageError for an unknown one, or where its extra is missing."""
    if form not in _WRITERS:
        raise UsageError(f"points writes {', '.join(_WRITERS)}, not {form!r}")
    return _WRITERS[form](found).encode("utf-8")


def lines(found: dict[str, Any], key: str) -> str:
    """A JSON object whose list `key` stands an entry a line: short enough to read, and to compare."""
    rest = {name: value for name, value in found.items() if name != key}
    head = json.dumps(rest, ensure_ascii=False)[1:-1]
    body = ",\n ".join(json.dumps(entry, ensure_ascii=False) for entry in found[key])
    return f'{{{head}{", " if head else ""}"{key}": [\n {body}\n]}}\n'


_WRITERS: dict[str, Callable[[Objects], str]] = {
    "csv": table,
    "json": lambda found: lines(record(found), "objects"),
    "coco": lambda found: lines(coco(found), "annotations"),
    "labelme": lambda found: lines(labelme(found), "shapes"),
    "yolo": yolo,
    "geojson": lambda found: lines(geojson(found), "features"),
    "svg": svg,
    "dxf": dxf,
}

"""The one record of options that `points` takes: the Python API and the command line both read it.

Each field carries the sentence that documents it. Imports neither torch nor numpy.
"""

import math
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Annotated

from p3i.errors import UsageError
from p3i.options.cell import CellSize, parse_cell
from p3i.records import PhotoFocal, Spelt, check_focal
from p3i.size import Size, parse_size

FORMATS = ("csv", "json", "coco", "labelme", "yolo", "geojson", "svg", "dxf")
"""What a list of objects can be written as."""

BY_SUFFIX = {kind: kind for kind in ("csv", "json", "geojson", "svg", "dxf")}
"""The formats that a file's name tells; COCO and labelme (JSON too) and YOLO (text) have to be asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointsOptions:
    """Which objects to list, and how. Raises UsageError for a value out of range."""

    size: Annotated[
        Size | None,
        "Width and height of the photo in pixels, where there is no photo; by default the program's canvas.",
        Spelt(metavar="WxH", read=parse_size),
    ] = None
    min_presence: Annotated[
        float,
        "Leave out objects whose presence in the photo is less than P, between 0 and 1.",
        Spelt(metavar="P"),
    ] = 0.0
    outside: Annotated[bool, "List the objects that lie outside the photo too.", Spelt("--all")] = False
    clip: Annotated[bool, "Cut the cells off at the photo's edge (COCO and YOLO always do)."] = False
    cell: Annotated[
        CellSize | None,
        "The true size of one cell of a lattice, such as 600x600mm (mm, cm, m, in, ft): CSV, JSON and DXF "
        "tell lengths in its unit, from the object (i, j) = (0, 0).",
        Spelt(metavar="WxHmm", read=parse_cell),
    ] = None
    label: Annotated[str, "The class of the objects in COCO, labelme and GeoJSON.", Spelt(metavar="WORD")] = (
        "object"
    )
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.min_presence) and 0 <= self.min_presence <= 1):
            raise UsageError(f"the least presence lies between 0 and 1, not {self.min_presence:g}")
        check_focal(self.focal_mm)
        if not self.label.strip() or not self.label.isprintable():
            raise UsageError("the label of the objects is a word, not empty")


def format_of(path: str | PathLike[str]) -> str:
    """The format that a file's name asks for; raises UsageError where it tells none."""
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in BY_SUFFIX:
        known = ", ".join(f".{kind}" for kind in BY_SUFFIX)
        raise UsageError(
            f"cannot tell the format from {fspath(path)!r}: end the name in {known}, or say --format"
        )
    return BY_SUFFIX[suffix]

"""The one record of options that drawing takes: the Python API and the command line both read it.

Each field carries the sentence that documents it, so `p3i render --help` and `help(RenderOptions)` cannot
differ. Imports neither torch nor numpy: `p3i render --help` reads this file.
"""

import math
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Annotated

from p3i.errors import UsageError
from p3i.records import PhotoFocal, Spelt, check_focal, check_max_px
from p3i.size import Size, parse_size

KINDS = ("png", "svg", "pdf")
"""What `RenderedPicture.encode` can make."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderOptions:
    """What to draw of a program, and how large. Raises UsageError for a value out of range."""

    size: Annotated[
        Size | None,
        "Width and height of the picture in pixels; by default those of the photo, else of the program's "
        "canvas, else what fits the drawn objects.",
        Spelt(metavar="WxH", read=parse_size),
    ] = None
    plane: Annotated[bool, "Draw the plane as seen straight on instead of as the camera sees it."] = False
    markers: Annotated[
        bool | None, "Mark each object by a dot, coloured by its index; by default where no picture stands."
    ] = None
    cells: Annotated[
        bool | None,
        "Outline each object's cell; by default on an empty canvas, not over a photo or pictures.",
    ] = None
    horizon: Annotated[bool, "Draw the plane's vanishing line, where it crosses the picture."] = False
    sprite_units: Annotated[
        float | None,
        "The longer side of an object's picture in program units; by default a little less than the spacing.",
        Spelt(metavar="U"),
    ] = None
    allow_outside: Annotated[
        bool,
        "Read a picture named in Draw(...) from anywhere; by default only from below the program's folder.",
    ] = False
    focal_mm: PhotoFocal = None
    max_px: Annotated[
        int, "Refuse to make pictures of more than N pixels (width times height).", Spelt(metavar="N")
    ] = 100_000_000

    def __post_init__(self) -> None:
        check_focal(self.focal_mm)
        units = self.sprite_units
        if units is not None and not (math.isfinite(units) and 0 < units <= 1e6):
            raise UsageError(f"a picture's side is more than 0 program units, not {units:g}")
        check_max_px(self.max_px)


def kind_of(path: str | PathLike[str]) -> str:
    """The kind of file that a name asks for; raises UsageError for one that is not drawn."""
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in KINDS:
        known = ", ".join(f".{kind}" for kind in KINDS)
        raise UsageError(f"cannot tell the kind of picture from {fspath(path)!r}: end the name in {known}")
    return suffix

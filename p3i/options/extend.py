"""The one record of options that extending takes: the Python API and the command line both read it.

Imports neither torch nor numpy: `p3i extend --help` reads this file.
"""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from p3i.errors import UsageError
from p3i.records import KeepTransparent, PhotoFocal, Spelt, check_focal, check_max_px

SIDES = ("left", "top", "right", "bottom")
"""The sides of a picture, in the order in which margins are given."""

Unit = Literal["px", "%", "cells"]

Beyond = Literal["crop", "transparent", "continue", "refuse"]
BEYONDS: tuple[Beyond, ...] = get_args(Beyond)
"""What becomes of new ground that is not pattern."""


@dataclass(frozen=True, slots=True)
class Margins:
    """How far a picture grows to the `left`, `top`, `right` and `bottom`, in `unit`.

    Per cent are of the picture's width (left, right) and height (top, bottom). Raises UsageError for what is
    negative, or nothing on all sides.
    """

    left: float
    top: float
    right: float
    bottom: float
    unit: Unit = "px"

    def __post_init__(self) -> None:
        if not all(math.isfinite(one) and one >= 0 for one in self.sides):
            shown = ", ".join(f"{one:g}" for one in self.sides)
            raise UsageError(f"a picture grows by 0 or more to each side, not by {shown}")
        if not any(self.sides):
            raise UsageError("the picture is to grow by nothing: name at least one side")

    @property
    def sides(self) -> tuple[float, float, float, float]:
        """The four numbers, in the order of SIDES."""
        return self.left, self.top, self.right, self.bottom


def parse_margins(text: str, *, option: str = "--by") -> Margins:
    """`20%`, `40px` or `40` for all sides, `10%,0,10%,0` for left, top, right, bottom; `--cells 2,0,2,0`.

    Raises UsageError for anything else, also for per cent and pixels side by side.
    """
    found = [re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(%|px)?\s*", word) for word in text.split(",")]
    cells = option == "--cells"
    example = "--cells 2 or --cells 2,0,2,0" if cells else "--by 20%, --by 80px or --by 10%,0,10%,0"
    if len(found) not in (1, 4) or any(one is None or (cells and one[2]) for one in found):
        raise UsageError(f"{option} {text}: write one number, or four for {', '.join(SIDES)}: {example}")
    numbers = [float(one[1]) for one in found if one]
    units = {one[2] or "px" for one in found if one and (one[2] or float(one[1]))} or {"px"}
    if len(units) > 1:
        raise UsageError(f"{option} {text}: write all sides in per cent, or all in pixels")
    unit: Unit = "cells" if cells else "%" if units == {"%"} else "px"
    left, top, right, bottom = numbers * (4 if len(numbers) == 1 else 1)
    return Margins(left, top, right, bottom, unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtendOptions:
    """How far to continue a picture. Raises UsageError for a value out of range."""

    by: Annotated[
        Margins,
        "How far to each side: 20%, 80px, or four for left, top, right, bottom as in 10%,0,10%,0. Per cent "
        "are of the width (left, right) and of the height (top, bottom). [default: 20%]",
        Spelt(metavar="N%|N|L,T,R,B", read=parse_margins),
    ] = Margins(20, 20, 20, 20, "%")
    beyond: Annotated[
        Beyond,
        "Where the new ground is not pattern. crop: grow only as far as it is; transparent: leave it so; "
        "continue: the photo's border goes on, smoothly; refuse: make no such picture.",
    ] = "crop"
    keep_transparent: KeepTransparent = False
    max_px: Annotated[
        int, "Make no picture of more than N pixels (width times height).", Spelt(metavar="N")
    ] = 100_000_000
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if self.beyond not in BEYONDS:
            raise UsageError(
                f"what is not pattern is left by one of {', '.join(BEYONDS)}, not by {self.beyond!r}"
            )
        check_max_px(self.max_px)
        check_focal(self.focal_mm)

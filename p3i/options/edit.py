"""The one record of options that editing takes: the Python API and the command line both read it.

Imports neither torch nor numpy: `p3i edit --help` reads this file.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from p3i.errors import UsageError
from p3i.records import KeepTransparent, Spelt, check_focal


def parse_scale(text: str) -> float | None:
    """`auto` as None, else a number; UsageError for anything else."""
    if text.strip().lower() == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--scale {text}: write auto or a number, such as 1") from None


@dataclass(frozen=True, slots=True, kw_only=True)
class EditOptions:
    """How to lay the objects anew. Raises UsageError for a value out of range."""

    scale: Annotated[
        float | None,
        "How large new objects are, 1 as they were; auto makes them smaller where the new program stands "
        "closer. [default: auto]",
        Spelt(metavar="auto|S", read=parse_scale),
    ] = None
    keep_transparent: KeepTransparent = False
    focal_mm: Annotated[
        float | None,
        "35 mm-equivalent focal length; by default that of the old program's header, else of the photo, "
        "else 35.",
        Spelt("--focal", metavar="MM"),
    ] = None

    def __post_init__(self) -> None:
        if self.scale is not None and not (math.isfinite(self.scale) and 0.05 <= self.scale <= 20):
            raise UsageError(f"a scale lies between 0.05 and 20, or is auto, not {self.scale:g}")
        check_focal(self.focal_mm)

"""The one record of options that straightening takes: the Python API and the command line both read it.

Imports neither torch nor numpy: `p3i rectify --help` reads this file.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from p3i.errors import UsageError
from p3i.options.cell import CellSize, parse_cell
from p3i.records import PhotoFocal, Spelt, check_focal, check_max_px

Crop = Literal["pattern", "inside", "all", "same"]
CROPS: tuple[Crop, ...] = get_args(Crop)
"""What of the plane a straightened view shows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RectifyOptions:
    """What of the plane to show, how large, and which way up. Raises UsageError for a value out of range."""

    crop: Annotated[
        Crop,
        "What to show: the pattern with a cell's margin, the largest rectangle inside which all is known, "
        "all of the photo that is not too near to the horizon, or the photo's own canvas and place.",
    ] = "pattern"
    scale: Annotated[
        float | None,
        "Pixels of the view per pixel of the photo, where the photo is sharpest at the pattern's middle. "
        "[default: 1, or less where --max-px asks for it]",
        Spelt(metavar="S"),
    ] = None
    px_per_mm: Annotated[
        float | None,
        "With --cell: pixels of the view per millimetre of the plane, in the place of --scale.",
        Spelt(metavar="N"),
    ] = None
    max_px: Annotated[int, "Make no view of more than N pixels (width times height).", Spelt(metavar="N")] = (
        36_000_000
    )
    cell: Annotated[
        CellSize | None,
        "The true size of one cell of a lattice, such as 600x600mm: sets the proportions, whatever the "
        "focal, and the resolution (dpi) of the file.",
        Spelt(metavar="WxHmm", read=parse_cell),
    ] = None
    upright: Annotated[
        bool,
        "Turn the view so that the lattice's rows run across, or leave it as the camera saw it.",
        Spelt("--upright/--as-seen"),
    ] = True
    tolerance: Annotated[
        float | None,
        "With --back: how much a pixel (0 to 255) must differ to count as edited. [default: 0; 16 where the "
        "edited file is a JPEG or WebP, whose every pixel differs]",
        Spelt(metavar="T"),
    ] = None
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if self.crop not in CROPS:
            raise UsageError(f"a crop is one of {', '.join(CROPS)}, not {self.crop!r}")
        if self.scale is not None and not (math.isfinite(self.scale) and 0 < self.scale <= 100):
            raise UsageError(f"a scale lies above 0 and up to 100, not {self.scale:g}")
        if self.px_per_mm is not None:
            if self.cell is None:
                raise UsageError("--px-per-mm needs --cell: what is one cell's true size?")
            if self.scale is not None:
                raise UsageError("--px-per-mm and --scale both say how large the view is: give one of them")
            if not (math.isfinite(self.px_per_mm) and self.px_per_mm > 0):
                raise UsageError(f"pixels per millimetre are above 0, not {self.px_per_mm:g}")
        check_max_px(self.max_px)
        if self.tolerance is not None and not 0 <= self.tolerance < 255:
            raise UsageError(f"a tolerance lies from 0 to below 255, not {self.tolerance:g}")
        check_focal(self.focal_mm)

"""The one record of options that `tile` takes: the Python API and the command line both read it.

Imports neither torch nor numpy: `p3i tile --help` reads this file.
"""

import re
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from p3i.errors import UsageError
from p3i.records import PhotoFocal, Spelt, check_focal, check_max_px
from p3i.size import Size, parse_size

TileSource = Literal["mean", "best"]
SOURCES: tuple[TileSource, ...] = get_args(TileSource)
"""What a tile is made of."""


MOST_CELLS = 100
"""A tile shows no more cells a side than this."""


def parse_repeat(text: str) -> tuple[int, int]:
    """`NxM`, times across and down; raises UsageError for anything else."""
    found = re.fullmatch(r"\s*(\d{1,9})\s*[xX×*,]\s*(\d{1,9})\s*", text)  # noqa: RUF001
    if found is None:
        raise UsageError(f"{text!r} is no number of times: write across and down, as in 3x2")
    return int(found[1]), int(found[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class TileOptions:
    """Of what to make a tile, and how large. Raises UsageError for a value out of range."""

    source: Annotated[
        TileSource | None,
        "Make the tile from the robust mean of the cells, or from real ones, the best, their borders blended "
        "into what follows on the other side. [default: mean; best with --cells]",
        Spelt("--from"),
    ] = None
    cells: Annotated[
        tuple[int, int],
        "Show this many neighbouring cells across and down as they are, with the variety of all.",
        Spelt(metavar="NxM", read=parse_repeat),
    ] = (1, 1)
    size: Annotated[
        Size | None,
        "Width and height of one tile in pixels; by default as fine as the photo is at the pattern's middle.",
        Spelt(metavar="WxH", read=parse_size),
    ] = None
    repeat: Annotated[
        tuple[int, int],
        "Lay the tile this many times across and down.",
        Spelt(metavar="NxM", read=parse_repeat),
    ] = (1, 1)
    grain: Annotated[
        bool,
        "Give the mean the grain of a real cell back, which it averages away, or leave it smooth.",
        Spelt("--grain/--smooth"),
    ] = True
    light: Annotated[
        bool,
        "Remove the light's gradient over the cells, or keep it as it is.",
        Spelt("--even-light/--keep-light"),
    ] = True
    max_px: Annotated[
        int, "Refuse to make pictures of more than N pixels (width times height).", Spelt(metavar="N")
    ] = 100_000_000
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if self.source is not None and self.source not in SOURCES:
            raise UsageError(f"a tile is made from one of {', '.join(SOURCES)}, not {self.source!r}")
        if len(self.repeat) != 2 or not all(1 <= count <= 10_000 for count in self.repeat):
            raise UsageError(f"a tile is repeated 1 to 10000 times across and down, not {self.repeat}")
        if len(self.cells) != 2 or not all(1 <= count <= MOST_CELLS for count in self.cells):
            raise UsageError(f"a tile shows 1 to {MOST_CELLS} cells across and down, not {self.cells}")
        if self.cells != (1, 1) and self.source == "mean":
            raise UsageError("--cells shows cells as they are: it needs --from best, not --from mean")
        if self.size is not None and min(self.size.width, self.size.height) < 4:
            raise UsageError(
                f"a tile has at least 4 pixels a side, not {self.size.width} x {self.size.height}"
            )
        check_max_px(self.max_px)
        check_focal(self.focal_mm)

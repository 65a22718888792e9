"""The one record of options that `show` takes: the Python API and the command line both read it.

Each field carries the sentence that documents it. Imports neither torch nor numpy.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from p3i.errors import UsageError
from p3i.records import PhotoFocal, Spelt, check_focal

Labels = Literal["names", "index", "none"]
LABELS: tuple[Labels, ...] = get_args(Labels)
"""What may be written at the objects."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShowOptions:
    """What to draw over the photo. Raises UsageError for a value out of range."""

    labels: Annotated[
        Labels,
        "What to write at the objects, where there is room: names as `p3i points` gives them, i and j, or "
        "nothing.",
    ] = "names"
    points: Annotated[
        bool,
        "Mark each object by a dot, by a cross where it is not there, by a grey dot where that is unknown.",
    ] = True
    cells: Annotated[bool, "Outline the cells of the objects."] = True
    horizon: Annotated[bool, "Draw the plane's vanishing line, where it crosses the picture."] = True
    extent: Annotated[bool, "Draw a line around all cells together."] = True
    presence: Annotated[bool, "Look which objects are there; else each gets a dot."] = True
    longer: Annotated[int, "Reduce larger photos to a longer side of N pixels first.", Spelt(metavar="N")] = (
        3000
    )
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if self.labels not in LABELS:
            raise UsageError(f"labels are {', '.join(LABELS)}, not {self.labels!r}")
        if not 16 <= self.longer <= 20_000:
            raise UsageError(f"the longer side has between 16 and 20000 pixels, not {self.longer}")
        check_focal(self.focal_mm)

"""The size of a canvas, and the program unit that follows from it."""

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Size:
    """Width and height of a canvas in pixels.

    Convention: pixel centres lie at whole numbers, so the middle of the picture, where the optical axis
    meets it, is ((width - 1) / 2, (height - 1) / 2).
    """

    width: int
    height: int

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a canvas needs at least one pixel a side, not {self.width} x {self.height}")

    @property
    def longer(self) -> int:
        """The longer side, in pixels."""
        return max(self.width, self.height)

    @property
    def unit_px(self) -> float:
        """Pixels in one program unit: a hundredth of the longer side."""
        return self.longer / 100

    @property
    def middle(self) -> tuple[float, float]:
        """The principal point (x, y), in pixels."""
        return (self.width - 1) / 2, (self.height - 1) / 2


def parse_size(text: str) -> Size:
    """The size that `WxH` spells, such as 640x480; raises ValueError for anything else."""
    found = re.fullmatch(r"\s*(\d{1,18})\s*[xX×*,]\s*(\d{1,18})\s*", text)  # noqa: RUF001
    if found is None or not (int(found[1]) and int(found[2])):
        raise ValueError(f"{text!r} is no size: write the width and the height in pixels, as in 640x480")
    return Size(int(found[1]), int(found[2]))

"""The true size of a lattice's cell, as `rectify` and `points` take it."""

import math
import re
from dataclasses import dataclass

from p3i.errors import UsageError

MM_PER = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
"""The units of lengths."""


@dataclass(frozen=True, slots=True)
class CellSize:
    """The true width and height of one cell, in millimetres; `unit` is the one that answers are told in.

    Raises UsageError for sides that cannot be, and an unknown unit.
    """

    width_mm: float
    height_mm: float
    unit: str = "mm"

    def __post_init__(self) -> None:
        if not all(math.isfinite(side) and 1e-6 < side < 1e9 for side in (self.width_mm, self.height_mm)):
            raise UsageError(f"a cell has two sides above 0, not {self.width_mm:g} x {self.height_mm:g} mm")
        if self.unit not in MM_PER:
            raise UsageError(f"lengths are told in {', '.join(MM_PER)}, not {self.unit!r}")

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height in `unit`."""
        return self.width_mm / MM_PER[self.unit], self.height_mm / MM_PER[self.unit]

    @property
    def digits(self) -> int:
        """Digits after the point of a length in `unit` that is told to a thousandth of a millimetre."""
        return 3 + math.ceil(math.log10(MM_PER[self.unit]))


def parse_cell(text: str) -> CellSize:
    """`600x600mm`, `60x30cm`, `1x1m`, `4x4in`, `2x1ft`; the unit may be left out for mm.

    Raises UsageError for anything else.
    """
    number = r"(\d+(?:\.\d*)?|\.\d+)"
    found = re.fullmatch(rf"\s*{number}\s*[xX×*]\s*{number}\s*([a-z]*)\s*", text)  # noqa: RUF001
    if found is None or (found[3] or "mm") not in MM_PER:
        raise UsageError(
            f"--cell {text}: write one cell's width and height, as in 600x600mm (mm, cm, m, in, ft)"
        )
    unit = found[3] or "mm"
    return CellSize(float(found[1]) * MM_PER[unit], float(found[2]) * MM_PER[unit], unit)

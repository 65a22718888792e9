"""Some pixels of a large picture with colours of their own: those near the rims of holes.

Convention: pictures float32 [H, W, 3], masks bool [H, W]; K pixels, row by row.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.strips import Window, wider_by, within

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Scattered:
    """The pixels at `rows` and `columns` [K], with `colours` [K, 3]."""

    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    colours: Floats

    @classmethod
    def of(cls, picture: Floats, where: Mask, *, top: int = 0) -> "Scattered":
        """Those of a picture [h, w, 3] `where` [h, w]; it begins at row `top` of a larger one."""
        rows, columns = (part.astype(np.int32) for part in np.nonzero(where))
        return cls(rows + np.int32(top), columns, picture[rows, columns])

    @classmethod
    def joined(cls, parts: Sequence["Scattered"]) -> "Scattered":
        """All of them, those of one part above those of the next."""
        if not parts:
            return cls(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros((0, 3), np.float32))
        return cls(
            np.concatenate([one.rows for one in parts]),
            np.concatenate([one.columns for one in parts]),
            np.concatenate([one.colours for one in parts]),
        )

    def part(self, where: Mask) -> "Scattered":
        """Those `where` [H, W]."""
        kept = where[self.rows, self.columns]
        return Scattered(self.rows[kept], self.columns[kept], self.colours[kept])

    def shown_by(self, picture: Floats) -> Floats:
        """The colours [K, 3] that a picture has there."""
        return picture[self.rows, self.columns]

    def write_to(self, picture: Floats) -> None:
        """Give a picture these colours."""
        picture[self.rows, self.columns] = self.colours

    def read(self, window: Window, corner: tuple[int, int]) -> tuple[Floats, Mask]:
        """A window of a larger one at `corner` (x, y): the colours [h, w, 3], 0 elsewhere; where they are."""
        rows, columns = window
        height, width = rows.stop - rows.start, columns.stop - columns.start
        top, left = corner[1] + rows.start, corner[0] + columns.start
        first, last = np.searchsorted(self.rows, (top, top + height))
        y, x = self.rows[first:last] - top, self.columns[first:last] - left
        own = (x >= 0) & (x < width)
        colours, where = np.zeros((height, width, 3), np.float32), np.zeros((height, width), bool)
        colours[y[own], x[own]] = self.colours[first:last][own]
        where[y[own], x[own]] = True
        return colours, where


def near_rims(hole: Mask, rows: slice, *, outwards: int, inwards: int) -> Mask:
    """Which pixels of some rows [h, W] lie so near to the rim of a hole [H, W], outside of it and inside."""
    everywhere = slice(0, hole.shape[1])
    wider = wider_by((rows, everywhere), max(outwards, inwards), hole.shape)
    inside = hole[wider].astype(np.uint8)
    outside = cv2.dilate(inside, np.ones((2 * outwards + 1,) * 2, np.uint8)) > 0
    near = outside & (cv2.dilate(1 - inside, np.ones((2 * inwards + 1,) * 2, np.uint8)) > 0)
    return near[within((rows, everywhere), wider)]

"""The part of a photo that is looked at: all of it, or what a region of interest leaves.

A part is cut out and read at full use of the maps' pixels, while camera and program stay those of the
whole photo: the principal point is the photo's middle, and only the way to a map goes through the cut.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import in_frame


@dataclass(frozen=True, slots=True)
class Box:
    """Pixels `left` to `right` and `top` to `bottom` of a photo, both half-open."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def width(self) -> int:
        """In pixels."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """In pixels."""
        return self.bottom - self.top

    @classmethod
    def around(cls, where: NDArray[np.bool_]) -> "Box":
        """The least box that holds all that is set in `where` [H, W]; something is."""
        columns, rows = np.flatnonzero(where.any(0)), np.flatnonzero(where.any(1))
        return cls(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a photo of `photo_size`: `image` is cut out of it, from pixel `corner` (x, y) on."""

    image: Image
    corner: tuple[int, int]
    photo_size: Size

    @property
    def size(self) -> Size:
        """Width and height of the part."""
        return self.image.size

    @property
    def share(self) -> float:
        """The part's longer side as a share of the photo's."""
        return self.size.longer / self.photo_size.longer

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of the part (x, y), in pixels of the photo."""
        x, y = self.size.middle
        return x + self.corner[0], y + self.corner[1]

    @property
    def window(self) -> tuple[int, int, int, int] | None:
        """The part as (x, y, width, height) of the photo's pixels; None where it is all of the photo."""
        return None if self.size == self.photo_size else (*self.corner, self.size.width, self.size.height)

    @property
    def from_photo(self) -> Tensor:
        """The matrix [3, 3] (float64) that takes pixels of the photo to pixels of the part."""
        matrix = torch.eye(3, dtype=torch.float64)
        matrix[0, 2], matrix[1, 2] = -self.corner[0], -self.corner[1]
        return matrix

    def shows(self, points_px: Tensor) -> Tensor:
        """Which points [N, 2] (photo pixels) lie on the part's pixels, in its roi too: [N] bool."""
        return shown(self.image, points_px - points_px.new_tensor(self.corner))


def part_of(image: Image, window: Box | None = None) -> Part:
    """The part of a photo in the `window`, or, where there is none, the box of its region of interest."""
    box = Box.around(image.roi) if window is None and image.roi is not None else window
    if box is None:
        return Part(image, (0, 0), image.size)
    cut = slice(box.top, box.bottom), slice(box.left, box.right)
    pixels, valid = np.ascontiguousarray(image.pixels[cut]), np.ascontiguousarray(image.valid[cut])
    roi = None if image.roi is None else np.ascontiguousarray(image.roi[cut])
    return Part(replace(image, pixels=pixels, valid=valid, roi=roi), (box.left, box.top), image.size)


def shown(image: Image, points_px: Tensor) -> Tensor:
    """Which points [N, 2] lie on the photo's pixels and in its region of interest, [N] bool."""
    inside = in_frame(points_px, image.size)
    if image.roi is None:
        return inside
    x, y = torch.nan_to_num(points_px).round().long().unbind(-1)
    x, y = x.clamp(0, image.size.width - 1), y.clamp(0, image.size.height - 1)
    return inside & torch.from_numpy(image.roi)[y, x]

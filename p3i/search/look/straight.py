"""A photo freed of its lens: as a pinhole camera would show it (p3i/interp/lens.py), and the way back."""

import dataclasses
import math
from dataclasses import dataclass

import torch

from p3i.interp.lens import photo_from_straight
from p3i.search.look.evidence import Evidence
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid, remapped

# A straightened canvas is at most so much wider than the photo: what a barrel lens saw beyond is given up.
_WIDEST = 1.4


@dataclass(frozen=True, slots=True, eq=False)
class Straightened:
    """A photo freed of its lens: `image` on a canvas `scale` times as wide as `photo_size`."""

    image: Image
    photo_size: Size
    k1: float
    scale: float

    def points_on_photo(self, points_px: torch.Tensor) -> torch.Tensor:
        """Points [..., 2] in pixels of `image` as pixels of the photo as it was taken."""
        on_photo = shifted(points_px, self.image.size, self.photo_size)
        return photo_from_straight(on_photo, self.k1, size=self.photo_size)[0]

    def looked_at(self, evidence: Evidence) -> Evidence:
        """The `evidence` of the photo as it was taken, on `image` instead: its focal is of that canvas."""
        return Evidence(self.image, evidence.config, evidence.focal_mm / self.scale, self.points_on_photo)


def straightened(image: Image, k1: float) -> Straightened:
    """The photo as a pinhole camera of the same focal would show it; what it does not show is unknown."""
    size = image.size
    if k1 == 0:
        return Straightened(image, size, k1, 1.0)
    widen = min(_WIDEST, max(1.0, 1 / (1 + k1)))
    margin = math.ceil((widen - 1) / 2 * size.longer)
    # As many pixels on each side keep the middle; the longer side must remain the longer.
    canvas = Size(size.width + 2 * margin, size.height + 2 * margin)
    straight = pixel_grid(canvas, dtype=torch.float32) - margin
    points, shown = photo_from_straight(straight, k1, size=size)
    pixels, valid = remapped(image.pixels, image.valid, points.numpy())
    # What is asked for is as wide as where that is known; each point reads its nearest pixel.
    roi = None if image.roi is None else remapped(image.pixels[..., :1], image.roi, points.numpy())[1]
    straight_image = dataclasses.replace(image, pixels=pixels, valid=valid & shown.numpy(), roi=roi)
    return Straightened(straight_image, size, k1, canvas.longer / size.longer)


def shifted(points_px: torch.Tensor, canvas: Size, photo: Size) -> torch.Tensor:
    """Points [..., 2] on the straightened canvas as points on the photo's, which has the same middle."""
    return points_px - points_px.new_tensor(canvas.middle) + points_px.new_tensor(photo.middle)

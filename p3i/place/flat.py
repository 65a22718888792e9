"""A photo that its lens bends, laid flat: as a pinhole camera would show it, and the way back.

Barrel distortion draws the photo's corners in: seen straight they lie beyond the photo's canvas. The flat
canvas holds all of the photo, so that what is filled or edited there reaches each of its pixels.

Convention: the flat pixel (x, y) is the pinhole pixel (x - left, y - top); masks are bool [h, w] on the flat
canvas, [H, W] on the photo.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from p3i.grammar.ast import Program
from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.place.placed import Placed, placed
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid, remapped

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Flat:
    """A flat `photo` with its program `placed`; both are the photo's own where `k1` is None.

    `seen` [h, w] says which flat pixels the bent photo shows at all; `corner` is (left, top), `size` the
    photo's.
    """

    photo: Image
    placed: Placed
    seen: Mask
    corner: tuple[int, int]
    size: Size
    k1: float | None

    def laid(self, other: Placed) -> Placed:
        """Another program of the same photo on the flat canvas."""
        return _moved(other, self.corner, self.photo.size)

    def marked(self, mask: Mask) -> Mask:
        """What `mask` [H, W] marks of the photo, on the flat canvas [h, w]; a part of a pixel counts."""
        if self.k1 is None:
            return mask
        points, _ = photo_from_straight(_pinhole(self.photo.size, self.corner), self.k1, size=self.size)
        values, _ = remapped(np.repeat(mask[:, :, None], 3, 2).astype(np.float32), mask, points.numpy())
        return (values[:, :, 0] > 0) & self.seen

    def bent(self, values: Floats) -> Floats:
        """Flat values [h, w, C] as the lens shows them: [H, W, C]."""
        if self.k1 is None:
            return values
        at = straight_from_photo(pixel_grid(self.size), self.k1, size=self.size).numpy()
        return remapped(values, np.ones(values.shape[:2], bool), at + np.array(self.corner, np.float32))[0]

    def bent_mask(self, mask: Mask, *, least: float = 0.5) -> Mask:
        """Which photo pixels [H, W] show more than the share `least` of a flat mask [h, w]."""
        if self.k1 is None:
            return mask
        return self.bent(np.repeat(mask[:, :, None], 3, 2).astype(np.float32))[:, :, 0] > least


def flat_of(photo: Image, program: Program, *, focal_mm: float | None = None) -> Flat:
    """The photo laid flat by the header's lens_k1; raises as `placed` does."""
    own = placed(program, photo, focal_mm=focal_mm)
    if own.lens_k1 is None:
        return Flat(photo, own, np.ones(photo.valid.shape, bool), (0, 0), photo.size, None)
    flat, seen, corner = laid_flat(photo, own.lens_k1)
    return Flat(flat, _moved(own, corner, flat.size), seen, corner, photo.size, own.lens_k1)


def laid_flat(photo: Image, k1: float) -> tuple[Image, Mask, tuple[int, int]]:
    """The flat picture, which of its pixels [h, w] the photo shows, and (left, top)."""
    width, height = photo.size.width, photo.size.height
    x, y = np.linspace(-0.5, width - 0.5, 65), np.linspace(-0.5, height - 0.5, 65)
    ends = (np.full(65, -0.5), np.full(65, width - 0.5), np.full(65, height - 0.5))
    border = np.concatenate(
        [np.stack(pair, 1) for pair in ((x, ends[0]), (x, ends[2]), (ends[0], y), (ends[1], y))]
    )
    low = straight_from_photo(torch.from_numpy(border), k1, size=photo.size).numpy().min(0)
    # The lens bends alike on all sides of the middle.
    left, top = (max(0, int(np.ceil(-0.5 - part - 1e-6))) for part in low)
    size = Size(width + 2 * left, height + 2 * top)
    points, shown = photo_from_straight(_pinhole(size, (left, top)), k1, size=photo.size)
    pixels, valid = remapped(photo.pixels, photo.valid, points.numpy())
    at = points.numpy()
    seen = shown.numpy() & (at >= -1e-3).all(-1) & (at <= np.array([width, height]) - 1 + 1e-3).all(-1)
    source = dataclasses.replace(photo.source, alpha=None)
    return dataclasses.replace(photo, pixels=pixels, valid=valid & seen, source=source), seen, (left, top)


def _pinhole(size: Size, corner: tuple[int, int]) -> torch.Tensor:
    """The pixels of a flat canvas as pinhole points [h, w, 2]."""
    return pixel_grid(size) - torch.tensor(corner, dtype=torch.float32)


def _moved(laid: Placed, corner: tuple[int, int], size: Size) -> Placed:
    """A program on the flat canvas."""
    return dataclasses.replace(laid.on_canvas(corner, size), lens_k1=None)

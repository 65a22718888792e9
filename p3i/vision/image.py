"""Photos and masks: the one reader (files -> `Image`); the writer stands in write.py.

Convention: arrays are [H, W, ...]; pixel centres lie at whole numbers, so pixel (0, 0) covers -0.5..0.5.
A picture made s times smaller maps its point u to the point (u + 0.5) * s - 0.5 of the larger one.
"""

import os
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from p3i.errors import FileError
from p3i.files import read_bytes, spoken
from p3i.size import Size
from p3i.vision.decode import Source, decode
from p3i.vision.write import write_image as write_image

# 200 megapixels need 2.4 GB as float RGB: the largest cameras pass, decompression bombs do not.
MAX_PX = 200_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An upright photo in memory.

    `pixels` float32 [H, W, 3], RGB in 0..1, gamma-encoded as stored (taken for sRGB: an embedded profile
    is kept in `source`, not applied, except for CMYK and Lab files). `valid` bool [H, W]: False is unknown
    (transparent, NaN), never evidence. `focal_mm`: from EXIF, 35 mm-equivalent on p3i's terms
    (f_px = focal_mm / 36 * longer side), or None. `stride`: pixels of the photo per pixel of this image,
    not 1 after `resized`. `notes`: what a user should know of the reading, a sentence each. `roi` bool [H, W]
    is where a person asked to look: elsewhere nothing is known, and nothing is drawn. None is everywhere.
    """

    pixels: np.ndarray
    valid: np.ndarray
    focal_mm: float | None = None
    source: Source = field(default=Source("PNG"))
    notes: tuple[str, ...] = ()
    stride: float = 1.0
    roi: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 3 or self.pixels.dtype != np.float32:
            raise ValueError(f"pixels are float32 [H, W, 3], not {self.pixels.dtype} {self.pixels.shape}")
        if self.valid.shape != self.pixels.shape[:2] or self.valid.dtype != np.bool_:
            raise ValueError(
                f"valid is bool {self.pixels.shape[:2]}, not {self.valid.dtype} {self.valid.shape}"
            )
        if self.roi is not None and self.roi.shape != self.valid.shape:
            raise ValueError(f"roi is bool {self.valid.shape}, not {self.roi.shape}")

    @property
    def size(self) -> Size:
        """Width and height in pixels of this image."""
        return Size(self.pixels.shape[1], self.pixels.shape[0])


def read_image(path: str | os.PathLike[str], *, max_px: int = MAX_PX) -> Image:
    """Read a photo, upright by EXIF, from a file or from standard input (`-`).

    Every format of Pillow and OpenCV, 8 or 16 bits or float, grey, palette, CMYK, transparent; of an
    animation the first frame (a note says so). Raises FileError, with a reason of its own for each: missing,
    a folder, no permission, empty, no picture, cut off, HEIC without its extra, more than `max_px` pixels.
    """
    return image_of(read_bytes(path), name=spoken(path), max_px=max_px)


def image_of(data: bytes, *, name: str, max_px: int = MAX_PX) -> Image:
    """The photo that a file's bytes hold, as `read_image`; `name` is the file's in errors."""
    found = decode(data, name=name, max_px=max_px)
    return Image(found.pixels, found.known, found.focal_mm, found.source, found.notes)


def read_mask(path: str | os.PathLike[str], size: Size, *, max_px: int = MAX_PX) -> np.ndarray:
    """Read a mask: bool [H, W], True where the file is white, which means unknown, to be filled.

    Transparent parts of the file are not marked. Raises FileError where the mask is not of the photo's
    `size` (as it stands upright), has colours, marks nothing or marks everything.
    """
    name = spoken(path)
    found = decode(read_bytes(path), name=name, max_px=max_px)
    height, width = found.known.shape
    if (width, height) != (size.width, size.height):
        raise FileError(
            f"the mask {name} is {width} x {height}, but the photo is {size.width} x {size.height} (upright)"
        )
    spread = found.pixels.max(axis=2) - found.pixels.min(axis=2)
    coloured = (spread > 0.25) & found.known
    # JPEG smears a little colour into sharp edges; a drawing in red is another matter.
    if coloured.sum() > 0.001 * coloured.size:
        raise FileError(
            f"the mask {name} has colours: it should be black, and white where the photo is unknown"
        )
    marked = (found.pixels.mean(axis=2) >= 0.5) & found.known
    if not marked.any():
        raise FileError(f"the mask {name} marks nothing: paint white what is unknown")
    if marked.all():
        raise FileError(f"the mask {name} is all white: nothing of the photo would be left")
    return marked


def masked(image: Image, unknown: np.ndarray) -> Image:
    """The same image with the pixels of `unknown` (bool [H, W]) no longer evidence."""
    return replace(image, valid=image.valid & ~unknown)


def within(image: Image, roi: np.ndarray) -> Image:
    """The same image, looked at only where `roi` (bool [H, W]) is True, and where it was before."""
    roi = roi if image.roi is None else roi & image.roi
    return replace(image, valid=image.valid & roi, roi=roi)


def resized(image: Image, longer: int) -> Image:
    """The image with its longer side reduced to `longer` pixels; itself, if it is no larger than that.

    Each new pixel is the mean of the valid area that it covers, and valid where that is at least half.
    Both axes shrink by exactly s = old longer / new longer (the shorter side is rounded, its last pixel
    cut or dropped rather than stretched), so the new point u is the old point (u + 0.5) * s - 0.5. A smaller
    image has no `roi`: what lies outside is unknown already.
    Raises ValueError for a side below 1.
    """
    if longer < 1:
        raise ValueError(f"the longer side needs at least one pixel, not {longer}")
    scale = image.size.longer / longer
    if scale <= 1:
        return image
    if image.valid.all():
        pixels = _area_mean(image.pixels, scale)
        return replace(
            image, pixels=pixels, valid=np.ones(pixels.shape[:2], bool), stride=image.stride * scale, roi=None
        )
    known = image.valid.astype(np.float32)
    weight = _area_mean(known, scale)
    pixels = _area_mean(image.pixels * known[:, :, None], scale) / np.maximum(weight, 1e-6)[:, :, None]
    pixels = np.clip(pixels, 0, 1)
    valid = weight >= 0.5 - 1e-6
    return replace(image, pixels=pixels, valid=valid, stride=image.stride * scale, roi=None)


def resized_from_photo(scale: float) -> np.ndarray:
    """The matrix [3, 3] that takes pixels of a picture to those of one `scale` times as large."""
    shift = 0.5 * scale - 0.5
    return np.array([[scale, 0, shift], [0, scale, shift], [0, 0, 1]])


def _area_mean(array: np.ndarray, scale: float) -> np.ndarray:
    """An array [H, W(, C)] reduced `scale` times on both axes, each pixel the mean of its area."""
    # With fx and fy OpenCV keeps the scale exact; with a target size it would stretch the shorter side.
    # A side that would round to 0 keeps one pixel.
    height, width = array.shape[:2]
    if min(height, width) / scale < 0.5:
        target = max(1, round(width / scale)), max(1, round(height / scale))
        return cv2.resize(array, target, interpolation=cv2.INTER_AREA)
    return cv2.resize(array, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA)

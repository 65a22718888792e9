"""A picture of each listed object, called by its name.

Plain crops are cut from the photo as it is: the upright rectangle around the cell. Straight ones show the
cell's surroundings on the plane without perspective; on rings they are turned so that outwards is up.

Convention: pixels of the photo and of the crop, pixel centres at whole numbers.
"""

from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from p3i.errors import UsageError
from p3i.files import make_folder
from p3i.interp.lens import photo_from_straight
from p3i.place.objects import Object, Objects
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.sheet import project
from p3i.vision.warp import pixel_grid, remapped, warp_pixels
from p3i.vision.write import write_image

_MOST_PX = 2000
"""No side of a crop is longer."""


def write_crops(
    found: Objects, folder: str | PathLike[str], *, straight: bool = True, force: bool = False
) -> tuple[Path, ...]:
    """Write NAME.png into `folder` for each listed object that shows on the photo; returns the paths.

    Raises UsageError where the list was made without a photo, FileError where a file exists (without `force`)
    or cannot be written.
    """
    if found.photo is None:
        raise UsageError("crops need the photo: --image names it (image in Python)")
    make_folder(Path(folder))
    written = []
    for each, pixels, known in crops(found, found.photo, straight=straight):
        path = Path(folder) / f"{each.name}.png"
        alpha = None if known.all() else known.astype(np.float32)
        # Rounded here by OpenCV: write_image guards against NaN first, which takes longer than the crop.
        write_image(path, cv2.convertScaleAbs(pixels, alpha=255.0), alpha=alpha, force=force)
        written.append(path)
    return tuple(written)


def crops(
    found: Objects, photo: Image, *, straight: bool = True
) -> Iterator[tuple[Object, np.ndarray, np.ndarray]]:
    """Each listed object with its pixels [h, w, 3] and which of them are known [h, w]."""
    for each in found.objects:
        crop = _straight(found, photo, each) if straight else _plain(photo, each)
        if crop is not None and crop[1].any():
            yield each, *crop


def _plain(photo: Image, each: Object) -> tuple[np.ndarray, np.ndarray] | None:
    if not each.cell_px:
        return None
    corners = np.array(each.cell_px)
    low = np.maximum(np.floor(corners.min(axis=0) + 0.5).astype(int), 0)
    high = np.ceil(corners.max(axis=0) + 0.5).astype(int)
    rows, columns = slice(low[1], max(high[1], 0)), slice(low[0], max(high[0], 0))
    pixels, known = photo.pixels[rows, columns], photo.valid[rows, columns]
    return (pixels, known) if pixels.size else None


def _straight(found: Objects, photo: Image, each: Object) -> tuple[np.ndarray, np.ndarray] | None:
    turn, cell = _upright(each), np.array(each.cell)
    local = (cell - (each.x, each.y)) @ turn.T
    low, high = local.min(axis=0), local.max(axis=0)
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])]) @ turn + (each.x, each.y)
    seen, front = project(found.placed.image_from_plane, corners)
    if not front.all():
        return None
    sides = np.linalg.norm(seen - np.roll(seen, -1, axis=0), axis=1)
    # The longest side keeps its pixels; the plane's proportions give the other.
    scale = float((sides / np.array([*(high - low), *(high - low)])).max())
    scale = min(scale, _MOST_PX / float((high - low).max()))
    width, height = (max(1, round(float(side))) for side in scale * (high - low))
    extent = high - low
    # Crop pixels to the plane: scaled, turned upright, moved to the object.
    plane_from_crop = np.eye(3)
    plane_from_crop[:2, :2] = turn.T * (extent / (width, height))
    plane_from_crop[:2, 2] = (low + 0.5 * extent / (width, height)) @ turn + (each.x, each.y)
    photo_from_crop = found.placed.image_from_plane @ plane_from_crop
    size, header = Size(width, height), found.program.header
    if header and header.lens_k1:
        return _through_lens(photo, photo_from_crop, size, header.lens_k1)
    pixels = warp_pixels(photo.pixels, photo_from_crop, size)
    return pixels, _known(photo, photo_from_crop, size)


def _known(photo: Image, photo_from_crop: np.ndarray, size: Size) -> np.ndarray:
    """Which pixels [h, w] of a crop lie on the photo and are read from known pixels only."""
    ends = np.array([(0, 0), (size.width - 1, 0), (size.width - 1, size.height - 1), (0, size.height - 1)])
    at, _ = project(photo_from_crop, ends)
    limits = np.array([photo.size.width, photo.size.height]) - 1
    # Between its corners a crop lies where they do: what is in front of the camera stays convex.
    if (at >= 0).all() and (at <= limits).all():
        low, high = np.floor(at.min(axis=0)).astype(int), np.ceil(at.max(axis=0)).astype(int) + 1
        if photo.valid[low[1] : high[1], low[0] : high[0]].all():
            return np.ones((size.height, size.width), bool)
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    marked = photo.valid.view(np.uint8) * np.uint8(255)
    # Beyond the photo nothing is known: the border is 0.
    seen = cv2.warpPerspective(marked, photo_from_crop, (size.width, size.height), flags=how)
    return seen == 255


def _through_lens(
    photo: Image, straight_from_crop: np.ndarray, size: Size, k1: float
) -> tuple[np.ndarray, np.ndarray]:
    """The crop of a photo whose lens bends straight lines."""
    import torch

    at, _ = project(straight_from_crop, pixel_grid(size, dtype=torch.float64).numpy())
    bent, shown = photo_from_straight(torch.from_numpy(at), k1, size=photo.size)
    return remapped(photo.pixels, photo.valid, np.where(shown.numpy()[..., None], bent.numpy(), -9.0))


def _upright(each: Object) -> np.ndarray:
    """The rotation [2, 2] of the plane that brings the object upright: rows are its right and its down."""
    outward = each.outward
    if outward is None:
        return np.eye(2)
    x, y = outward
    return np.array([[-y, x], [-x, -y]])

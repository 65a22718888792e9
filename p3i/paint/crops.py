"""A picture of each listed object, called by its name.

Plain crops are cut from the photo as it is: the upright rectangle around the cell. Straight ones show the
cell's surroundings on the plane without perspective; on rings they are turned so that outwards is up.

Convention: pixels of the photo and of the crop, pixel centres at whole numbers.
"""

from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np

from p3i.errors import UsageError
from p3i.files import make_folder
from p3i.interp.lens import photo_from_straight
from p3i.paint.objects import Object, Objects
from p3i.vision.image import Image
from p3i.vision.sheet import project
from p3i.vision.warp import remapped
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
        write_image(path, pixels, alpha=alpha, force=force)
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
    turn, cell = _upright(found, each), np.array(each.cell)
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
    x = low[0] + (np.arange(width) + 0.5) / width * (high - low)[0]
    y = low[1] + (np.arange(height) + 0.5) / height * (high - low)[1]
    plane = np.stack(np.meshgrid(x, y), axis=-1) @ turn + (each.x, each.y)
    at, _ = project(found.placed.image_from_plane, plane)
    header = found.program.header
    if header and header.lens_k1:
        import torch

        bent, shown = photo_from_straight(torch.from_numpy(at), header.lens_k1, size=found.size)
        at = np.where(shown.numpy()[..., None], bent.numpy(), -9.0)
    return remapped(photo.pixels, photo.valid, at)


def _upright(found: Objects, each: Object) -> np.ndarray:
    """The rotation [2, 2] of the plane that brings the object upright: rows are its right and its down."""
    outward = each.outward
    if outward is None:
        return np.eye(2)
    x, y = outward
    return np.array([[-y, x], [-x, -y]])

"""Crops of objects: what each pixel shows, and which pixels the photo knows."""

import numpy as np
import pytest
import torch

from p3i import loads
from p3i.export.crops import crops, write_crops
from p3i.interp.lens import photo_from_straight
from p3i.place.objects import objects_of
from p3i.size import Size
from p3i.vision.image import Image, read_image
from p3i.vision.sheet import project

SIZE = Size(240, 180)
LATTICE = """SetCameraPose(rx=-38, ry=14)
for i in range(-2, 3):
    for j in range(-3, 3):
        Draw(x=14*i - 1.2*j + 1, y=1.2*i + 14*j - 2)
"""
RING = """SetCameraPose(rx=-20, ry=8)
for j in range(0, 7):
    Draw(x=24*Cos(51.42857*j), y=24*Sin(51.42857*j))
"""
BENT = "# /// p3p\n# version = 1\n# lens_k1 = -0.12\n# ///\n"


def ramp(valid: np.ndarray | None = None) -> Image:
    """A photo whose red is the pixel's x and whose green is its y, in shares of the sides."""
    x, y = np.meshgrid(np.arange(SIZE.width) / SIZE.width, np.arange(SIZE.height) / SIZE.height)
    pixels = np.stack([x, y, np.full_like(x, 0.5)], -1).astype(np.float32)
    return Image(pixels, np.ones(x.shape, bool) if valid is None else valid)


@pytest.mark.parametrize("text", [LATTICE, RING, BENT + LATTICE], ids=["lattice", "ring", "bent"])
def test_a_straight_crop_shows_the_plane_around_its_object(text: str) -> None:
    program, photo = loads(text), ramp()
    found = objects_of(program, photo)
    seen = list(crops(found, photo))
    assert len(seen) == len(found.objects) > 6
    whole = 0
    for each, pixels, known in seen:
        height, width = known.shape
        cell = np.array(each.cell) - (each.x, each.y)
        turn = np.eye(2)
        if each.outward is not None:
            out = np.array(each.outward)
            turn = np.array([[-out[1], out[0]], -out])
        local = cell @ turn.T
        share = (np.array([width // 3, height // 4]) + 0.5) / (width, height)
        plane = (local.min(0) + share * np.ptp(local, axis=0)) @ turn + (each.x, each.y)
        at, _ = project(found.placed.image_from_plane, plane[None])
        if text.startswith(BENT):
            at = photo_from_straight(torch.from_numpy(at), -0.12, size=SIZE)[0].numpy()
        x, y = at[0]
        if not (0 < x < SIZE.width - 1 and 0 < y < SIZE.height - 1):
            continue
        whole += 1
        assert known[height // 4, width // 3]
        shown = pixels[height // 4, width // 3, :2] * (SIZE.width, SIZE.height)
        np.testing.assert_allclose(shown, (x, y), atol=0.06)
    assert whole > 6


@pytest.mark.parametrize("hole", [False, True])
def test_what_lies_beyond_the_photo_or_in_its_holes_is_not_known(hole: bool) -> None:
    valid = np.ones((SIZE.height, SIZE.width), bool)
    valid[80:84, 110:130] = not hole
    wide = LATTICE.replace("range(-2, 3)", "range(-6, 7)").replace("range(-3, 3)", "range(-6, 6)")
    photo = ramp(valid)
    found = objects_of(loads(wide), photo)
    partly = 0
    for each, pixels, known in crops(found, photo):
        cell, (height, width) = np.array(each.cell), known.shape
        low, extent = cell.min(0), np.ptp(cell, axis=0)
        grid = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in (width, height))), -1)
        at, _ = project(found.placed.image_from_plane, low + grid * extent)
        inside = ((at >= 0) & (at <= (SIZE.width - 1, SIZE.height - 1))).all(-1)
        near = np.clip(np.floor(at).astype(int), 0, (SIZE.width - 2, SIZE.height - 2))
        x, y = near[..., 0], near[..., 1]
        expected = inside & valid[y, x] & valid[y + 1, x] & valid[y, x + 1] & valid[y + 1, x + 1]
        # A point that all but lies on a pixel centre may count either way.
        assert (known != expected).mean() < 0.01
        partly += not known.all()
        assert pixels.dtype == np.float32
    assert partly >= (10 if hole else 8)


def test_written_crops_are_the_crops_to_the_nearest_of_256_values(tmp_path) -> None:
    program, photo = loads(LATTICE), ramp()
    found = objects_of(program, photo)
    paths = write_crops(found, tmp_path)
    for path, (each, pixels, known) in zip(paths, crops(found, photo), strict=True):
        again = read_image(path)
        assert path.stem == each.name
        np.testing.assert_array_equal(again.valid, known)
        off = np.abs(again.pixels - pixels)[known]
        assert off.max() <= 0.5 / 255 + 1e-5


def test_a_straight_crop_has_as_many_pixels_as_its_cell_on_the_photo() -> None:
    """The longest side of the upright box, here nearly the cell, keeps its pixels, near or far."""
    found = objects_of(loads(LATTICE), ramp())
    for each, pixels, _ in crops(found, ramp()):
        if len(each.cell_px) != 4 or not each.inside:
            continue
        corners = np.array(each.cell_px)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max()
        assert 0.9 < max(pixels.shape[:2]) / longest < 1.35

"""Straightened views: where the lattice comes to lie, what is known, how sharp it is, and the way back."""

import cv2
import numpy as np
import pytest

from p3i import loads
from p3i.paint.rectify import Rectified, rectify
from p3i.paint.rectify_options import CROPS
from p3i.size import Size
from p3i.vision.decode import Source
from p3i.vision.image import Image
from p3i.vision.sheet import project

LATTICE = """SetCameraPose(rx=-38, ry=14)
for i in range(-3, 4):
    for j in range(-3, 4):
        Draw(x=8*i + 1.2*j + 1, y=-1.2*i + 8*j - 2)
"""
RING = """SetCameraPose(rx=-30, ry=10)
for i in range(0, 6):
    Draw(x=10*Cos(60*i), y=10*Sin(60*i))
"""
CANVAS = Size(480, 360)


def scene(program_text: str = LATTICE, *, size: Size = CANVAS, header: str = "") -> Rectified:
    """A rendered scene of discs with a spot, in a view of default options."""
    program = loads(header + program_text)
    view = rectify(
        Image(np.zeros((size.height, size.width, 3), np.float32), np.ones((size.height, size.width), bool)),
        program,
    )
    finer = 3
    canvas = np.full((size.height * finer, size.width * finer, 3), (170, 180, 190), np.uint8)
    laid = view.view.placed
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    for point in laid.points:
        for radius, offset, colour in ((2.6, 0.0, (40, 60, 120)), (0.9, 1.0, (240, 220, 90))):
            rim = point + offset + radius * np.stack([np.cos(turn), np.sin(turn)], 1)
            at, front = project(laid.image_from_plane, rim)
            if front.all():
                places = np.round(((at + 0.5) * finer - 0.5) * 16).astype(np.int32)
                cv2.fillPoly(canvas, [places], colour, cv2.LINE_AA, 4)
    pixels = cv2.resize(canvas, (size.width, size.height), interpolation=cv2.INTER_AREA)
    photo = Image(pixels.astype(np.float32) / 255, np.ones(pixels.shape[:2], bool), source=Source("PNG"))
    return rectify(photo, program)


def centers_in_view(found: Rectified) -> np.ndarray:
    matrix = found.view.view_from_pinhole
    pixels, _ = found.view.placed.centers_px()
    return project(matrix, pixels)[0]


@pytest.mark.parametrize("crop", CROPS)
def test_the_homography_takes_the_lattice_to_an_exact_straight_grid(crop: str) -> None:
    found = rectify(scene().photo, loads(LATTICE), crop=crop)
    index, at = found.view.placed.index, centers_in_view(found)
    u, v = (np.array(found.record()[name]) for name in ("u", "v"))
    expected = np.array(found.record()["origin"]) + index[:, :1] * u + index[:, 1:] * v
    np.testing.assert_allclose(at, expected, atol=1e-6)
    assert abs(u[1]) < 1e-9 and u[0] > 0, "u runs to the right"
    assert u @ v == pytest.approx(0, abs=1e-6)


def test_an_unedited_view_leaves_the_photo_as_it_is_to_the_bit() -> None:
    found = scene()
    painted = found.paint()
    alpha = None if painted.alpha is None else painted.alpha.astype(np.float32) / 255
    edited = Image(
        painted.values.astype(np.float32) / 255,
        np.ones(painted.values.shape[:2], bool),
        source=Source("PNG", alpha=alpha),
    )
    returned = found.back(edited)
    assert returned.changed == 0
    np.testing.assert_array_equal(returned.picture.values, np.rint(found.photo.pixels * 255).astype(np.uint8))

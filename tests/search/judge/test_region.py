"""The region of a photo on which a program holds."""

import numpy as np
import torch

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.interp.lens import straight_from_photo
from p3i.search.judge.region import centers_px, region_px
from p3i.vision.image import Image

GRID = """\
SetCameraPose(rx=0, ry=0)
for i in range(0, 3):
    for j in range(0, 2):
        Draw(x=10*i + {x}, y=10*j)
"""
PHOTO = Image(np.zeros((150, 200, 3), np.float32), np.ones((150, 200), bool))


def grid(x: float = 0.0) -> Program:
    program = parse(GRID.format(x=x))
    assert isinstance(program, Program)
    return program


def test_the_region_is_the_hull_of_the_cells() -> None:
    # Two pixels to a unit; the middle is (99.5, 74.5); cells reach half a step, 10 px, beyond the objects.
    low, high = np.array([99.5 - 10, 74.5 - 10]), np.array([99.5 + 50, 74.5 + 30])
    corners = np.array(region_px(grid(), PHOTO, 35.0))
    np.testing.assert_allclose(corners.min(0), low, atol=1e-3)
    np.testing.assert_allclose(corners.max(0), high, atol=1e-3)


def test_the_region_ends_at_the_frame() -> None:
    corners = np.array(region_px(grid(x=35.0), PHOTO, 35.0))
    assert len(centers_px(grid(x=35.0), PHOTO, 35.0)) == 4
    assert corners[:, 0].max() == 199


def test_a_program_outside_the_picture_has_no_region() -> None:
    assert region_px(grid(x=500.0), PHOTO, 35.0) == ()


def test_centres_lie_where_the_lens_shows_them() -> None:
    plain = torch.tensor([center[:2] for center in centers_px(grid(), PHOTO, 35.0)], dtype=torch.float64)
    bent = torch.tensor(
        [center[:2] for center in centers_px(grid(), PHOTO, 35.0, lens_k1=-0.2)], dtype=torch.float64
    )
    assert float((bent - plain).abs().max()) > 0.5
    torch.testing.assert_close(straight_from_photo(bent, -0.2, size=PHOTO.size), plain, atol=1e-6, rtol=0)

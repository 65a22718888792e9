"""A program on its photo: objects in order, the focal's sources, and the lattice basis."""

import numpy as np
import pytest

from p3i import loads
from p3i.errors import ProgramError
from p3i.interp.camera import Camera
from p3i.place.flat import flat_of
from p3i.place.placed import placed
from p3i.size import Size
from p3i.vision.image import Image

LATTICE = """SetCameraPose(rx=-30, ry=10)
for i in range(-2, 3):
    for j in range(-1, 2):
        Draw(x=8*i + 2*j + 1, y=6*j - 2)
"""
RING = """SetCameraPose(rx=-30, ry=10)
for i in range(0, 7):
    Draw(x=10*Cos(360/6*i), y=10*Sin(360/6*i))
"""


def blank(width: int = 400, height: int = 300, focal_mm: float | None = None) -> Image:
    return Image(np.zeros((height, width, 3), np.float32), np.ones((height, width), bool), focal_mm)


def test_objects_lie_where_the_camera_sees_their_points() -> None:
    found = placed(loads(LATTICE), blank())
    matrix = Camera(-30, 10).image_from_plane(Size(400, 300)).numpy()
    at = matrix @ np.array([8 * -2 + 2 * -1 + 1, 6 * -1 - 2, 1.0])
    np.testing.assert_allclose(found.centers_px()[0][0], at[:2] / at[2])
    assert found.index[0].tolist() == [-2, -1]
    assert len(found.index) == 15


def test_a_lattice_has_a_basis_and_a_ring_none() -> None:
    np.testing.assert_allclose(placed(loads(LATTICE), blank()).basis, [[8, 0], [2, 6]])
    np.testing.assert_allclose(placed(loads(LATTICE), blank()).origin, [1, -2])
    assert placed(loads(RING), blank()).basis is None


def test_coinciding_draws_are_one_object() -> None:
    assert len(placed(loads(RING), blank()).index) == 6


@pytest.mark.parametrize(
    ("header", "given", "exif", "expected"),
    [("", None, None, 35.0), ("", None, 50.0, 50.0), ("28", None, 50.0, 28.0), ("28", 85.0, 50.0, 85.0)],
)
def test_the_focal_is_the_callers_then_the_headers_then_the_photos(
    header: str, given: float | None, exif: float | None, expected: float
) -> None:
    text = f"# /// p3p\n# version = 1\n# focal = {header}.0\n# ///\n" if header else ""
    assert placed(loads(text + LATTICE), blank(focal_mm=exif), focal_mm=given).camera.focal_mm == expected


def test_only_objects_on_the_photo_are_in_sight() -> None:
    wide = LATTICE.replace("range(-2, 3)", "range(-20, 21)")
    found = placed(loads(wide), blank())
    pixels, front = found.centers_px()
    seen = found.in_sight()
    assert 0 < seen.sum() < len(seen)
    assert (pixels[seen] >= -0.5).all() and front[seen].all()


def test_a_program_behind_the_camera_is_refused_by_name() -> None:
    with pytest.raises(ProgramError, match="in front of its camera"):
        placed(loads("SetCameraPose(rx=80, ry=0)\nfor i in range(0, 3):\n    Draw(x=i, y=-900)\n"), blank())


def test_a_photo_is_laid_flat_only_where_the_header_names_a_lens() -> None:
    photo = blank()
    assert flat_of(photo, loads(LATTICE)).photo is photo
    bent = loads("# /// p3p\n# version = 1\n# lens_k1 = -0.1\n# ///\n" + LATTICE)
    flat = flat_of(photo, bent)
    # Seen straight a corner lies 1 / (1 + k1) times as far out, and the canvas holds it.
    assert flat.photo.size.width == pytest.approx(400 / 0.9, abs=2)
    assert flat.seen.any() and not flat.seen[0, flat.photo.size.width // 2]


def test_objects_a_million_units_away_are_counted_and_not_placed() -> None:
    text = LATTICE.replace("8*i + 2*j + 1", "600000*i").replace("range(-2, 3)", "range(0, 4)")
    found = placed(loads(text), blank())
    assert (len(found.index), found.far) == (6, 6)

import math

import numpy as np
import pytest
from PIL import Image as Pil
from PIL.TiffImagePlugin import IFDRational

from p3i.size import Size
from p3i.vision.exif import focal_from_exif
from p3i.vision.image import read_image

FULL = Size(4000, 3000)


def exif_of(**tags) -> Pil.Exif:
    numbers = {
        "focal": 0x920A,
        "plane_x": 0xA20E,
        "plane_y": 0xA20F,
        "unit": 0xA210,
        "equivalent": 0xA405,
        "width": 0xA002,
        "height": 0xA003,
    }
    exif = Pil.Exif()
    block = exif.get_ifd(0x8769)
    for name, value in tags.items():
        block[numbers[name]] = value
    return exif


def test_the_35_mm_figure_refers_to_the_diagonal():
    # A 4:3 phone with a 26 mm-equivalent lens: f_px = 26 * 5000 / 43.27.
    found = focal_from_exif(exif_of(equivalent=26), FULL)
    f_px = 26 * 5000 / 43.27
    assert found.focal_mm == pytest.approx(f_px * 36 / 4000)
    assert found.focal_mm == pytest.approx(27.04, abs=0.01)


def test_on_a_3_to_2_picture_the_figure_is_the_focal():
    assert focal_from_exif(exif_of(equivalent=50), Size(6000, 4000)).focal_mm == pytest.approx(50, abs=0.01)


def test_a_smaller_copy_has_the_same_focal():
    tags = {"equivalent": 26, "width": 4000, "height": 3000}
    assert focal_from_exif(exif_of(**tags), Size(400, 300)).focal_mm == pytest.approx(27.04, abs=0.01)


def test_a_turned_copy_has_the_same_focal():
    tags = {"equivalent": 26, "width": 4000, "height": 3000}
    assert focal_from_exif(exif_of(**tags), Size(3000, 4000)).focal_mm == pytest.approx(27.04, abs=0.01)


@pytest.mark.parametrize(("figure", "exact"), [(26, True), (25, False), (27, False)])
def test_what_the_figure_was_rounded_from_wins_over_it_where_the_sensor_tells(
    figure: int, exact: bool
) -> None:
    """A sensor that gives 26.4 mm beside a figure of 26 is that lens; beside others it is a mistake."""
    f_px = 26.4 * 5000 / 43.27
    tags = {"focal": 4.2, "plane_x": f_px / 4.2, "unit": 4, "width": 4000, "height": 3000}
    found = focal_from_exif(exif_of(equivalent=figure, **tags), FULL).focal_mm
    expected = f_px if exact else figure * 5000 / 43.27
    assert found == pytest.approx(expected * 36 / 4000, rel=1e-6)


def test_a_cropped_picture_has_no_known_focal():
    found = focal_from_exif(exif_of(equivalent=26, width=4000, height=3000), Size(2000, 2000))
    assert found.focal_mm is None
    assert found.note is not None and "cropped" in found.note


@pytest.mark.parametrize(
    ("unit", "per_mm"), [(2, 1 / 25.4), (3, 1 / 10), (4, 1.0)], ids=["inch", "centimetre", "millimetre"]
)
def test_the_focal_plane_resolution_serves_where_the_figure_is_missing(unit, per_mm):
    # A sensor 22.3 mm wide with 4000 pixels and a 50 mm lens: an angle like 80.7 mm on 36 mm.
    resolution = 4000 / 22.3 / per_mm
    tags = {"focal": 50.0, "plane_x": resolution, "plane_y": resolution, "unit": unit}
    found = focal_from_exif(exif_of(**tags, width=4000, height=3000), FULL)
    assert found.focal_mm == pytest.approx(50 / 22.3 * 36, rel=1e-6)


def test_the_focal_plane_resolution_is_of_the_picture_as_captured():
    tags = {"focal": 50.0, "plane_x": 4000 / 22.3, "unit": 4, "width": 4000, "height": 3000}
    assert focal_from_exif(exif_of(**tags), Size(400, 300)).focal_mm == pytest.approx(
        50 / 22.3 * 36, rel=1e-6
    )


def test_a_sensor_that_cannot_exist_is_not_believed():
    found = focal_from_exif(exif_of(focal=50.0, plane_x=72, plane_y=72, unit=2), FULL)
    assert found.focal_mm is None
    assert found.note is not None and "sensor" in found.note


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {"focal": 50.0},
        {"equivalent": 0},
        {"equivalent": "wide"},
        {"focal": IFDRational(0, 0), "plane_x": 100.0},
        {"focal": 50.0, "plane_x": 180.0, "plane_y": 90.0, "unit": 4},
        {"focal": 50.0, "plane_x": 180.0, "unit": 9},
    ],
)
def test_what_exif_does_not_know_stays_unknown(tags):
    assert focal_from_exif(exif_of(**tags), FULL).focal_mm is None


def test_an_absurd_figure_is_told_and_not_used():
    found = focal_from_exif(exif_of(equivalent=60000), FULL)
    assert found.focal_mm is None
    assert found.note is not None and "mm" in found.note


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".webp"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_the_focal_is_found_in_files(tmp_path, suffix, orientation):
    exif = exif_of(equivalent=28)
    exif[0x0112] = orientation
    path = tmp_path / f"a{suffix}"
    Pil.fromarray(np.zeros((30, 40, 3), np.uint8)).save(path, exif=exif.tobytes())
    expected = 28 * math.hypot(30, 40) / 43.27 * 36 / 40
    assert read_image(path).focal_mm == pytest.approx(expected)

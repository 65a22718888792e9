"""EXIF of written pictures: a focal that is theirs or none, read back from the file."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from marked import LATTICE, drawn
from PIL import Image as Pil

from p3i import loads
from p3i.grammar.ast import Program
from p3i.options.extend import Margins
from p3i.paint.edit.edit import edit
from p3i.paint.edit.extend import extend
from p3i.paint.fill.inpaint import inpaint
from p3i.paint.straight.rectify import rectify
from p3i.paint.straight.tile import tile
from p3i.vision.image import Image, read_image
from p3i.vision.picture import Picture, picture_kind

PROGRAM = loads(LATTICE)
SPARSER = loads(LATTICE.replace("9*i", "18*i").replace("range(-4, 5)", "range(-2, 3)"))
BENT = loads("# /// p3p\n# version = 1\n# lens_k1 = -0.05\n# ///\n" + LATTICE)
EXIF_BLOCK, FOCAL_35, FOCAL, PLANE_X, PLANE_UNIT = 0x8769, 0xA405, 0x920A, 0xA20E, 0xA210
WIDTH, HEIGHT, SUBJECT_AREA, MAKE, SUFFIXES = (
    0xA002,
    0xA003,
    0x9214,
    0x010F,
    (".jpg", ".png", ".tif", ".webp"),
)


def photographed(folder: Path, tags: dict[int, object], *, name: str = "photo.jpg") -> Image:
    """The drawn lattice as a camera would have written it, with these EXIF tags, read."""
    exif = Pil.Exif()
    exif[MAKE] = "Camera"
    exif.get_ifd(EXIF_BLOCK).update(tags)
    values = np.rint(drawn(LATTICE).pixels * 255).astype(np.uint8)
    Pil.fromarray(values).save(folder / name, quality=95, exif=exif)
    return read_image(folder / name)


def exif_of(picture: Picture, *, kind: str = "jpg") -> dict[int, object]:
    with Pil.open(io.BytesIO(picture.encode(kind))) as written:
        found = written.getexif()
        return {**dict(found), **dict(found.get_ifd(EXIF_BLOCK))}


def widened(photo: Image, by: Margins, program: Program = PROGRAM) -> Picture:
    return extend(photo, program, by=by, beyond="continue").paint()


STAYING: dict[str, Callable[[Image], Picture]] = {
    "edit": lambda photo: edit(photo, PROGRAM, SPARSER).paint(),
    "inpaint": lambda photo: inpaint(photo, PROGRAM, remove=[(0, 0)]).paint(),
    "rectify --back": lambda photo: rectify(photo, PROGRAM).back(edited(photo)).picture,
}
STRAIGHT: dict[str, Callable[[Image], Picture]] = {
    "rectify": lambda photo: rectify(photo, PROGRAM).paint(),
    "rectify --crop same": lambda photo: rectify(photo, PROGRAM, crop="same").paint(),
    "rectify --crop inside": lambda photo: rectify(photo, PROGRAM, crop="inside").paint(),
    "tile": lambda photo: tile(photo, PROGRAM).paint(),
    "extend to one side": lambda photo: widened(photo, Margins(40, 0, 0, 0)),
}


def edited(photo: Image) -> Image:
    painted = rectify(photo, PROGRAM).paint()
    values = painted.values.astype(np.float32) / 255
    values[40:60, 40:60] = 1
    return Image(values, np.ones(values.shape[:2], bool))


@pytest.mark.parametrize(
    ("tags", "program"),
    [
        ({FOCAL_35: 28}, PROGRAM),
        ({FOCAL_35: 28}, BENT),
        ({FOCAL: 4.15, PLANE_X: 480 / 5.3, PLANE_UNIT: 4}, PROGRAM),
    ],
)
def test_a_picture_extended_alike_on_all_sides_has_the_focal_of_its_wider_view(
    tags: dict[int, object], program: Program, tmp_path: Path
) -> None:
    """A lens of so many pixels stays one: on a wider canvas that is a shorter lens."""
    photo = photographed(tmp_path, tags)
    assert photo.focal_mm is not None
    focal_px = photo.focal_mm / 36 * 480
    picture = widened(photo, Margins(90, 60, 90, 60), program)
    for suffix in SUFFIXES:
        picture.save(tmp_path / f"wide{suffix}")
        found = read_image(tmp_path / f"wide{suffix}")
        assert (found.size.width, found.size.height) == (480 + 180, 400 + 120)
        assert found.focal_mm is not None
        assert found.focal_mm / 36 * 660 == pytest.approx(focal_px, rel=1e-4)


def test_other_programs_find_the_new_focal_rounded_as_exif_rounds_it(tmp_path: Path) -> None:
    found = exif_of(widened(photographed(tmp_path, {FOCAL_35: 28}), Margins(90, 60, 90, 60)))
    diagonals = np.hypot(480, 400) / np.hypot(660, 520)
    assert found[FOCAL_35] == round(28 * diagonals)
    assert (found[WIDTH], found[HEIGHT]) == (660, 520)


@pytest.mark.parametrize("verb", STRAIGHT)
def test_a_view_that_no_camera_has_at_its_middle_keeps_no_focal(verb: str, tmp_path: Path) -> None:
    photo = photographed(tmp_path, {FOCAL_35: 28, FOCAL: 4.15, WIDTH: 480, HEIGHT: 400})
    picture = STRAIGHT[verb](photo)
    for suffix in SUFFIXES:
        picture.save(tmp_path / f"made{suffix}")
        assert read_image(tmp_path / f"made{suffix}").focal_mm is None
        left = exif_of(picture, kind=picture_kind(f"made{suffix}"))
        assert not {FOCAL_35, FOCAL, PLANE_X} & set(left)
        assert left.get(MAKE, "Camera") == "Camera"


@pytest.mark.parametrize("verb", STAYING)
def test_a_photo_that_is_retouched_keeps_its_focal(verb: str, tmp_path: Path) -> None:
    photo = photographed(tmp_path, {FOCAL_35: 28, WIDTH: 480, HEIGHT: 400})
    picture = STAYING[verb](photo)
    for suffix in SUFFIXES:
        picture.save(tmp_path / f"made{suffix}")
        assert read_image(tmp_path / f"made{suffix}").focal_mm == photo.focal_mm


def test_a_cropped_photo_does_not_regain_a_focal_by_growing_to_the_recorded_shape(tmp_path: Path) -> None:
    photo = photographed(tmp_path, {FOCAL_35: 28, WIDTH: 660, HEIGHT: 440})
    assert photo.focal_mm is None
    widened(photo, Margins(90, 20, 90, 20)).save(tmp_path / "wide.jpg")
    assert read_image(tmp_path / "wide.jpg").focal_mm is None


@pytest.mark.parametrize("verb", ["rectify", "rectify --crop same", "extend to one side"])
def test_what_exif_says_of_places_in_the_old_picture_goes(verb: str, tmp_path: Path) -> None:
    photo = photographed(tmp_path, {SUBJECT_AREA: (100, 90, 40, 40), WIDTH: 480, HEIGHT: 400})
    picture = STRAIGHT[verb](photo)
    found = exif_of(picture)
    assert SUBJECT_AREA not in found
    assert (found[WIDTH], found[HEIGHT]) == (picture.size.width, picture.size.height)
    assert SUBJECT_AREA in exif_of(STAYING["edit"](photo))

"""Photos bent by their lens: what lies in the corners that barrel distortion draws in is worked on too."""

import dataclasses

import numpy as np
import pytest
from marked import LATTICE, drawn

from p3i import loads
from p3i.grammar.ast import Affine, Header, Program
from p3i.grammar.leaves import map_affines
from p3i.interp.lens import straight_from_photo
from p3i.options.extend import Margins
from p3i.paint.draw.render import render
from p3i.paint.edit.edit import edit
from p3i.paint.edit.extend import extend
from p3i.paint.fill.inpaint import inpaint
from p3i.paint.straight.rectify import rectify
from p3i.paint.straight.tile import tile
from p3i.place.objects import objects_of
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid, remapped

MARGIN, K1 = 60, -0.15
ENDLESS = LATTICE.replace("range(-4, 5)", "range(-14, 15)").replace("range(-3, 4)", "range(-10, 11)")
RATIO = 480 / (480 - 2 * MARGIN)
FOCAL = 35 * RATIO
CORNERS = [(slice(0, 18), slice(0, 18)), (slice(0, 18), slice(-18, None)), (slice(-18, None), slice(0, 18))]
CORNER_IDS = ["upper left", "upper right", "lower left"]


def lens(text: str, *, k1: float = K1) -> Program:
    """The program in the units of the bent photo, whose longer side is shorter than the drawn picture's."""

    def change(path: str, form: Affine) -> Affine:
        if not path.startswith("draw.") or path.endswith(".angle"):
            return form
        return dataclasses.replace(form, i=form.i * RATIO, j=form.j * RATIO, constant=form.constant * RATIO)

    return dataclasses.replace(map_affines(loads(text), change), header=Header(focal_mm=FOCAL, lens_k1=k1))


def bent(text: str = ENDLESS) -> Image:
    """What the lens makes of the middle of the drawn picture: 360 x 280 pixels."""
    whole, size = drawn(text), Size(480 - 2 * MARGIN, 400 - 2 * MARGIN)
    at = straight_from_photo(pixel_grid(size), K1, size=size).numpy() + MARGIN
    pixels, known = remapped(whole.pixels, whole.valid, at)
    assert known.all()
    return Image(pixels, known)


@pytest.mark.parametrize("corner", CORNERS, ids=CORNER_IDS)
@pytest.mark.parametrize("transparent", [False, True])
def test_a_hole_in_a_corner_of_a_bent_photo_is_filled_with_its_pattern(
    corner: tuple[slice, slice], transparent: bool
) -> None:
    photo = bent()
    hole = np.zeros(photo.valid.shape, bool)
    hole[corner] = True
    hidden = np.where(hole[:, :, None], np.float32(0), photo.pixels)
    given = dataclasses.replace(photo, pixels=hidden, valid=~hole if transparent else photo.valid)
    found = inpaint(given, lens(ENDLESS), mask=None if transparent else hole)
    assert np.array_equal(found.hole, hole) and found.unlike < 0.1
    assert np.array_equal(found.pixels[~hole], photo.pixels[~hole])
    wrong = np.abs(found.pixels - photo.pixels)[hole].mean() * 255
    assert wrong < 12, f"mean L1 {wrong:.1f}"


def test_objects_in_the_corners_of_a_bent_photo_are_removed_too() -> None:
    photo = bent()
    sparse = ENDLESS.replace("range(-14, 15)", "range(-14, -8)")
    found = edit(photo, lens(ENDLESS), lens(sparse))
    assert np.array_equal(found.pixels[~found.touched], photo.pixels[~found.touched])
    assert 0.2 < found.touched.mean() < 0.9
    marks = photo.pixels[:, :, 2] < 0.3
    for corner in CORNERS:
        left = found.pixels[corner][:, :, 2] < 0.3
        assert marks[corner].sum() > 40
        assert left.sum() < 0.25 * marks[corner].sum()


def test_a_wider_picture_shows_what_the_photos_corners_show() -> None:
    """The straight photo reaches into the new margin; what it shows there is no invention."""
    photo = bent()
    red = photo.pixels.copy()
    red[:14, :14] = (1.0, 0.0, 0.0)
    found = extend(dataclasses.replace(photo, pixels=red), lens(ENDLESS), by=Margins(24, 24, 24, 24))
    seen = (found.pixels[..., 0] > 0.9) & (found.pixels[..., 1] < 0.1)
    assert seen[:24].sum() > 60, "above the old frame"
    assert seen[:, :24].sum() > 60, "left of the old frame"


def test_objects_in_the_corners_are_judged() -> None:
    found = objects_of(lens(ENDLESS), bent())
    corner = [
        each for each in found.objects if each.x_px < 40 and each.y_px < 40 and min(each.x_px, each.y_px) > 12
    ]
    assert corner
    assert all(each.presence is not None and each.presence > 0.5 for each in corner)


def test_a_straight_drawing_shows_the_corners_of_the_photo() -> None:
    photo = bent()
    red = photo.pixels.copy()
    red[:14, :14] = (1.0, 0.0, 0.0)
    drawing = render(
        lens(LATTICE.replace("range(-4, 5)", "range(-9, 9)").replace("range(-3, 4)", "range(-10, 6)")),
        image=dataclasses.replace(photo, pixels=red),
        plane=True,
        markers=False,
    )
    pixels = drawing.pixels().astype(int)
    assert ((pixels[..., 0] > 230) & (pixels[..., 1] < 30)).sum() > 100


def test_a_program_whose_objects_lie_in_a_corner_alone_is_in_sight() -> None:
    photo, whole = bent(), lens(ENDLESS)
    listed = objects_of(whole, photo).objects
    first = min(listed, key=lambda each: each.x_px + each.y_px)
    rows = [each for each in listed if (each.i, each.j) == (first.i, first.j)]
    assert rows
    alone = ENDLESS.replace("range(-14, 15)", f"range({first.i}, {first.i + 1})")
    alone = lens(alone.replace("range(-10, 11)", f"range({first.j}, {first.j + 1})"))
    assert rectify(photo, alone).size.width > 0
    assert tile(photo, alone).size.width > 0

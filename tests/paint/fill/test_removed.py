"""Objects taken away: the ground goes on under them as the gaps show it, lines straight on."""

import numpy as np
import pytest
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.paint.fill.cutout import cutout
from p3i.paint.fill.holes import CHANGED
from p3i.paint.fill.inpaint import inpaint
from p3i.paint.fill.through import continuations, through
from p3i.place.placed import placed
from p3i.vision.image import Image
from p3i.vision.sheet import project

INK = (0.2, 0.1, 0.3)


def plane_of(text: str) -> np.ndarray:
    """Where the pixels of a drawn program lie on its plane: [H, W, 2]."""
    photo = drawn(text)
    x, y = np.meshgrid(np.arange(photo.size.width), np.arange(photo.size.height))
    laid = placed(loads(text), photo)
    return project(np.linalg.inv(laid.image_from_plane), np.stack([x, y], -1).astype(float))[0]


def with_objects(text: str, ground: np.ndarray, *, radius: float) -> Image:
    """A photo of a ground [H, W, 3] with discs at the objects of a program."""
    plane, pixels = plane_of(text), ground.copy()
    for point in placed(loads(text), drawn(text)).points:
        pixels[np.hypot(*np.moveaxis(plane - point, -1, 0)) < radius] = INK
    return Image(pixels, np.ones(ground.shape[:2], bool))


def barred(text: str, axis: int, *, at: float) -> np.ndarray:
    """A ground with bars across an axis, `at` units from each object."""
    plane, laid = plane_of(text), placed(loads(text), drawn(text))
    away = (plane[..., axis] - laid.origin[axis] - at + 4.5) % 9 - 4.5
    return np.where((np.abs(away) < 0.8)[..., None], np.float32((0.1, 0.3, 0.5)), np.float32(0.75))


@pytest.mark.parametrize("axis", [0, 1])
def test_bars_between_objects_stay_between_them(axis: int) -> None:
    """Half a step away there are bars: texture copied from there would put them under the objects."""
    ground = barred(LATTICE, axis, at=4.5)
    photo = with_objects(LATTICE, ground, radius=3.2)
    found = inpaint(photo, loads(LATTICE), remove=[(0, 0), (1, 1), (-2, 1)])
    assert np.abs(found.pixels - ground)[found.hole].mean() * 255 < 3
    assert np.array_equal(found.pixels[~found.hole], photo.pixels[~found.hole])
    assert found.removed == 3


def test_light_that_rises_over_the_photo_leaves_no_steps_between_removed_neighbours() -> None:
    """Each cell is lighter on one side: no ground of a cell, but light."""
    plane = plane_of(LATTICE)
    light = np.exp(0.012 * plane[..., :1]).astype(np.float32)
    ground = np.float32((0.6, 0.1, 0.15)) * light
    photo = with_objects(LATTICE, ground, radius=3.6)
    found = inpaint(photo, loads(LATTICE), remove=[(0, 0), (1, 0), (0, 1), (1, 1), (-1, 0), (-1, 1)])
    assert np.abs(found.pixels - ground)[found.hole].max() * 255 < 6
    assert found.hole.mean() < 0.12, "the ground between them is not taken for theirs"


def test_what_hangs_on_an_object_beyond_the_common_outline_goes_with_it() -> None:
    """One disc is larger than the others: its rim would stay as a ring."""
    ground = np.full((400, 480, 3), 0.75, np.float32)
    photo = with_objects(LATTICE, ground, radius=2.6)
    pixels, plane = photo.pixels.copy(), plane_of(LATTICE)
    laid = placed(loads(LATTICE), photo)
    one = laid.points[[tuple(index) == (1, 1) for index in laid.index.tolist()]][0]
    pixels[np.hypot(*np.moveaxis(plane - one, -1, 0)) < 3.1] = INK
    found = inpaint(Image(pixels, photo.valid), loads(LATTICE), remove=[(1, 1)])
    here = np.hypot(*np.moveaxis(plane - one, -1, 0)) < 4
    assert np.abs(found.pixels - ground)[here].max() * 255 < 8


def test_far_objects_are_taken_away_each_as_if_alone() -> None:
    photo = with_objects(LATTICE, barred(LATTICE, 0, at=4.5), radius=2.6)
    both = inpaint(photo, loads(LATTICE), remove=[(-4, -3), (4, 3)])
    for one in ((-4, -3), (4, 3)):
        alone = inpaint(photo, loads(LATTICE), remove=[one])
        assert np.array_equal(both.pixels[alone.hole], alone.pixels[alone.hole])


@pytest.mark.parametrize("axis", [0, 1])
def test_a_line_that_meets_an_object_on_both_sides_goes_on_under_it(axis: int) -> None:
    ground = barred(LATTICE, axis, at=0)
    photo = with_objects(LATTICE, ground, radius=2.6)
    found = inpaint(photo, loads(LATTICE), remove=[(0, 0), (2, -1)])
    assert np.abs(found.pixels - ground)[found.hole].mean() * 255 < 8


def test_the_rim_of_a_disc_goes_on_past_the_objects_of_a_ring() -> None:
    """The ground beyond the rim is another: it is neither an object nor what lies under one."""
    plane = plane_of(RING)
    inside = np.hypot(*np.moveaxis(plane, -1, 0)) < 31
    ground = np.where(inside[..., None], np.float32((0.8, 0.7, 0.6)), np.float32((0.2, 0.5, 0.3)))
    photo = with_objects(RING, ground, radius=2.5)
    laid = placed(loads(RING), photo)
    cut = cutout(laid, photo)
    assert cut.clear and 2.2 < cut.radius < 3.4
    found = inpaint(photo, loads(RING), remove=[(1, 0), (4, 0)])
    assert np.abs(found.pixels - ground)[found.hole].mean() * 255 < 3


def test_shadow_and_rim_go_with_their_object() -> None:
    ground = np.full((400, 480, 3), 0.7, np.float32)
    plane = plane_of(LATTICE)
    for point in placed(loads(LATTICE), drawn(LATTICE)).points:
        # A faint shadow to one side, fading out.
        away = np.hypot(*np.moveaxis(plane - point - (0.8, 0.8), -1, 0))
        ground -= (0.14 * np.exp(-((away / 2.9) ** 6)))[..., None].astype(np.float32)
    photo = with_objects(LATTICE, ground, radius=2.4)
    found = inpaint(photo, loads(LATTICE), remove=[(0, 0)])
    x, y = np.rint(placed(loads(LATTICE), photo).centers_px()[0][31]).astype(int)
    here = slice(y - 15, y + 15), slice(x - 18, x + 18)
    assert (photo.pixels[here] < 0.62).sum() > 900
    assert (found.pixels[here] < 0.62).sum() == 0, "nothing of object or shadow is left"


def test_one_removed_object_leaves_the_others_and_grain_looks_like_the_grounds() -> None:
    grain = 0.03 * np.random.default_rng(0).standard_normal((400, 480, 1)).astype(np.float32)
    photo = with_objects(LATTICE, np.float32(0.6) + np.repeat(grain, 3, 2), radius=3.6)
    found = inpaint(photo, loads(LATTICE), remove=["D5"])
    filled = found.pixels[found.hole]
    assert 0.015 < filled.std() < 0.045
    assert abs(float(filled.mean()) - 0.6) < 0.02
    assert CHANGED in found.notes


def test_what_is_removed_and_what_is_restored_differ() -> None:
    photo, program = drawn(LATTICE), loads(LATTICE)
    removed = inpaint(photo, program, remove=[(0, 0)])
    restored = inpaint(photo, program, restore=[(0, 0)])
    x, y = np.rint(placed(program, photo).centers_px()[0]).astype(int)[
        np.flatnonzero((placed(program, photo).index == 0).all(1))[0]
    ]
    assert restored.pixels[y, x, 2] < 0.4 < removed.pixels[y, x, 2]
    assert CHANGED not in restored.notes
    both = inpaint(photo, program, remove=[(0, 0)], restore=[(1, 0)])
    assert both.removed == 1 and len(both.holes) >= 1


def test_a_line_is_drawn_on_where_both_sides_show_it_and_nowhere_else() -> None:
    values = np.full((41, 41, 3), 0.5, np.float32)
    values[19:22] = 0
    values[:, 2:4] = 1  # beside the hole: no line through it
    known = np.ones((41, 41), bool)
    known[12:29, 12:29] = False
    given = np.where(known[..., None], values, np.float32(9))
    found = through(given, known, ~known, np.array([(1.0, 0), (0, 1)]))
    assert np.abs(found - values).mean() < 0.03
    along = continuations(given, known, np.array([(1.0, 0)]))[1]
    assert np.abs(along - values)[:, 12:29].max() < 1e-5

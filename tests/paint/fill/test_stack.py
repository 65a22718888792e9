"""Holes of many cells: each cell from its own sources, in the photo's own light, as sharp as the pattern."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.paint.fill import stack
from p3i.paint.fill.field import field_of
from p3i.paint.fill.looks import seam, sharpness
from p3i.paint.fill.pieces import drawn_on, pieces_of
from p3i.paint.fill.stack import fill_by_stack
from p3i.paint.fill.survey import survey_of
from p3i.place.moves import nearest
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image
from p3i.vision.sheet import project

DENSE = (
    LATTICE.replace("9*i", "6*i")
    .replace("9*j", "6*j")
    .replace("(-4, 5)", "(-6, 7)")
    .replace("(-3, 4)", "(-5, 6)")
)


def hidden(photo: Image, hole: np.ndarray) -> np.ndarray:
    return np.where(hole[:, :, None], np.float32(0), photo.pixels)


def box(photo: Image, left: float, top: float, right: float, bottom: float) -> np.ndarray:
    hole = np.zeros(photo.valid.shape, bool)
    height, width = hole.shape
    hole[int(top * height) : int(bottom * height), int(left * width) : int(right * width)] = True
    return hole


def filled(photo: Image, text: str, hole: np.ndarray) -> tuple[np.ndarray, np.ndarray, Placed]:
    laid = placed(loads(text), photo)
    result, bare = fill_by_stack(hidden(photo, hole), photo.valid, hole, laid)
    return result, bare, laid


def test_a_hole_of_thirty_cells_comes_back_in_the_lights_own_fall() -> None:
    """Deep in it nothing is seen around: light is told by all cells, not by what was filled before."""
    photo = drawn(DENSE)
    hole = box(photo, 0.25, 0.25, 0.75, 0.75)
    result, bare, _ = filled(photo, DENSE, hole)
    assert not bare.any()
    assert np.array_equal(result[~hole], photo.pixels[~hole])
    assert np.abs(result - photo.pixels)[hole].mean() * 255 < 4
    inner = box(photo, 0.42, 0.42, 0.58, 0.58)
    assert np.abs((result - photo.pixels)[inner].mean(0)).max() * 255 < 2


def test_a_hole_to_the_frame_is_filled_to_the_frame() -> None:
    photo = drawn(DENSE)
    hole = box(photo, 0.55, 0.3, 1, 0.7)
    laid = placed(loads(DENSE), photo)
    result, bare = fill_by_stack(hidden(photo, hole), photo.valid, hole, laid)
    inside = hole & (drawn_on(laid) > 0)
    assert not (bare & inside).any()
    assert np.abs(result - photo.pixels)[inside].mean() * 255 < 5


def test_two_colours_stay_two_colours() -> None:
    """Rows of two colours: what lies nearest tells which, and none becomes their mean."""
    photo = drawn(DENSE)
    laid = placed(loads(DENSE), photo)
    points = np.stack(np.meshgrid(*(np.arange(side) for side in photo.valid.shape[::-1])), -1).reshape(-1, 2)
    on_plane, _ = project(np.linalg.inv(laid.image_from_plane), points.astype(float))
    rows = laid.index[nearest(laid, on_plane), 1].reshape(photo.valid.shape)
    tint = np.where(rows[..., None] >= 0, np.float32([0.5, 0.7, 1.0]), np.float32([1.0, 0.7, 0.5]))
    photo = dataclasses.replace(photo, pixels=photo.pixels * tint)
    hole = box(photo, 0.3, 0.3, 0.6, 0.65)
    result, _, _ = filled(photo, DENSE, hole)
    for part in (hole & (rows >= 0), hole & (rows < 0)):
        assert part.sum() > 500
        assert np.abs((result - photo.pixels)[part].mean(0)).max() * 255 < 4


def test_grain_is_given_back() -> None:
    """A mean of twelve sources keeps a twelfth of the grain's energy."""
    photo = drawn(DENSE)
    grain = np.random.default_rng(3).normal(0, 0.05, photo.pixels.shape).astype(np.float32)
    photo = dataclasses.replace(photo, pixels=(photo.pixels + grain).clip(0, 1))
    hole = box(photo, 0.3, 0.3, 0.6, 0.6)
    result, _, laid = filled(photo, DENSE, hole)
    assert sharpness(result, photo.valid, hole, laid) > 0.6


def test_the_measures_tell_a_grey_patch_from_the_photo_itself() -> None:
    photo = drawn(DENSE)
    laid = placed(loads(DENSE), photo)
    hole = box(photo, 0.35, 0.35, 0.6, 0.6)
    grey = np.where(hole[:, :, None], np.float32(0.5), photo.pixels)
    assert sharpness(grey, photo.valid, hole, laid) < 0.01
    assert 0.8 < sharpness(photo.pixels, photo.valid, hole, laid) < 1.25
    assert 0.7 < seam(photo.pixels, photo.valid, hole, laid) < 1.4
    assert seam(grey, photo.valid, hole, laid) > 3


@pytest.mark.parametrize("text", [DENSE, RING])
def test_light_is_told_where_nothing_is_seen(text: str) -> None:
    """Levels of hidden cells follow the ramp that the picture is drawn in."""
    photo = drawn(text)
    laid = placed(loads(text), photo)
    at = laid.centers_px()[0]
    hole = box(photo, 0.3, 0.3, 0.55, 0.7)
    survey = survey_of(hidden(photo, hole), photo.valid & ~hole, laid)
    assert survey is not None
    inside = laid.in_sight()
    ramp = 0.65 + 0.25 * at[inside, 0] / photo.size.width
    levels = survey.levels[inside].mean(1) / survey.levels[inside].mean()
    np.testing.assert_allclose(levels, ramp / ramp.mean(), atol=0.03)


def test_every_hidden_pixel_has_one_piece() -> None:
    photo = drawn(DENSE)
    laid = placed(loads(DENSE), photo)
    hole = box(photo, 0.1, 0.2, 0.9, 0.8)
    hole[5:9, 5:9] = True
    pieces, labels = pieces_of(hole, drawn_on(laid), laid)
    assert (labels[hole] >= 0).all()
    assert set(np.unique(labels[hole])) == {piece.number for piece in pieces}
    for piece in pieces:
        rows, columns = np.nonzero(hole & (labels == piece.number))
        assert piece.box == (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)


def test_what_was_filled_is_no_source(monkeypatch: pytest.MonkeyPatch) -> None:
    """The order of the pieces does not change a pixel."""
    photo = drawn(DENSE)
    hole = box(photo, 0.3, 0.3, 0.7, 0.7)
    first, _, _ = filled(photo, DENSE, hole)

    def backwards(*given, **kept):
        pieces, labels = pieces_of(*given, **kept)
        return pieces[::-1], labels

    monkeypatch.setattr(stack, "pieces_of", backwards)
    second, _, _ = filled(photo, DENSE, hole)
    np.testing.assert_allclose(first, second, atol=1e-5)


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.integers(0, 1000))
def test_a_field_of_a_plane_is_that_plane(plane: list[float], seed: int) -> None:
    random = np.random.default_rng(seed)
    places = random.uniform(-10, 10, (20, 2))
    values = np.c_[np.ones(20), places] @ np.array(plane)[:, None]
    found = field_of(places, values, np.ones((20, 1, 1)), towards=np.zeros(1), spacing=2.0)
    asked = random.uniform(-10, 10, (5, 2))
    np.testing.assert_allclose(
        found.at(asked), np.c_[np.ones(5), asked] @ np.array(plane)[:, None], atol=1e-3
    )


def test_a_field_that_nothing_tells_is_what_it_is_drawn_towards() -> None:
    found = field_of(
        np.zeros((3, 2)), np.ones((3, 2)), np.zeros((3, 2, 2)), towards=np.array([4.0, 5.0]), spacing=1
    )
    np.testing.assert_allclose(found.at(np.zeros((2, 2))), [[4, 5], [4, 5]])

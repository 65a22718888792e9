"""Patterns that go on where the photo shows nothing: laws, and outlines that are seen beside a hole."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from marked import drawn

from p3i import loads
from p3i.place.continued import continued, followed
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image

RECTANGLE = """SetCameraPose(rx=-20, ry=8)
for i in range(-4, 5):
    for j in range(-3, 4):
        Draw(x=9*i + 1, y=9*j)
"""
TRIANGLE = RECTANGLE.replace("        Draw", "        if 3 - i - j >= 0:\n            Draw")
RING = """SetCameraPose(rx=-25, ry=5)
for i in range(0, 12):
    Draw(x=26*Cos(30*i), y=26*Sin(30*i))
"""
SIZE = {"width": 480, "height": 400}


def laid_on(photo: Image, text: str) -> Placed:
    return placed(loads(text), photo)


def added(found_on: Image, text: str, hole: np.ndarray) -> set[tuple[int, int]]:
    """What continues `text`, nothing of the hole read."""
    bare = dataclasses.replace(found_on, pixels=np.where(hole[:, :, None], np.float32(0), found_on.pixels))
    return {(int(i), int(j)) for i, j in continued(laid_on(bare, text), bare, hole=hole).index}


def at(text: str, i: float, j: float) -> np.ndarray:
    """The pixel of (i, j)."""
    laid = laid_on(drawn(RECTANGLE), text)
    x, y, depth = laid.image_from_plane @ np.append(laid.at(np.array([[i, j]]))[0], 1)
    return np.array([x, y]) / depth


def beside(
    *, right_of: float | None = None, above: float | None = None, below: float | None = None
) -> np.ndarray:
    """A hole [H, W]: what lies right of x, above y and below y."""
    rows, columns = np.mgrid[: SIZE["height"], : SIZE["width"]]
    hole = np.ones(rows.shape, bool)
    for inside in (
        right_of is None or columns > right_of,
        above is None or rows < above,
        below is None or rows > below,
    ):
        hole &= inside
    return hole


@pytest.mark.parametrize("text", [RECTANGLE, TRIANGLE, RING])
def test_with_nothing_hidden_the_photo_itself_adds_nothing(text: str) -> None:
    photo = drawn(text)
    laid = laid_on(photo, text)
    assert len(continued(laid, photo).index) == 0
    assert len(continued(laid, photo, hole=np.zeros(photo.valid.shape, bool)).index) == 0


@settings(max_examples=6, deadline=None)
@given(first=st.integers(-2, 3), seed=st.integers(0, 3))
def test_columns_that_were_hidden_come_back(first: int, seed: int) -> None:
    """From column `first` on all is hidden, up to the frame; the program found ends there."""
    photo = drawn(RECTANGLE, seed=seed)
    hole = beside(right_of=float(min(at(RECTANGLE, first - 0.5, j)[0] for j in (-3, 3))))
    known = RECTANGLE.replace("range(-4, 5)", f"range(-4, {first})")
    found = added(photo, known, hole)
    assert {(i, j) for i in range(first, 5) for j in range(-3, 4)} <= found
    assert {j for _, j in found} == set(range(-3, 4)), "rows end where they are seen to end"


def test_a_corner_whose_sides_are_seen_is_straight() -> None:
    """The search cut the hidden corner off by a guard: both ranges are seen to end beside the hole."""
    x, y = at(RECTANGLE, 0.6, -0.6)
    cut = RECTANGLE.replace("        Draw", "        if 4 - i + j >= 0:\n            Draw")
    gone = {(i, j) for i in range(-4, 5) for j in range(-3, 4) if i - j > 4}
    assert added(drawn(RECTANGLE), cut, beside(right_of=x, above=y)) == gone


def test_an_outline_seen_on_both_sides_of_a_hole_stays() -> None:
    photo = drawn(RECTANGLE.replace("range(-4, 5)", "range(-4, 2)"))
    program = RECTANGLE.replace("range(-4, 5)", "range(-4, 2)")
    (_, above), (x, below) = at(program, 0, -1.2), at(program, 0.6, 1.2)
    hole = beside(right_of=x) & beside(below=above) & beside(above=below)
    assert hole.sum() > 5000
    assert added(photo, program, hole) == set()


def test_a_slanted_outline_goes_straight_on() -> None:
    photo = drawn(TRIANGLE)
    x, y = at(TRIANGLE, 1.5, 0.5)
    hole = beside(right_of=x, below=y)
    assert added(photo, TRIANGLE, hole) == set()


def test_a_row_between_the_program_and_the_hole_that_is_cut_is_reached_too() -> None:
    """Column 1 is cut by the hole, could not be judged, and is not in the program."""
    photo = drawn(RECTANGLE)
    hole = beside(right_of=at(RECTANGLE, 0.9, 0)[0])
    found = added(photo, RECTANGLE.replace("range(-4, 5)", "range(-4, 1)"), hole)
    assert {(i, j) for i in range(1, 5) for j in range(-3, 4)} <= found


@pytest.mark.parametrize("first", [2, 9])
def test_an_arc_goes_on_under_the_hole_and_meets_itself_once(first: int) -> None:
    """Three objects of a ring are hidden; the arc found begins after them, or ends before."""
    photo = drawn(RING)
    hidden = {i % 12 for i in range(9, 12)}
    pixels = np.array([at(RING, i, 0) for i in range(9, 12)])
    rows, columns = np.mgrid[: SIZE["height"], : SIZE["width"]]
    hole = np.min([np.hypot(columns - x, rows - y) for x, y in pixels], axis=0) < 35
    start = 0 if first == 9 else -12
    arc = RING.replace("range(0, 12)", f"range({start}, {start + 9})")
    found = added(photo, arc, hole)
    assert {i % 12 for i, _ in found} == hidden
    assert len(found) == len(hidden)


def test_an_arc_that_is_seen_to_end_under_a_hole_near_by_ends_there() -> None:
    """Objects 6 to 11 are not there; a hole hides the place of 6 and 7."""
    arc = RING.replace("range(0, 12)", "range(0, 6)")
    photo = drawn(arc)
    pixels = np.array([at(RING, i, 0) for i in (9, 10)])
    rows, columns = np.mgrid[: SIZE["height"], : SIZE["width"]]
    hole = np.min([np.hypot(columns - x, rows - y) for x, y in pixels], axis=0) < 30
    assert added(photo, arc, hole) == set(), "beside the hole the ring is seen not to go on"


def test_beyond_the_frame_nothing_goes_on_that_ends_inside_the_photo() -> None:
    """The lower corners are near the frame: most of the row below lies beyond it, as on a terrace."""
    text = RECTANGLE.replace("range(-4, 5)", "range(-5, 1)").replace("range(-3, 4)", "range(-2, 3)")
    photo = drawn(text)
    laid = laid_on(photo, text)
    assert laid.in_sight().all()
    assert len(continued(laid, photo, canvas=(-100.5, -100.5, 579.5, 499.5)).index) == 0


@pytest.mark.parametrize("text", [RECTANGLE, TRIANGLE, RING])
def test_the_same_program_follows_itself(text: str) -> None:
    photo, hole = drawn(text), beside(right_of=300)
    laid = laid_on(photo, text)
    more = continued(laid, photo, hole=hole)
    found = followed(laid, more.joined(laid), more)
    assert sorted(found.index.tolist()) == sorted(more.index.tolist())


@pytest.mark.parametrize(("last", "comes"), [(2, True), (0, False)])
def test_another_program_follows_from_the_hole_on_and_not_from_before_it(last: int, comes: bool) -> None:
    """Every other column, up to the hole or ending long before it."""
    photo, hole = drawn(RECTANGLE), beside(right_of=at(RECTANGLE, 2.5, 0)[0])
    laid = laid_on(photo, RECTANGLE.replace("range(-4, 5)", "range(-4, 3)"))
    more = continued(laid, photo, hole=hole)
    assert len(more.index) > 5
    sparser = RECTANGLE.replace("9*i", "18*i").replace("range(-4, 5)", f"range(-2, {last})")
    found = followed(laid_on(photo, sparser), more.joined(laid), more)
    assert bool(len(found.index)) == comes
    assert (2 * found.index[:, 0] > 2).all()

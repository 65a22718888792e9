"""Presence on drawn photos whose missing, covered and unknown objects are known."""

import dataclasses

import cv2
import numpy as np
import pytest

from p3i import loads
from p3i.interp.camera import Camera
from p3i.place.objects import Objects, objects_of
from p3i.place.presence import absent_of
from p3i.size import Size
from p3i.vision.image import Image

SIZE = Size(640, 480)
CAMERA = Camera(-30, 8)
LATTICE = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 9):
    for j in range(0, 6):
        Draw(x=8*i + 2*j - 37, y=8*j - 20)
"""
RING = "SetCameraPose(rx=-30, ry=8)\nfor j in range(0, 12):\n    Draw(x=22*Cos(30*j), y=22*Sin(30*j))\n"
RINGS = """SetCameraPose(rx=-30, ry=8)
for i in range(2, 5):
    for j in range(0, 10):
        Draw(x=7*i*Cos(36*j), y=7*i*Sin(36*j))
"""
_FINE = 3
# An arrow head in program units: along and across the way outwards.
_SHAPE = np.array([(-2.2, -2), (2.4, 0), (-2.2, 2), (-1, 0)])


def photo(text: str, *, missing: frozenset[str] = frozenset(), seed: int = 0) -> Image:
    """What `text` draws, an arrow head an object, less those named in `missing`; a ground with some grain."""
    random = np.random.default_rng(seed)
    matrix = CAMERA.image_from_plane(SIZE).numpy()
    canvas = np.full((SIZE.height * _FINE, SIZE.width * _FINE, 3), (190, 200, 205), np.uint8)
    for each in objects_of(loads(text), None, size=SIZE).objects:
        if each.name in missing:
            continue
        out = np.array(each.outward or (0.0, -1.0))
        corners = (each.x, each.y) + _SHAPE @ np.array([out, (-out[1], out[0])])
        at = np.c_[corners, np.ones(len(corners))] @ matrix.T
        pixels = (at[:, :2] / at[:, 2:] + 0.5) * _FINE - 0.5
        cv2.fillPoly(canvas, [np.round(pixels * 16).astype(np.int32)], (60, 50, 140), cv2.LINE_AA, 4)
    small = (
        cv2.resize(canvas, (SIZE.width, SIZE.height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    )
    small += random.normal(0, 0.02, small.shape).astype(np.float32)
    return Image(small.clip(0, 1), np.ones(small.shape[:2], bool))


def absent(found: Objects) -> set[str]:
    return {each.name for each in found.objects if each.presence is not None and each.presence < 0.5}


@pytest.mark.parametrize("text", [LATTICE, RING, RINGS], ids=["lattice", "ring", "rings"])
def test_all_objects_that_are_drawn_are_there(text: str) -> None:
    found = objects_of(loads(text), photo(text))
    assert absent(found) == set()
    assert all(each.presence is not None and each.presence > 0.9 for each in found.objects)


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        (LATTICE, {"A1", "C4", "C5", "F9"}),
        (RING, {"1", "6", "7"}),
        (RINGS, {"A2", "B10", "C5"}),
    ],
    ids=["lattice", "ring", "rings"],
)
def test_the_missing_ones_and_no_others_are_not_there(text: str, missing: set[str]) -> None:
    assert absent(objects_of(loads(text), photo(text, missing=frozenset(missing)))) == missing


def test_a_covered_object_is_not_there() -> None:
    covered = photo(LATTICE)
    target = {each.name: each for each in objects_of(loads(LATTICE), None, size=SIZE).objects}["D5"]
    pixels = covered.pixels.copy()
    at = (round(target.x_px), round(target.y_px))
    cv2.circle(pixels, at, 22, (0.9, 0.2, 0.1), -1, cv2.LINE_AA)
    found = objects_of(loads(LATTICE), dataclasses.replace(covered, pixels=pixels))
    assert absent(found) == {"D5"}


def ruled(*, count: int = 12, light: float = 0.0) -> tuple[str, Image]:
    """A sheet of count x count ruled fields on a table, in sight from above, and its crossings as a program.

    `light` is how much darker it is at the right end than at the left.
    """
    step, table = 3.0, np.full((480 * _FINE, 640 * _FINE, 3), (70, 100, 120), np.uint8)

    def at(*points: tuple[float, float]) -> np.ndarray:
        pixels = (np.array(points) * 6.4 + (320, 240)) * _FINE
        return np.round(pixels * 16).astype(np.int32)

    end = step * count / 2
    rim = end + 0.4 * step
    cv2.fillPoly(table, [at((-rim, -rim), (rim, -rim), (rim, rim), (-rim, rim))], (225, 230, 230), 8, 4)
    for k in range(count + 1):
        place = step * k - end
        cv2.polylines(table, [at((-end, place), (end, place))], False, (40, 40, 40), 4, cv2.LINE_AA, 4)
        cv2.polylines(table, [at((place, -end), (place, end))], False, (40, 40, 40), 4, cv2.LINE_AA, 4)
    small = cv2.resize(table, (640, 480), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    small *= (1 - light * np.linspace(0, 1, 640, dtype=np.float32))[None, :, None]
    small += np.random.default_rng(0).normal(0, 0.02, small.shape).astype(np.float32)
    text = f"""SetCameraPose(rx=0, ry=0)
for i in range(0, {count + 1}):
    for j in range(0, {count + 1}):
        Draw(x={step}*i - {end}, y={step}*j - {end})
"""
    return text, Image(small.clip(0, 1), np.ones((480, 640), bool))


def test_the_crossings_on_the_rim_of_a_ruled_sheet_are_there() -> None:
    text, sheet = ruled()
    found = objects_of(loads(text), sheet)
    assert len(found.objects) == 169 and absent(found) == set()


def test_light_that_falls_off_along_the_pattern_makes_nothing_absent() -> None:
    text, sheet = ruled(light=0.85)
    assert absent(objects_of(loads(text), sheet)) == set()


def test_stones_on_a_board_are_there_like_the_crossings() -> None:
    text, board = ruled()
    pixels = board.pixels.copy()
    stones = {(i, j) for i in range(2, 8) for j in range(3, 9) if (i * 5 + j * 3) % 2 == 0}
    for i, j in stones:
        middle = (round(320 + 6.4 * (3 * i - 18)), round(240 + 6.4 * (3 * j - 18)))
        cv2.circle(pixels, middle, 8, (0.05, 0.05, 0.05), -1, cv2.LINE_AA)
    assert absent(objects_of(loads(text), dataclasses.replace(board, pixels=pixels))) == set()


def test_the_absent_objects_of_a_program_are_counted() -> None:
    shown = photo(LATTICE, missing=frozenset({"A1", "C4", "C5", "F9"}))
    assert absent_of(loads(LATTICE), shown) == (4, 54)


def test_what_the_photo_does_not_know_is_not_judged() -> None:
    seen = photo(LATTICE)
    target = {each.name: each for each in objects_of(loads(LATTICE), None, size=SIZE).objects}["D5"]
    hole = np.zeros((SIZE.height, SIZE.width), np.uint8)
    cv2.fillPoly(hole, [np.round(np.array(target.cell_px)).astype(np.int32)], 1)
    found = objects_of(loads(LATTICE), dataclasses.replace(seen, valid=hole == 0))
    assert [each.name for each in found.objects if each.presence is None] == ["D5"]
    assert found.counts == "54 objects: 53 there, 0 not, 1 not to be judged"


def test_nothing_is_there_on_a_photo_without_objects() -> None:
    random = np.random.default_rng(3)
    noise = Image(random.random((SIZE.height, SIZE.width, 3)).astype(np.float32), np.ones((480, 640), bool))
    found = objects_of(loads(LATTICE), noise)
    assert found.there < 0.4 * len(found.objects)


def test_a_plain_photo_shows_no_object() -> None:
    plain = Image(np.full((480, 640, 3), 0.5, np.float32), np.ones((480, 640), bool))
    found = objects_of(loads(LATTICE), plain)
    assert absent(found) == {each.name for each in found.objects}


def test_without_a_photo_nothing_is_said() -> None:
    assert {each.presence for each in objects_of(loads(LATTICE), None, size=SIZE).objects} == {None}


def test_the_least_presence_leaves_the_missing_ones_out() -> None:
    found = objects_of(loads(LATTICE), photo(LATTICE, missing=frozenset({"C4"})), min_presence=0.5)
    assert "C4" not in {each.name for each in found.objects}
    assert (len(found.objects), found.faint) == (53, 1)


def test_two_objects_are_too_few_to_say_what_they_share() -> None:
    pair = "SetCameraPose(rx=0, ry=0)\nfor i in range(0, 2):\n    Draw(x=20*i - 10, y=0)\n"
    found = objects_of(loads(pair), photo(LATTICE))
    assert [each.presence for each in found.objects] == [None, None]

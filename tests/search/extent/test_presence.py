"""Which cells of a known lattice hold an object, on drawn photos where that is known."""

import cv2
import numpy as np
import pytest

from p3i.search.extent.presence import _elsewhere, cells_that_hold

RECTANGLE = [(i, j) for i in range(6) for j in range(8)]
TRIANGLE = [(i, j) for i in range(6) for j in range(6) if i + j >= 5]
TIN = [(i, j) for i in range(4) for j in range(3)]


def extent_of(scene, **changes):
    given = {
        "pixels": scene.pixels,
        "valid": scene.valid,
        "image_from_plane": scene.image_from_plane,
        "basis": scene.basis,
        "origin": scene.origin,
        **changes,
    }
    cells = cells_that_hold(**given)
    return None if cells is None else cells.outline()


def cells_of(extent, scene, origin=None):
    """The cells that an outline draws and whose middle the photo shows."""
    i, j = np.meshgrid(np.arange(*extent.i_range), np.arange(*extent.j_range))
    drawn = np.stack([i.ravel(), j.ravel()], 1)
    drawn = drawn[[all(a * i + b * j >= c for a, b, c in extent.guards) for i, j in drawn]]
    at = (scene.origin if origin is None else origin) + drawn @ scene.basis
    x, y, z = scene.image_from_plane @ np.c_[at, np.ones(len(at))].T
    height, width = scene.valid.shape
    shown = (z > 0) & (x >= 0) & (x <= (width - 1) * z) & (y >= 0) & (y <= (height - 1) * z)
    return {(int(a), int(b)) for a, b in drawn[shown]}


def shifted(cells, i, j):
    return {(a + i, b + j) for a, b in cells}


@pytest.mark.parametrize("kind", ["disc", "light_disc", "square", "letter"])
def test_a_board_of_objects_in_clutter_is_found_whole(draw_scene, kind):
    extent = extent_of(draw_scene(RECTANGLE, kind=kind))
    assert (extent.i_range, extent.j_range, extent.guards) == ((0, 6), (0, 8), ())


def test_a_triangle_is_one_guard(draw_scene):
    scene = draw_scene(TRIANGLE, basis=((140.0, 0.0), (20.0, 140.0)), radius=40)
    extent = extent_of(scene)
    assert cells_of(extent, scene) == set(TRIANGLE)
    assert extent.guards == ((1, 1, 5),)


def test_a_tin_of_twelve_is_found_whole(draw_scene):
    scene = draw_scene(TIN, basis=((230.0, 0.0), (0.0, 240.0)), origin=(250.0, 330.0), radius=85)
    assert cells_of(extent_of(scene), scene) == set(TIN)


def test_another_origin_of_the_same_lattice_only_renumbers(draw_scene):
    scene = draw_scene(RECTANGLE)
    origin = scene.origin + 3 * scene.basis[0] - 2 * scene.basis[1]
    moved = extent_of(scene, origin=origin)
    assert cells_of(moved, scene, origin) == shifted(RECTANGLE, -3, 2)
    assert (moved.i_range, moved.j_range) == ((-3, 3), (2, 10))


def test_objects_hidden_by_something_else_stay_inside(draw_scene):
    scene = draw_scene(RECTANGLE)
    pixels = scene.pixels.copy()
    pixels[200:290, 250:330] = (0.1, 0.5, 0.2)
    assert cells_of(extent_of(scene, pixels=pixels), scene) == set(RECTANGLE)


def test_a_third_of_the_objects_may_be_missing(draw_scene):
    rng = np.random.default_rng(3)
    cells = [(i, j) for i in range(8) for j in range(8)]
    present = [cell for cell in cells if rng.uniform() > 0.33]
    scene = draw_scene(present)
    assert cells_of(extent_of(scene), scene) == set(cells)


def test_stones_count_as_objects_of_a_board_of_lines(draw_scene):
    cells = [(i, j) for i in range(8) for j in range(8)]
    stones = [(i, j) for i in range(2, 6) for j in range(1, 6)]
    scene = draw_scene(cells, kind="crossing")
    pixels = scene.pixels.copy()
    for number, (i, j) in enumerate(stones):
        x, y, z = scene.image_from_plane @ [*(scene.origin + i * scene.basis[0] + j * scene.basis[1]), 1]
        shade = 0.05 if number % 2 else 0.95
        cv2.circle(pixels, (round(x / z), round(y / z)), 15, (shade, shade, shade), -1, cv2.LINE_AA)
    assert cells_of(extent_of(scene, pixels=pixels), scene) == set(cells)


def test_a_front_of_the_same_step_beyond_an_empty_column_is_another_pattern(draw_scene):
    here = [(i, j) for i in range(5) for j in range(8)]
    beyond = [(i, j) for i in range(6, 9) for j in range(8)]
    scene = draw_scene(here + beyond, basis=((90.0, 0.0), (0.0, 100.0)))
    assert cells_of(extent_of(scene), scene) == set(here)


def test_the_crossings_on_the_rim_of_a_ruled_board_are_its_objects(draw_scene):
    scene = draw_scene([])
    corners = scene.origin + np.array([(0, 0), (6, 0), (6, 7), (0, 7)]) @ scene.basis

    def at(points):
        x, y, z = scene.image_from_plane @ np.c_[points, np.ones(len(points))].T
        return np.round(np.stack([x / z, y / z], 1) * 16).astype(np.int32)

    pixels = scene.pixels.copy()
    outwards = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ scene.basis
    for reach, colour in ((0.9, (0.15, 0.1, 0.1)), (0.3, (0.85, 0.7, 0.45))):  # a dark table, the board
        cv2.fillPoly(pixels, [at(corners + reach * outwards)], colour, cv2.LINE_AA, 4)
    for k in range(8):
        for ends in ([(0, k), (6, k)], [(min(k, 6), 0), (min(k, 6), 7)]):
            cv2.polylines(
                pixels,
                [at(scene.origin + np.array(ends) @ scene.basis)],
                False,
                (0.1,) * 3,
                2,
                cv2.LINE_AA,
                4,
            )
    crossings = {(i, j) for i in range(7) for j in range(8)}
    assert cells_of(extent_of(scene, pixels=pixels), scene) == crossings


def test_a_pattern_that_changes_its_look_little_by_little_does_not_end_there(draw_scene):
    cells = [(i, j) for i in range(13) for j in range(5)]
    scene = draw_scene(cells, basis=((70.0, 0.0), (0.0, 100.0)), origin=(110.0, 250.0), radius=1)
    pixels = scene.pixels.copy()
    for i, j in cells:  # a bar that turns from one column to the next, by a quarter turn in all
        turn = np.deg2rad(90 * i / 12)
        along = 26 * np.array([np.cos(turn), np.sin(turn)])
        middle = scene.origin + i * scene.basis[0] + j * scene.basis[1]
        x, y, z = scene.image_from_plane @ np.c_[[middle - along, middle + along], [1, 1]].T
        (a, b), (c, d) = np.round(np.stack([x / z, y / z], 1) * 16).astype(int).tolist()
        cv2.line(pixels, (a, b), (c, d), (0.1, 0.2, 0.4), 5, cv2.LINE_AA, 4)
    assert cells_of(extent_of(scene, pixels=pixels), scene) == set(cells)


def test_half_objects_along_a_hole_are_not_drawn_into_it(draw_scene):
    scene = draw_scene(RECTANGLE)
    height, width = scene.valid.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    at = np.stack([x, y, np.ones_like(x)], -1) @ np.linalg.inv(scene.image_from_plane).T
    cell = (at[..., :2] / at[..., 2:] - scene.origin) @ np.linalg.inv(scene.basis)
    hole = cell[..., 0] < 0.1  # it hides the middles of the first column, and shows the half of each object
    assert cells_of(extent_of(scene, valid=~hole), scene) == {(i, j) for i, j in RECTANGLE if i > 0}


def test_what_a_mask_hides_is_no_evidence(draw_scene):
    scene = draw_scene(RECTANGLE)
    pixels, valid = scene.pixels.copy(), scene.valid.copy()
    valid[180:320, 220:400] = False
    pixels[~valid] = np.random.default_rng(1).uniform(size=(int((~valid).sum()), 3))
    assert cells_of(extent_of(scene, pixels=pixels, valid=valid), scene) == set(RECTANGLE)


def test_a_pattern_that_leaves_the_photo_is_drawn_up_to_its_border(draw_scene):
    cells = [(i, j) for i in range(-2, 11) for j in range(-2, 11)]
    corners = ((-300, -200), (900, -260), (1000, 760), (-380, 700))
    scene = draw_scene(cells, corners=corners)
    extent = extent_of(scene)
    at = np.array([scene.origin + np.array(c) @ scene.basis for c in cells])
    mapped = np.c_[at, np.ones(len(at))] @ scene.image_from_plane.T
    x, y = (mapped[:, :2] / mapped[:, 2:]).T
    shown = (x >= 0) & (x <= 639) & (y >= 0) & (y <= 479)
    assert cells_of(extent, scene) == {cell for cell, inside in zip(cells, shown, strict=True) if inside}


def test_a_slightly_wrong_basis_still_finds_the_objects(draw_scene):
    scene = draw_scene(RECTANGLE)
    assert cells_of(extent_of(scene, basis=scene.basis * 1.005), scene) == set(RECTANGLE)


def test_large_photos_give_the_same_cells(draw_scene):
    corners = tuple((2 * x, 2 * y) for x, y in ((90, 60), (560, 20), (620, 470), (20, 430)))
    scene = draw_scene(RECTANGLE, size=(1280, 960), corners=corners)
    assert cells_of(extent_of(scene), scene) == set(RECTANGLE)


def test_a_support_may_be_smaller_than_the_pattern(draw_scene):
    scene = draw_scene(RECTANGLE)
    support = np.zeros(scene.valid.shape, np.float32)
    support[150:330, 180:420] = 1
    assert cells_of(extent_of(scene, support=support), scene) == set(RECTANGLE)


def test_the_answer_is_the_same_every_time(draw_scene):
    scene = draw_scene(TRIANGLE)
    assert extent_of(scene) == extent_of(scene)


def test_a_plain_photo_holds_nothing(draw_scene):
    scene = draw_scene([])
    assert extent_of(scene, pixels=np.full_like(scene.pixels, 0.5)) is None


def test_a_photo_without_a_known_pixel_holds_nothing(draw_scene):
    scene = draw_scene(RECTANGLE)
    assert extent_of(scene, valid=np.zeros_like(scene.valid)) is None


def test_of_two_parts_that_pass_the_one_that_was_fitted_is_the_pattern():
    passing, fitted = np.zeros((12, 20), bool), np.zeros((12, 20), np.float32)
    passing[2:8, 1:6] = True
    passing[4, 1:6] = False  # an empty line divides nothing
    passing[1:11, 9:19] = True  # larger, and a part of it was fitted too
    fitted[2:8, 1:6], fitted[3:5, 10:13] = 1, 1
    away = _elsewhere(passing, fitted)
    assert np.array_equal(away[:, 8:], passing[:, 8:])
    assert not away[:, :8].any()
    assert not _elsewhere(passing, np.zeros_like(fitted)).any()

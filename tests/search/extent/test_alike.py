"""Which cells of a lattice look alike."""

import cv2
import numpy as np
import pytest

from p3i.search.extent.alike import look_alike, working_size
from p3i.vision.alike import between

CELLS = [(i, j) for i in range(8) for j in range(8)]


def alike_of(scene, **changes):
    given = {"support": None, "pixels": scene.pixels, **changes}
    return look_alike(
        given["pixels"], scene.valid, scene.image_from_plane, scene.basis, scene.origin, given["support"]
    )


def cells_where(alike, chosen):
    box = alike.sheet.box
    j, i = np.divmod(np.flatnonzero(chosen), box.columns)
    return {(int(a) + box.i_start, int(b) + box.j_start) for a, b in zip(i, j, strict=True)}


def test_the_cells_of_the_pattern_get_the_weight(draw_scene):
    alike = alike_of(draw_scene(CELLS))
    assert cells_where(alike, alike.weights > 0.5) == set(CELLS)
    assert alike.level > 0.9
    assert alike.second is None


def test_stones_on_a_board_of_lines_are_a_second_kind(draw_scene):
    scene = draw_scene(CELLS, kind="crossing")
    stones = {(i, j) for i in range(2, 6) for j in range(1, 4)} | {(6, 6), (1, 5), (3, 6)}
    pixels = scene.pixels.copy()
    for number, (i, j) in enumerate(sorted(stones)):
        x, y, z = scene.image_from_plane @ [*(scene.origin + i * scene.basis[0] + j * scene.basis[1]), 1]
        colour = (0.05, 0.05, 0.05) if number % 2 else (0.95, 0.95, 0.95)
        cv2.circle(pixels, (round(x / z * 16), round(y / z * 16)), 15 * 16, colour, -1, cv2.LINE_AA, 4)
    alike = alike_of(scene, pixels=pixels)
    assert alike.second is not None
    found = cells_where(alike, alike.second.weights > 0.3)
    assert len(found & stones) >= 0.7 * len(stones)
    assert len(found - stones) <= 1


def test_colours_that_neighbours_swap_do_not_count(draw_scene):
    swapped = draw_scene(
        [(i, j) for i, j in CELLS if (i + j) % 2], kind="square", origin=(250.0, 250.0), radius=50
    )
    assert alike_of(swapped).colour_share < 0.1
    assert alike_of(draw_scene(CELLS)).colour_share > 0.6


def test_the_support_says_which_of_two_patterns_is_meant(draw_scene):
    one = draw_scene([(i, j) for i in range(8) for j in range(4)], radius=20)
    other = draw_scene([(i, j) for i in range(8) for j in range(5, 9)], kind="crossing")
    below = np.zeros(one.valid.shape, np.float32)
    at = (one.image_from_plane @ [*(one.origin + 4.5 * one.basis[1]), 1])[1:]
    below[round(at[0] / at[1]) :] = 1
    pixels = np.where(below[..., None] > 0, other.pixels, one.pixels)
    upper, lower = (
        alike_of(one, pixels=pixels, support=1 - below),
        alike_of(one, pixels=pixels, support=below),
    )
    assert max(j for _, j in cells_where(upper, upper.weights > 0.5)) <= 4
    assert min(j for _, j in cells_where(lower, lower.weights > 0.5)) >= 4


@pytest.mark.parametrize("size", [(640, 480), (1280, 960), (1501, 997)])
def test_at_working_size_the_homography_still_fits(size):
    pixels = np.zeros((size[1], size[0], 3), np.float32)
    pixels[size[1] // 2 - 20 : size[1] // 2 + 21, size[0] // 3 - 20 : size[0] // 3 + 21] = 1
    small, mask, matrix = working_size(pixels, np.ones(pixels.shape[:2], bool), np.eye(3))
    assert max(mask.shape) == 640
    x, y, z = matrix @ [size[0] // 3, size[1] // 2, 1]
    rows, columns = np.nonzero(small[..., 0] > 0.5)
    assert (columns.mean(), rows.mean()) == pytest.approx((x / z, y / z), abs=0.3)


def test_between_needs_two_on_each_side_along_a_row_or_a_column():
    passes = np.zeros((5, 7), bool)
    passes[2, [0, 1, 5, 6]] = True
    result = between(passes)
    assert result[2].tolist() == [False, True, True, True, True, True, False]
    assert not np.delete(result, 2, axis=0).any()


def test_a_small_pattern_keeps_its_cell_beside_much_that_repeats_as_well(draw_scene):
    board = [(i, j) for i in range(3) for j in range(3)]
    around = [(i, j) for i in range(9) for j in range(9) if i > 3 or j > 3]
    one, other = draw_scene(board, radius=20), draw_scene(around, kind="crossing")
    matrix = one.image_from_plane @ [*(one.origin + 3.5 * one.basis.sum(0)), 1]
    across, down = (matrix[:2] / matrix[2]).round().astype(int)
    pixels, support = other.pixels.copy(), np.zeros(one.valid.shape, np.float32)
    pixels[:down, :across] = one.pixels[:down, :across]
    support[:down, :across] = 1
    alike = alike_of(one, pixels=pixels, support=support)
    taken = cells_where(alike, alike.weights > 0.5)
    assert len(taken & set(board)) >= 8
    assert len(taken - set(board)) <= 2

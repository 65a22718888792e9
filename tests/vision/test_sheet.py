"""A photo in the coordinates of a lattice."""

import cv2
import numpy as np
import pytest

from p3i.vision.sheet import (
    Box,
    cell_sides_px,
    cells_from_basis,
    project,
    sheet_points,
    straighten,
    visible_box,
)

SLANTED = np.array([[38.0, 6.0, 60.0], [-4.0, 30.0, 50.0], [0.012, 0.03, 1.0]])


def test_lattice_coordinates_name_plane_points():
    matrix = cells_from_basis(np.eye(3), np.array([[3.0, 1.0], [-1.0, 2.0]]), np.array([10.0, 20.0]))
    at, front = project(matrix, np.array([[0.0, 0.0], [2.0, 1.0]]))
    assert front.all()
    assert at.tolist() == [[10, 20], [15, 24]]


def test_samples_lie_evenly_about_the_middles_of_cells():
    points = sheet_points(Box(-1, 2, 4, 6), 4)
    assert points.shape == (8, 12, 2)
    assert points[0, 0].tolist() == [-1.375, 3.625]
    assert points.reshape(2, 4, 3, 4, 2).mean(axis=(1, 3))[1, 2].tolist() == [1, 5]


def test_sides_of_cells_equal_finite_differences():
    points = np.array([[0.0, 0.0], [3.0, 2.0], [6.0, 5.0]])
    longer, shorter = cell_sides_px(SLANTED, points)
    step = 1e-5
    du, dv = (
        (project(SLANTED, points + along)[0] - project(SLANTED, points - along)[0]) / (2 * step)
        for along in np.eye(2) * step
    )
    assert longer == pytest.approx(
        np.maximum(np.linalg.norm(du, axis=1), np.linalg.norm(dv, axis=1)), rel=1e-5
    )
    assert shorter * longer == pytest.approx(np.abs(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]), rel=1e-5)


def test_straightening_undoes_the_view():
    rng = np.random.default_rng(0)
    side, box = 16, Box(0, 8, 0, 6)
    flat = cv2.resize(rng.uniform(0.1, 0.9, (24, 32, 3)).astype(np.float32), (8 * side, 6 * side))
    cells_from_flat = np.array(
        [[1 / side, 0, 0.5 / side - 0.5], [0, 1 / side, 0.5 / side - 0.5], [0, 0, 1.0]]
    )
    photo = cv2.warpPerspective(flat, SLANTED @ cells_from_flat, (420, 300), flags=cv2.INTER_CUBIC)
    sheet = straighten(photo, np.ones((300, 420), bool), SLANTED, box=box, side=side)
    assert sheet.values.shape == (3, 96, 128)
    inner = sheet.seen[8:-8, 8:-8]
    error = np.abs(sheet.values.transpose(1, 2, 0) - flat)[8:-8, 8:-8][inner]
    assert inner.mean() > 0.7
    assert error.mean() < 0.02


def test_masked_pixels_are_not_seen_and_do_not_bleed():
    photo = np.full((300, 420, 3), 0.25, np.float32)
    valid = np.ones((300, 420), bool)
    photo[100:160, 150:260], valid[100:160, 150:260] = 1.0, False
    sheet = straighten(photo, valid, SLANTED, box=Box(0, 8, 0, 6), side=12)
    at, _ = project(SLANTED, sheet_points(Box(0, 8, 0, 6), 12))
    hidden = (at[..., 0] > 152) & (at[..., 0] < 257) & (at[..., 1] > 102) & (at[..., 1] < 157)
    assert hidden.any()
    assert not sheet.seen[hidden].any()
    assert np.allclose(sheet.values[:, sheet.seen], 0.25, atol=1e-3)


def test_the_box_holds_every_cell_in_sight_of_enough_size():
    box = visible_box(SLANTED, (300, 420), min_px=4)
    i, j = np.meshgrid(np.arange(-40, 80), np.arange(-40, 80))
    points = np.stack([i.ravel(), j.ravel()], axis=-1).astype(float)
    at, front = project(SLANTED, points)
    large = cell_sides_px(SLANTED, points)[1] >= 5
    shown = front & large & (at >= 0).all(axis=1) & (at[:, 0] < 420) & (at[:, 1] < 300)
    inside = (points >= [box.i_start, box.j_start]).all(axis=1) & (points < [box.i_stop, box.j_stop]).all(
        axis=1
    )
    assert shown.any()
    assert (inside | ~shown).all()
    # and no row or column more than those in sight, of cells whose edges reach in
    reaching = front & (at > -40).all(axis=1) & (at[:, 0] < 460) & (at[:, 1] < 340)
    seen = points[reaching & (cell_sides_px(SLANTED, points)[1] >= 4)]
    assert box.i_start >= seen[:, 0].min() - 1 and box.i_stop <= seen[:, 0].max() + 2
    assert box.j_start >= seen[:, 1].min() - 1 and box.j_stop <= seen[:, 1].max() + 2


def test_the_box_stops_short_of_a_horizon():
    horizon = np.array([[20.0, 0.0, 200.0], [0.0, 0.0, 100.0], [0.0, -0.1, 1.0]])
    horizon[1, 1] = -5.0
    box = visible_box(horizon, (300, 400), max_cells=500)
    assert box is not None
    assert box.count <= 500


def test_a_lattice_behind_the_camera_shows_no_cell():
    assert visible_box(-np.eye(3), (300, 400)) is None

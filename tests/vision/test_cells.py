"""Cells of a sheet as vectors: features, the robust median, agreement."""

import numpy as np
import pytest

from p3i.vision.cells import agreement, cut, median_cell, sheet_features, shifted, weighted_mean
from p3i.vision.sheet import Box, Sheet

SIDE = 16


def sheet_of(tile, rows=5, columns=6):
    """A sheet of equal cells [SIDE, SIDE, 3]."""
    values = np.tile(tile, (rows, columns, 1)).transpose(2, 0, 1).astype(np.float32)
    return Sheet(
        np.ascontiguousarray(values), np.ones(values.shape[1:], bool), Box(0, columns, 0, rows), SIDE
    )


def some_tile(seed=0):
    rng = np.random.default_rng(seed)
    tile = np.full((SIDE, SIDE, 3), 0.7)
    tile[4:11, 5:13] = rng.uniform(0, 0.5, 3)
    return tile


def features_of(sheet):
    features, known = sheet_features(sheet)
    return cut(features, SIDE), cut(known, SIDE)


def test_cells_are_cut_row_by_row():
    sheet = np.arange(4 * 6).reshape(4, 6)
    assert cut(sheet, 2)[1].tolist() == [[2, 3], [8, 9]]
    assert cut(sheet, 2)[3].tolist() == [[12, 13], [18, 19]]
    assert cut(np.stack([sheet, -sheet]), 2)[1, 1].tolist() == [[-2, -3], [-8, -9]]


def test_equal_cells_agree_fully():
    cells, known = features_of(sheet_of(some_tile()))
    inner = [7, 8, 9, 10]  # cells at the rim of the sheet lack known samples
    assert agreement(cells[inner], known[inner], cells[8:9]) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize(("gain", "offset"), [(0.5, 0.0), (1.0, 0.2), (0.6, 0.3)])
def test_agreement_does_not_depend_on_the_light(gain, offset):
    sheet = sheet_of(some_tile())
    lit = Sheet(sheet.values * gain + offset, sheet.seen, sheet.box, SIDE)
    one, known = features_of(sheet)
    other, _ = features_of(lit)
    assert agreement(other[8:9], known[8:9], one[8:9])[0, 0] > 0.9


def test_an_empty_cell_does_not_agree():
    sheet = sheet_of(some_tile())
    sheet.values[:, SIDE : 2 * SIDE, SIDE : 2 * SIDE] = 0.7
    cells, known = features_of(sheet)
    fit = agreement(cells, known, cells[9:10])[:, 0]
    assert fit[7] < 0.2
    assert fit[8] > 0.8


def test_a_faint_copy_of_the_cell_agrees_only_faintly():
    cells, known = features_of(sheet_of(some_tile()))
    fit = agreement(0.1 * cells[8:9], known[8:9], cells[8:9])[0, 0]
    assert fit == pytest.approx(0.25, abs=0.01)


def test_agreement_with_a_shifted_cell_is_found_at_that_shift():
    cells, known = features_of(sheet_of(some_tile()))
    shifts = np.array([(0, 0), (3, 0), (0, -5)])
    moved = np.roll(cells[8:9], (-5, 0), axis=(2, 3))
    assert agreement(moved, np.ones_like(known[8:9]), shifted(cells[8], shifts))[0].argmax() == 2


def test_gradient_features_are_blind_to_black_against_white():
    sheet = sheet_of(some_tile())
    inverse = Sheet(1 - sheet.values, sheet.seen, sheet.box, SIDE)
    one, known = features_of(sheet)
    other, _ = features_of(inverse)
    assert agreement(one[8:9, :3], known[8:9], other[8:9, :3])[0, 0] > 0.8
    assert agreement(one[8:9, 3:], known[8:9], other[8:9, 3:])[0, 0] < 0


def test_the_median_cell_ignores_a_few_outliers_and_what_is_not_seen():
    rng = np.random.default_rng(0)
    truth = rng.uniform(size=(3, 4, 4)).astype(np.float32)
    cells = np.repeat(truth[None], 9, axis=0)
    seen = np.ones((9, 4, 4), bool)
    cells[:3] = 5.0
    cells[4, :, 0, 0], seen[4:8, 0, 0] = 9.0, False
    median, spread = median_cell(cells, seen, np.arange(3, 9))
    assert np.allclose(median, truth)
    assert np.allclose(spread, 0)
    median, _ = median_cell(cells, seen, np.arange(9))
    assert np.allclose(median[:, 1:], truth[:, 1:])


def test_the_mean_cell_is_over_what_is_seen():
    cells = np.array([1.0, 3.0, 100.0], np.float32).reshape(3, 1, 1, 1)
    seen = np.array([True, True, False]).reshape(3, 1, 1)
    cells[2] = 0  # what is not seen holds zero
    assert weighted_mean(cells, seen, np.array([1.0, 1.0, 1.0]))[0, 0, 0] == pytest.approx(2)


def test_a_plain_sheet_gives_finite_features():
    features, _ = sheet_features(sheet_of(np.full((SIDE, SIDE, 3), 0.5)))
    assert np.isfinite(features).all()

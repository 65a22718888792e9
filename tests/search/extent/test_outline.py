"""The outline with the most evidence for the fewest numbers."""

import numpy as np
import pytest

from p3i.search.extent.outline import best_outline


def evidence_of(rows, columns, holds, *, strength=3.0):
    j, i = np.mgrid[:rows, :columns]
    return np.where(holds(i, j), strength, -strength)


def cells_of(outline, rows, columns, i_start=0, j_start=0):
    j, i = np.mgrid[j_start : j_start + rows, i_start : i_start + columns]
    return outline.holds(i, j)


def test_a_rectangle_is_two_ranges_and_no_guard():
    outline = best_outline(evidence_of(12, 15, lambda i, j: (i >= 3) & (i < 9) & (j >= 2) & (j < 6)))
    assert (outline.i_range, outline.j_range, outline.guards) == ((3, 9), (2, 6), ())


def test_ranges_and_guards_count_from_the_first_cell():
    evidence = evidence_of(9, 9, lambda i, j: (i < 4) & (j < 4) & (i + j >= 3))
    outline = best_outline(evidence, i_start=-7, j_start=5)
    assert (outline.i_range, outline.j_range) == ((-7, -3), (5, 9))
    assert outline.guards == ((1, 1, 1),)


@pytest.mark.parametrize("guard", [(1, 1, 6), (-1, 1, -2), (2, 1, 9), (1, -2, -8), (3, -1, 1)])
def test_a_slanted_side_is_one_guard(guard):
    a, b, c = guard
    evidence = evidence_of(11, 12, lambda i, j: (i > 0) & (j > 0) & (i < 10) & (j < 9) & (a * i + b * j >= c))
    outline = best_outline(evidence)
    assert len(outline.guards) == 1
    assert np.array_equal(cells_of(outline, 11, 12), evidence > 0)


def test_a_diamond_with_a_flat_side_is_three_guards():
    evidence = evidence_of(20, 20, lambda i, j: (i + j >= 12) & (i - j >= -6) & (j - i >= -6) & (j < 14))
    outline = best_outline(evidence)
    assert len(outline.guards) == 3
    assert np.array_equal(cells_of(outline, 20, 20), evidence > 0)


def test_ranges_reach_no_farther_than_the_guards_leave_cells():
    evidence = evidence_of(20, 20, lambda i, j: (i + j >= 30) & (i - j >= -3) & (j - i >= -3))
    outline = best_outline(evidence)
    held = cells_of(outline, 20, 20)
    assert outline.i_range == (np.flatnonzero(held.any(0))[0], 20)
    assert outline.j_range == (np.flatnonzero(held.any(1))[0], 20)


def test_a_single_missing_object_is_drawn_all_the_same():
    evidence = evidence_of(8, 8, lambda i, j: (i < 6) & (j < 6))
    evidence[2, 3] = evidence[4, 4] = -3
    outline = best_outline(evidence)
    assert (outline.i_range, outline.j_range, outline.guards) == ((0, 6), (0, 6), ())


def test_one_stray_object_does_not_stretch_the_outline():
    evidence = evidence_of(20, 20, lambda i, j: (i < 6) & (j < 6))
    evidence[15, 15] = 3
    outline = best_outline(evidence)
    assert (outline.i_range, outline.j_range) == ((0, 6), (0, 6))


def test_a_missing_corner_cell_costs_less_than_a_guard():
    evidence = evidence_of(8, 8, lambda i, j: (i < 6) & (j < 6))
    evidence[0, 0] = -3
    assert best_outline(evidence).guards == ()


def test_unknown_cells_are_free_but_not_reached_for():
    evidence = np.zeros((10, 10))
    evidence[2:6, 1:9] = 3
    evidence[3:5, 4:6] = 0
    outline = best_outline(evidence)
    assert (outline.i_range, outline.j_range, outline.guards) == ((1, 9), (2, 6), ())


def test_an_empty_line_parts_two_patterns_and_the_one_with_more_evidence_is_the_answer():
    evidence = evidence_of(9, 12, lambda i, j: (i != 5) & (j >= 0))
    outline = best_outline(evidence)
    assert (outline.i_range, outline.j_range) == ((6, 12), (0, 9))
    assert outline.gain <= evidence[:, 6:].sum()


def test_a_line_that_is_empty_in_part_parts_nothing():
    evidence = evidence_of(9, 12, lambda i, j: (i != 5) | (j < 5))
    assert best_outline(evidence).i_range == (0, 12)


def test_a_line_beyond_the_outline_is_drawn_where_the_halves_towards_it_speak_for_objects():
    evidence = evidence_of(10, 10, lambda i, j: (i >= 2) & (i < 8) & (j >= 2) & (j < 8))
    halves = np.full((4, 10, 10), -2.0)
    halves[0, :, 1] = 3  # the halves towards greater i, beyond the first column
    halves[3, 8, 2:8] = (3, 3, -1, 3, 3, -1)  # those towards smaller j, beyond the last row
    outline = best_outline(evidence, halves=halves, i_start=5)
    assert (outline.i_range, outline.j_range) == ((6, 13), (2, 9))


def test_without_evidence_there_is_no_outline():
    assert best_outline(np.full((4, 5), -1.0)) is None
    assert best_outline(np.zeros((4, 5))) is None


@pytest.mark.parametrize("seed", range(5))
def test_no_outline_has_more_than_three_guards_and_the_gain_is_what_it_says(seed):
    rng = np.random.default_rng(seed)
    evidence = rng.normal(-0.5, 2, (9, 11))
    outline = best_outline(evidence)
    inside = cells_of(outline, 9, 11)
    assert len(outline.guards) <= 3
    assert 0 < outline.gain <= evidence[inside].sum()

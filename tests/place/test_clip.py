"""Half-planes: the one cut of lines and outlines, against a plain loop and known areas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.place.clip import area, clipped_to_canvas, cut, cut_polygon
from p3i.size import Size

number = st.floats(-9, 9)


@settings(deadline=None)
@given(st.lists(st.tuples(number, number), min_size=3, max_size=9), number, number, number)
def test_a_polygon_is_cut_as_a_plain_loop_over_its_sides_would(
    corners: list[tuple[float, float]], a: float, b: float, c: float
) -> None:
    polygon = np.array(corners)
    inside = polygon @ (a, b) + c
    expected = []
    for k in range(len(polygon)):
        here, there = polygon[k], polygon[(k + 1) % len(polygon)]
        value, following = inside[k], inside[(k + 1) % len(polygon)]
        if value >= 0:
            expected.append(here)
        if (value >= 0) != (following >= 0):
            expected.append(here + value / (value - following) * (there - here))
    np.testing.assert_allclose(cut_polygon(polygon, inside), np.array(expected).reshape(-1, 2), atol=1e-9)


def test_what_is_cut_from_a_square_has_the_area_that_is_left() -> None:
    square = np.array([(0.0, 0), (10, 0), (10, 10), (0, 10)])
    assert area(cut_polygon(square, square[:, 0] - 4)) == pytest.approx(60)
    assert area(cut_polygon(square, 5 - square.sum(1))) == pytest.approx(12.5)
    assert cut_polygon(square, square[:, 0] - 11).shape == (0, 2)
    assert area(clipped_to_canvas(square + 5, Size(10, 10))) == pytest.approx(4.5**2)


def test_segments_keep_their_part_and_say_whose_it_is() -> None:
    segments = np.array([[(0.0, 0), (10, 0)], [(0, 5), (2, 5)], [(8, 1), (9, 1)], [(np.nan, 0), (9, 9)]])
    parts, kept = cut(segments, segments[..., 0] - 4)
    assert kept.tolist() == [True, False, True, False]
    np.testing.assert_allclose(parts, [[(4, 0), (10, 0)], [(8, 1), (9, 1)]])

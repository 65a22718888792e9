"""Factors and masks of each pixel, for all channels alike: what numpy's own spreading gives."""

import numpy as np
import pytest

from p3i.vision.planes import put, three, times


@pytest.mark.parametrize("shape", [(1, 7), (5, 1), (9, 13)])
def test_a_factor_is_spread_over_the_channels(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(0)
    plane, picture = random.random(shape, np.float32), random.random((*shape, 3), np.float32)
    assert np.array_equal(three(plane), plane[:, :, None].repeat(3, 2))
    assert np.array_equal(times(plane, picture), plane[:, :, None] * picture)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_pixels_are_put_into_a_window_of_a_larger_picture(kind: type) -> None:
    random = np.random.default_rng(1)
    whole = random.random((20, 30, 3), np.float32)
    before, new, where = whole.copy(), random.random((6, 8, 3)).astype(kind), random.random((6, 8)) < 0.4
    put(new, whole[3:9, 5:13], where)
    before[3:9, 5:13][where] = new[where]
    assert np.array_equal(whole, before)


def test_a_window_without_pixels_stays() -> None:
    picture = np.ones((4, 0, 3), np.float32)
    put(picture, picture, np.zeros((4, 0), bool))

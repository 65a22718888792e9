import numpy as np
import pytest

from p3i.vision.fill import eroded, filled


def test_known_pixels_stay_and_unknown_ones_lie_between_them():
    y, x = np.mgrid[0:50, 0:70].astype(np.float32)
    array = np.stack([x, y, x + y], axis=-1)
    valid = np.ones((50, 70), bool)
    valid[15:31, 22:40] = False
    damaged = array.copy()
    damaged[~valid] = np.nan
    result = filled(damaged, valid)
    np.testing.assert_array_equal(result[valid], array[valid])
    np.testing.assert_allclose(result[~valid], array[~valid], atol=8)
    assert result[23, 24, 0] < result[23, 37, 0]


def test_a_picture_with_one_known_pixel_takes_its_colour():
    array = np.full((9, 13, 3), np.nan, np.float32)
    array[2, 3] = (0.1, 0.5, 0.9)
    result = filled(array, np.isfinite(array[:, :, 0]))
    np.testing.assert_allclose(result, np.broadcast_to([0.1, 0.5, 0.9], result.shape), atol=1e-5)


def test_where_nothing_is_known_the_answer_is_zero():
    result = filled(np.full((5, 6, 3), 7, np.float32), np.zeros((5, 6), bool))
    np.testing.assert_array_equal(result, 0)


@pytest.mark.parametrize("radius", [0, 1, 3])
def test_erosion_equals_looking_at_every_square(radius):
    valid = np.random.default_rng(0).random((14, 17)) > 0.03
    expected = np.zeros_like(valid)
    for y in range(14):
        for x in range(17):
            inside = radius <= y < 14 - radius and radius <= x < 17 - radius
            square = valid[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
            expected[y, x] = inside and square.all()
    np.testing.assert_array_equal(eroded(valid, radius), expected)

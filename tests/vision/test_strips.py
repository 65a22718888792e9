"""Large pictures part by part: the same as all at once."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.vision.fill import fill_in, filled
from p3i.vision.sheet import Box, sampled
from p3i.vision.strips import ROWS, clipped, strips_of, wider_by, within

SIDES = st.integers(1, 40)


@settings(deadline=None)
@given(st.integers(0, 2000), st.integers(1, 700))
def test_strips_hold_each_row_once(height: int, rows: int) -> None:
    assert [row for part in strips_of(height, rows) for row in range(height)[part]] == list(range(height))


@settings(deadline=None)
@given(SIDES, SIDES, st.integers(0, 9))
def test_a_wider_window_holds_the_window(top: int, left: int, by_px: int) -> None:
    picture = np.arange(50 * 60).reshape(50, 60)
    window = slice(top, min(50, top + 7)), slice(left, min(60, left + 9))
    wider = wider_by(window, by_px, picture.shape)
    assert np.array_equal(picture[wider][within(window, wider)], picture[window])
    assert clipped(window, wider) == window


@settings(max_examples=20, deadline=None)
@given(SIDES, SIDES, st.floats(0, 1), st.integers(0, 9))
def test_filling_in_place_is_filling(height: int, width: int, share: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    array, valid = random.random((height, width, 3), np.float32), random.random((height, width)) < share
    where = random.random((height, width)) < 0.5
    wanted = np.where(where[..., None], filled(array, valid), array)
    fill_in(array, valid, where)
    np.testing.assert_allclose(array, wanted, atol=1e-5)
    assert np.array_equal(array[valid | ~where], wanted[valid | ~where])


@pytest.mark.parametrize("height", [ROWS - 1, ROWS + 1, 2 * ROWS + 3])
def test_samples_from_strips_are_those_of_the_whole_photo(height: int) -> None:
    random = np.random.default_rng(height)
    pixels, valid = random.random((height, 90, 3), np.float32), random.random((height, 90)) < 0.9
    at = random.random((1, 800, 2)) * (89, height - 1)
    at[0, :3, 1] = 0, height - 1, min(ROWS, height - 1)
    colour, weight = pixels * valid[..., None], valid.astype(np.float32)
    for spacing in (1.0, 2.0):
        found = sampled(
            pixels,
            valid,
            at,
            np.ones((1, 800), bool),
            np.full((1, 800), spacing),
            box=Box(0, 1, 0, 1),
            side=1,
        )
        x, y = (at / spacing).astype(np.float32).transpose(2, 0, 1)
        known = cv2.remap(weight, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        read = cv2.remap(colour, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        assert np.array_equal(found.seen, known > 0.6)
        wanted = (read / np.maximum(known, 1e-3)[..., None])[found.seen]
        np.testing.assert_allclose(found.values.transpose(1, 2, 0)[found.seen], wanted, atol=1e-6)
        colour, weight = cv2.pyrDown(colour), cv2.pyrDown(weight)

"""The light of a source: told by what is alike around a hole, not by what is foreign, nor paler for it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.paint.fill.light import matched_light
from p3i.paint.fill.mixing import _of_most


def textured(count: int, seed: int, spread: float = 0.15) -> np.ndarray:
    return (0.5 + spread * np.random.default_rng(seed).standard_normal((count, 3))).clip(0, 1)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.7, 1.4), st.floats(-0.15, 0.15), st.floats(0.05, 0.25), st.integers(0, 10), st.booleans())
def test_what_is_foreign_tells_nothing_of_light(
    gain: float, offset: float, share: float, seed: int, light: bool
) -> None:
    """Up to three places in ten show a hand or another wall, white or black."""
    colours = textured(900, seed)
    wanted = gain * colours + offset
    foreign = np.random.default_rng(seed + 1).random(900) < share
    wanted[foreign] = float(seed % 2)
    found_gain, found_offset = matched_light(
        colours, wanted, np.ones(900), light=(np.full(3, gain), np.full(3, offset)) if light else None
    )
    np.testing.assert_allclose(found_gain * 0.5 + found_offset, gain * 0.5 + offset, atol=0.03)
    np.testing.assert_allclose(found_gain, gain, atol=0.12)


def test_objects_that_differ_make_no_source_paler() -> None:
    """Half of the variance is each object's own: least squares would give a gain of a half."""
    common = textured(4000, 0)
    own = [0.15 * np.random.default_rng(seed).standard_normal(common.shape) for seed in (1, 2)]
    gain, _ = matched_light(common + own[0], common + own[1], np.ones(4000))
    assert (gain > 0.85).all() and (gain < 1.15).all()


def test_light_without_weight_is_as_it_is() -> None:
    gain, offset = matched_light(textured(5, 0), textured(5, 1), np.zeros(5))
    assert np.isfinite(gain).all() and np.isfinite(offset).all()


def test_an_edge_that_most_sources_show_stays_one() -> None:
    """One of five is off by three pixels: a mean has a step of a fifth there."""
    counts = np.full((1, 40), 0.2, np.float32)
    edges = [
        np.repeat((np.arange(40) >= at).astype(np.float32)[None, :, None], 3, 2) for at in (20,) * 4 + (23,)
    ]
    found = _of_most([(edge, counts) for edge in edges], np.full((1, 40), 1, np.float32))
    assert (np.abs(found[0, :, 0] - (np.arange(40) >= 20)) < 0.08).all()

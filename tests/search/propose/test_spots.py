"""Ellipses through spots: told from those that a crowd of spots has by chance."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from p3i.search.config import SearchConfig
from p3i.search.look.evidence import Evidence
from p3i.search.propose.spots import _bits_even, _bits_on, circles
from p3i.vision.image import Image

SIDE = 400


def picture(spots: NDArray) -> Evidence:
    """A picture of dark dots at pixels [N, 2]."""
    grey = np.full((SIDE, SIDE), 0.8, np.float32)
    for x, y in spots:
        cv2.circle(grey, (round(float(x)), round(float(y))), 5, 0.2, -1, cv2.LINE_AA)
    shown = np.ascontiguousarray(np.repeat(grey[..., None], 3, 2))
    return Evidence(Image(shown, np.ones(grey.shape, bool)), SearchConfig(), 35.0)


def ring(count: int, radius: float, center: tuple[float, float], *, first_deg: float) -> NDArray:
    angle = np.radians(first_deg + 360 / count * np.arange(count))
    return np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], 1)


def even(angle: NDArray) -> float:
    """The bits of angles [N] all of which are on an ellipse."""
    return float(_bits_even(angle[None], np.ones((1, len(angle)), bool))[0])


@pytest.mark.parametrize("seed", range(4))
def test_a_ring_in_a_crowd_of_its_own_kind_is_found(seed: int) -> None:
    generator = np.random.default_rng(seed)
    own = ring(10, 70, (150, 220), first_deg=13)
    others = generator.uniform(20, SIDE - 20, (60, 2))
    apart = np.hypot(*(others[:, None] - own).transpose(2, 0, 1)).min(1) > 25
    found = circles(picture(np.concatenate([own, others[apart][:30]])), np.random.default_rng(0))
    # Straight on: the centre in the middle, and hardly a tilt.
    assert any(np.hypot(*(center - (150, 220))) < 8 and camera.tilt_deg < 25 for camera, center in found), [
        np.round(center) for _, center in found
    ]


@given(
    st.integers(4, 20),
    st.integers(0, 3),
    st.floats(0, 2 * np.pi),
    st.lists(st.floats(-0.02, 0.02), min_size=20),
)
def test_even_steps_speak_wherever_they_begin(
    count: int, hidden: int, first: float, off: list[float]
) -> None:
    angle = np.arange(count - min(hidden, count - 4)) * 2 * np.pi / count
    angle = angle + np.array(off)[: len(angle)] / count
    assert even(angle + first) == pytest.approx(even(angle), abs=1e-6)
    assert even(angle) > len(angle) / np.log(2) - 6


def test_uneven_steps_hardly_speak() -> None:
    generator = np.random.default_rng(1)
    bits = [even(generator.uniform(0, 2 * np.pi, 10)) for _ in range(400)]
    # Of k such bits 2^-k is the share that chance allows.
    assert np.mean(np.array(bits) > 4) < 2**-4
    assert max(bits) < 12


@given(st.integers(6, 60), st.floats(0.005, 0.2), st.data())
def test_a_spot_that_comes_nearer_never_says_less(count: int, share: float, data: st.DataObject) -> None:
    off = np.array(data.draw(st.lists(st.floats(0, 3), min_size=count, max_size=count)))
    off[:5] = 0.0  # those that fix the conic
    nearer = off.copy()
    nearer[data.draw(st.integers(5, count - 1))] *= 0.3
    before, after = _bits_on(np.stack([off, nearer]), np.array([share, share]))
    assert after >= before - 1e-9


def test_as_many_as_by_chance_say_nothing() -> None:
    off = np.full((1, 45), 2.0)
    off[0, :9] = 0.9  # five that fix it, and a tenth of the others
    assert _bits_on(off, np.array([0.1]))[0] == 0.0
    assert _bits_on(off, np.array([0.01]))[0] > 7

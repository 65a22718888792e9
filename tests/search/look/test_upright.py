"""Objects on a ring turn with it or stand upright: the photo says which."""

import numpy as np
import pytest
from drawn import DrawnRing

from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.search.config import SearchConfig
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import UPRIGHT_BITS
from p3i.search.look.upright import as_it_stands
from p3i.vision.image import Image


def stands(ring: DrawnRing) -> tuple[Pattern, float]:
    evidence, filling = ring.evidence(), ring.filling()
    theta = filling.theta(ring.numbers(filling))
    index = filling.pattern.index[evidence.in_sight(filling.pattern, theta)].double()
    return as_it_stands(evidence, filling.pattern, index, focal_mm=35.0, theta=theta)


@pytest.mark.parametrize("upright", [False, True])
def test_a_ring_stands_as_it_was_drawn(upright: bool) -> None:
    pattern, bits = stands(DrawnRing(upright=upright))
    assert pattern.upright is upright
    assert bits > 100


def test_spots_that_look_the_same_turned_are_taken_to_turn() -> None:
    """That they stand upright has a price, and says nothing more."""
    ring = DrawnRing(
        count=4, slots=4, radius=20.0
    )  # a quarter turn takes one flag to the next, but no flag to itself
    turned, bits = stands(ring)
    assert not turned.upright
    assert bits > UPRIGHT_BITS


def test_the_steps_of_a_gradient_that_was_rounded_to_eight_bits_are_no_objects() -> None:
    """They are alike wherever one looks upright, each a hair's breadth beside the next."""
    ramp = np.linspace(0, 1, 240)[:, None, None]
    sky = (1 - ramp) * np.array([70, 120, 200]) + ramp * np.array([190, 215, 240])
    pixels = (np.broadcast_to(sky, (240, 320, 3)).round() / 255).astype(np.float32)
    evidence = Evidence(Image(pixels, np.ones(pixels.shape[:2], bool)), SearchConfig(), 35.0)
    ring = compile(
        parse(
            "SetCameraPose(rx=-42.118, ry=-46.861)\nfor j in range(0, 16):\n"
            "    Draw(x=27.2108*Cos(15*j + 150) + 137.1265, y=27.2108*Sin(15*j + 150) - 110.7314)\n"
        )
    )
    index = ring.index[evidence.in_sight(ring)].double()
    assert as_it_stands(evidence, ring, index, focal_mm=35.0)[1] < 10

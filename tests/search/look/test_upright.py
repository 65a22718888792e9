"""Objects on a ring turn with it or stand upright: the photo says which."""

import pytest
from drawn import DrawnRing

from p3i.interp.pattern import Pattern
from p3i.search.look.recurrence import UPRIGHT_BITS
from p3i.search.look.upright import as_it_stands


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

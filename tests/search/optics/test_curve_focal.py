"""Whether a ring takes another focal than the assumed one: where its objects tell it, and not otherwise."""

import pytest
from drawn import DrawnRing

from p3i.search.fit.places import CurveFit, follow, measured
from p3i.search.optics.curve_focal import with_paid_focal


def free(ring: DrawnRing) -> CurveFit:
    """A ring fitted with the focal free, from its own numbers under the assumed one."""
    filling = ring.filling()
    start = measured(ring.evidence(), filling, ring.numbers(filling), focal_mm=35.0)
    assert start is not None
    return follow(ring.evidence(), start, rounds=4, free_focal=True)


def test_a_ring_seen_at_a_slant_keeps_the_focal_that_it_tells() -> None:
    ring = DrawnRing(focal_mm=60.0, rx_deg=-42.0, radius=30.0, count=24, slots=24, size=4)
    paid = with_paid_focal(ring.evidence(), free(ring))
    assert paid.focal_mm == pytest.approx(60.0, rel=0.1)


def test_a_ring_seen_straight_on_goes_back_to_the_assumed_focal() -> None:
    ring = DrawnRing(focal_mm=50.0, rx_deg=0.0, ry_deg=3.0)
    fit = free(ring)
    assert fit.focal_mm != 35.0
    assert with_paid_focal(ring.evidence(), fit).focal_mm == 35.0

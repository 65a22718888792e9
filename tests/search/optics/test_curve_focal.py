"""Whether a ring takes another focal than the assumed one: where its objects tell it, and not otherwise."""

import pytest
from drawn import DrawnRing

from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import follow, measured, numbers_of
from p3i.search.forms.spelled import ring_filling
from p3i.search.optics.curve_focal import with_paid_focal


def free(ring: DrawnRing) -> Fit:
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


def test_an_arc_whose_step_happens_to_close_a_ring_may_go_back_to_one_that_does_not() -> None:
    """The first has no number for its step, and the second has."""
    ring = DrawnRing(count=10, slots=12, rx_deg=0.0, ry_deg=3.0)
    filling = ring_filling(0, drawn=10)
    values = ring_filling(12).named(ring.numbers(ring_filling(12))) | {"draw.x.angle.j": 30.0}
    closing = measured(ring.evidence(), filling, numbers_of(filling, values), focal_mm=50.0)
    assert closing is not None
    assert with_paid_focal(ring.evidence(), closing).focal_mm in (35.0, 50.0)

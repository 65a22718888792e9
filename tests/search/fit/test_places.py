"""Fits to objects on curves: spoiled starts are pulled in, a free focal is found, the score is modest."""

from dataclasses import replace

import pytest
import torch
from drawn import DrawnRing, tilt_error_deg

from p3i.search.fit import places
from p3i.search.fit.places import FOCALS_MM, Fit, curve_score, follow, measured, registered
from p3i.search.forms.spelled import ring_filling

RING = DrawnRing()


def started(ring: DrawnRing, **changes: float) -> Fit:
    """The ring's own numbers, spoiled by `changes`, on its photo; the focal is 35 mm."""
    filling = ring.filling()
    fit = measured(ring.evidence(), filling, ring.numbers(filling, **changes), focal_mm=35.0)
    assert fit is not None
    return fit


def error_deg(fit: Fit, ring: DrawnRing) -> float:
    return tilt_error_deg(fit.filling.program(fit.z, ()), ring.rx_deg, ring.ry_deg)


@pytest.mark.parametrize(
    "spoiled",
    [
        {"rx": 4.0, "ry": -3.0, "r": 1.0, "a": 3.0, "x": 1.0, "y": -1.0},
        {"rx": -5.0, "ry": 5.0, "r": -1.2, "a": -4.0},
    ],
    ids=["near", "far"],
)
def test_a_spoiled_start_is_pulled_in(spoiled: dict[str, float]) -> None:
    start = started(RING, **spoiled)
    fit = follow(RING.evidence(), start, rounds=4)
    assert error_deg(start, RING) > 4
    assert error_deg(fit, RING) < 0.3
    assert fit.quality > 0.9 > start.mean
    torch.testing.assert_close(fit.z[-2:], torch.tensor(RING.center).double(), atol=0.1, rtol=0)


def test_missing_and_strayed_objects_hardly_move_the_fit() -> None:
    ring = DrawnRing(missing=frozenset({4}), nudges={1: (2.5, 0.0), 8: (0.0, 2.0)})
    fit = follow(ring.evidence(), started(ring, rx=3.0, ry=3.0), rounds=5)
    assert error_deg(fit, ring) < 1


@pytest.mark.parametrize("focal_mm", [50.0, 26.0])
def test_a_free_focal_is_found_and_a_stated_one_stays(focal_mm: float) -> None:
    ring = DrawnRing(focal_mm=focal_mm, rx_deg=-42.0, radius=30.0)
    evidence = ring.evidence()
    stated = follow(evidence, started(ring, rx=1.0, ry=-1.0), rounds=4)
    free = follow(evidence, stated, rounds=5, free_focal=True)
    assert stated.focal_mm == 35.0
    assert free.focal_mm == pytest.approx(focal_mm, rel=0.05)
    assert error_deg(free, ring) < 0.5 < error_deg(stated, ring)
    assert free.quality > stated.quality


def test_a_focal_at_its_bound_has_the_numbers_that_belong_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "FOCALS_MM", (20.0, 80.0))
    ring = DrawnRing(focal_mm=130.0, rx_deg=-42.0, radius=24.0)
    evidence = ring.evidence()
    stated = follow(evidence, started(ring), rounds=4)
    bounded = registered(evidence, stated, free_focal=True)
    for _ in range(40):
        if bounded is None or bounded.focal_mm == 80.0:
            break
        bounded = registered(evidence, bounded, free_focal=True)
    assert bounded is not None
    bounded = registered(evidence, bounded, free_focal=True)  # what all objects are like has settled
    assert bounded is not None and bounded.focal_mm == 80.0
    again = registered(evidence, bounded)
    assert again is not None and again.focal_mm == 80.0
    assert error_deg(again, ring) == pytest.approx(error_deg(bounded, ring), abs=0.1)
    torch.testing.assert_close(again.z, bounded.z, atol=0.3, rtol=0)


def test_a_fit_that_holds_the_focal_holds_the_one_that_it_has() -> None:
    """Not the one assumed for the photo: the numbers would belong to that."""
    ring = DrawnRing(focal_mm=50.0, rx_deg=-42.0, radius=30.0)
    filling = ring.filling()
    true = measured(ring.evidence(), filling, ring.numbers(filling), focal_mm=50.0)
    assert true is not None
    held = registered(ring.evidence(), true)
    assert held is not None and held.focal_mm == 50.0
    torch.testing.assert_close(held.z, true.z, atol=0.2, rtol=0)


def test_seen_straight_on_the_prior_holds_the_focal() -> None:
    """Without tilt the pattern says nothing of the focal."""
    ring = DrawnRing(focal_mm=50.0, rx_deg=0.0, ry_deg=0.0)
    fit = follow(ring.evidence(), started(ring), rounds=3, free_focal=True)
    assert FOCALS_MM[0] < fit.focal_mm < 42


def test_fewer_than_three_objects_in_sight_are_no_fit() -> None:
    filling = ring_filling(12)
    away = RING.numbers(filling, x=300.0)
    assert measured(RING.evidence(), filling, away, focal_mm=35.0) is None


def test_the_score_leaves_out_what_chance_finds_and_trusts_few_objects_less() -> None:
    fit = started(RING)

    def scored(count: int, contrast: float, cost: float = 0.0) -> float:
        return curve_score(replace(fit, contrast=torch.full((count,), contrast), cost=cost))

    assert scored(12, 0.1) == scored(12, -0.5) == scored(3, 1.0) == 0
    assert 0 < scored(5, 0.8) < scored(12, 0.8) < scored(40, 0.8) < 0.8
    assert scored(40, 1.0, cost=1.0) < 0.5 * scored(40, 1.0)
    assert scored(10_000, 1.0) == pytest.approx(1.0, abs=1e-3)

"""Unrolled photos: a ring is a row whose autocorrelation tells the count, and turning it shifts the row."""

import math

import numpy as np
import pytest
from drawn import DrawnRing

from p3i.search.look.unrolled import Strip, best_rows, gradients, likeness, unroll


def strip_of(ring: DrawnRing, *, about: float | None = None, shift: float = 0.0) -> Strip:
    """The ring's photo unrolled under its own pose, `shift` program units beside its centre."""
    center = np.array([ring.center[0] + shift, ring.center[1]])
    strip = unroll(ring.evidence(), (ring.rx_deg, ring.ry_deg), center, focal_mm=35.0, about=about)
    assert strip is not None
    return strip


def ring_of(count: int, **changes: float) -> DrawnRing:
    return DrawnRing(count=count, slots=count, size=min(6.0, 60 / count), **changes)  # pyright: ignore


@pytest.mark.parametrize("count", [5, 8, 12, 17])
def test_the_best_row_tells_count_and_radius(count: int) -> None:
    best = best_rows(strip_of(ring_of(count)))[0]
    assert best.count == count
    assert best.radius == pytest.approx(24, rel=0.12)
    assert best.worth > 0.6


@pytest.mark.parametrize("count", [5, 12, 24])
def test_a_narrow_strip_looks_most_like_its_own_count(count: int) -> None:
    strip = strip_of(ring_of(count), about=24.0)
    assert likeness(strip, count) > 0.9
    assert max(likeness(strip, other) for other in (count - 1, count + 1)) < 0.85
    assert strip.radii[0] == pytest.approx(24 / 1.5) and strip.radii[-1] < 24 * 1.5


def test_a_strip_about_another_place_looks_less_like_a_ring() -> None:
    ring = DrawnRing()
    near, far = (likeness(strip_of(ring, about=24.0, shift=shift), 12) for shift in (0.0, 5.0))
    assert far < 0.5 * near


def test_turning_a_ring_shifts_its_row() -> None:
    flat = {"rx_deg": 0.0, "ry_deg": 0.0, "noise": 0.0}
    first = strip_of(DrawnRing(first_deg=0.0, **flat)).values  # pyright: ignore[reportArgumentType]
    turned = strip_of(DrawnRing(first_deg=10.0, **flat)).values  # pyright: ignore[reportArgumentType]
    columns = round(10 / 360 * first.shape[2])

    def alike(a: np.ndarray, b: np.ndarray) -> float:
        return float((a * b).sum() / math.sqrt(float((a * a).sum() * (b * b).sum())))

    assert alike(np.roll(first, columns, 2), turned) > 0.85
    assert alike(first, turned) < 0.5


def test_a_plain_picture_has_no_rows_of_worth() -> None:
    nothing = DrawnRing(missing=frozenset(range(12)), noise=0.0)
    assert all(abs(row.worth) < 1e-3 for row in best_rows(strip_of(nothing)))


def test_a_centre_far_outside_the_photo_has_no_strip() -> None:
    ring = DrawnRing(rx_deg=0.0, ry_deg=0.0)
    assert unroll(ring.evidence(), (0.0, 0.0), np.array([500.0, 0.0]), focal_mm=35.0) is None


def test_gradients_go_round_where_the_strip_meets_itself() -> None:
    """A strip that is rolled has rolled gradients: nothing stands out at the seam."""
    lab = np.random.default_rng(0).uniform(0, 100, (20, 48, 3)).astype(np.float32)
    np.testing.assert_allclose(np.roll(gradients(lab), 7, 2), gradients(np.roll(lab, 7, 1)), atol=0.01)

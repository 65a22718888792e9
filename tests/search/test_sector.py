"""Where on its ring an object sits: a fit on the wrong radius and between objects is put onto them."""

import numpy as np
import pytest
from drawn import DrawnRing

from p3i.search.sector import Place, Ring, places

DRAWN = DrawnRing()


def told(
    *, radius: float, turn_deg: float, ring: DrawnRing = DRAWN, weights: np.ndarray | None = None
) -> Place:
    """The best place for a fit of the drawn ring at another radius, turned by `turn_deg`."""
    fit = Ring(
        center=np.array(ring.center),
        radius=radius,
        first_deg=ring.first_deg + turn_deg,
        step_deg=360 / ring.slots,
        index=np.arange(ring.count, dtype=float),
        weights=np.ones(ring.count) if weights is None else weights,
        image_from_plane=ring.image_from_plane,
    )
    return places(ring.evidence(), fit)[0]


@pytest.mark.parametrize("turn_deg", [0.0, 9.0, -12.0])
@pytest.mark.parametrize("radius", [20.0, 24.0, 28.0])
def test_the_objects_radius_and_turn_are_found_from_beside_them(radius: float, turn_deg: float) -> None:
    place = told(radius=radius, turn_deg=turn_deg)
    assert abs(place.radius - DRAWN.radius) < 0.3 * DRAWN.size
    away_deg = (turn_deg + place.turn_deg + 15) % 30 - 15
    assert abs(np.radians(away_deg) * DRAWN.radius) < 0.3 * DRAWN.size


def test_the_radius_that_more_repeats_at_is_told_first() -> None:
    found = places(
        DRAWN.evidence(),
        Ring(np.array(DRAWN.center), 26.0, 20.0, 30.0, np.arange(12.0), np.ones(12), DRAWN.image_from_plane),
    )
    assert [place.worth for place in found] == sorted((place.worth for place in found), reverse=True)
    assert all(place.worth > 0 for place in found)


def test_objects_that_are_not_there_do_not_mislead_where_they_weigh_nothing() -> None:
    half = DrawnRing(missing=frozenset(range(6, 12)))
    weights = np.array([1.0] * 6 + [0.0] * 6)
    place = told(radius=22.0, turn_deg=8.0, ring=half, weights=weights)
    assert abs(place.radius - half.radius) < 0.3 * half.size


def test_objects_of_which_none_is_sure_still_have_a_place() -> None:
    place = told(radius=26.0, turn_deg=5.0, weights=np.linspace(-0.3, -0.1, DRAWN.count))
    assert place.worth > 0

"""Where on its ring an object sits: a fit on the wrong radius and between objects is put onto them."""

from dataclasses import replace

import numpy as np
import pytest
from drawn import DrawnRing

from p3i.interp.camera import Camera
from p3i.search.config import SearchConfig
from p3i.search.extent.sector import Place, Ring, places
from p3i.search.look.evidence import Evidence
from p3i.size import Size
from p3i.vision.image import Image

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


@pytest.mark.parametrize("larger", [24.0, 15.0])
def test_of_two_circles_of_objects_that_with_the_larger_ones_is_told_first(larger: float) -> None:
    smaller = 39.0 - larger
    outer, inner = (
        DrawnRing(radius=radius, size=size, noise=0.0).image()
        for radius, size in ((larger, 4.0), (smaller, 2.6))
    )
    drawn = np.abs(inner.pixels - inner.pixels[0, 0]).max(2, keepdims=True) > 0.02
    both = replace(outer, pixels=np.where(drawn, inner.pixels, outer.pixels))
    ring = Ring(
        np.array(DRAWN.center), 19.0, 20.0, 30.0, np.arange(12.0), np.ones(12), DRAWN.image_from_plane
    )
    radii = [place.radius for place in places(Evidence(both, SearchConfig(), 35.0), ring)]
    assert radii[0] == pytest.approx(larger, abs=1.5)


def test_objects_that_are_not_there_do_not_mislead_where_they_weigh_nothing() -> None:
    half = DrawnRing(missing=frozenset(range(6, 12)))
    weights = np.array([1.0] * 6 + [0.0] * 6)
    place = told(radius=22.0, turn_deg=8.0, ring=half, weights=weights)
    assert abs(place.radius - half.radius) < 0.3 * half.size


def test_objects_of_which_none_is_sure_still_have_a_place() -> None:
    place = told(radius=26.0, turn_deg=5.0, weights=np.linspace(-0.3, -0.1, DRAWN.count))
    assert abs(place.radius - DRAWN.radius) < 0.5 * DRAWN.size


def painted(grey: np.ndarray) -> Evidence:
    shown = np.ascontiguousarray(np.repeat(np.clip(grey, 0, 1)[..., None], 3, 2), np.float32)
    return Evidence(Image(shown, np.ones(grey.shape, bool)), SearchConfig(), 35.0)


def polar(side: int) -> tuple[np.ndarray, np.ndarray]:
    """The radius in pixels and the angle in degrees of each pixel about the middle."""
    y, x = np.mgrid[0:side, 0:side] - (side - 1) / 2
    return np.hypot(x, y), np.degrees(np.arctan2(y, x)) % 360


def straight_on(*, first_deg: float, count: int, radius: float, side: int) -> Ring:
    seen = Camera(0, 0, 35.0).image_from_plane(Size(side, side)).numpy()
    index = np.arange(count, dtype=float)
    return Ring(np.zeros(2), radius, first_deg, 360 / count, index, np.ones(count), seen)


@pytest.mark.parametrize("first_deg", [0.0, 4.0, 9.0])
def test_fields_of_two_kinds_are_the_objects_not_the_borders_between_them(first_deg: float) -> None:
    side, count = 300, 20
    radius, angle = polar(side)
    field = (angle // (360 / count)) % 2
    grey = np.where((radius > 80) & (radius < 110), 0.2 + 0.6 * field, 0.5)
    border = np.abs((angle + 9) % 18 - 9) * np.pi / 180 * radius < 1.2
    grey = np.where(border & (radius < 112), 1.0, grey)
    ring = straight_on(first_deg=first_deg, count=count, radius=95 / side * 100, side=side)
    place = places(painted(grey), ring)[0]
    assert abs((first_deg + place.turn_deg) % 18 - 9) < 2.5

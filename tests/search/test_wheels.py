"""Wheels: gondolas that hang, seen from afar through a long lens."""

import dataclasses

import numpy as np
import pytest
from drawn import DrawnRing, tilt_error_deg

import p3i
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.search.config import SearchConfig
from p3i.search.extent.ring import drawn_ring
from p3i.search.fit.places import fitted
from p3i.search.forms.filling import standing
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.size import Size

WHEEL = DrawnRing(
    count=16,
    slots=16,
    center=(2.0, 3.0),
    radius=26.0,
    size=5.0,
    rx_deg=-20.0,
    ry_deg=34.0,
    canvas=Size(640, 480),
    upright=True,
)


def away_px(result: SynthesisResult, ring: DrawnRing) -> float:
    """How far the objects of a ring lie from those found next to them, at most."""
    found = np.array([(x, y) for x, y, _, _ in result.centers])
    return float(np.linalg.norm(ring.seen(ring.places())[:, None] - found, axis=2).min(1).max())


def test_the_gondolas_of_a_wheel_are_found_where_they_hang() -> None:
    result = synthesize(WHEEL.image(), SearchConfig(focal_mm=35.0))
    assert result.program is not None and result.structure == "circular"
    assert result.upright
    assert len(points(result.program)) == WHEEL.count
    assert tilt_error_deg(result.program, WHEEL.rx_deg, WHEEL.ry_deg) < 1.5
    assert away_px(result, WHEEL) < 0.5 * WHEEL.size * WHEEL.canvas.unit_px


def test_a_ring_of_upright_objects_is_as_sure_as_it_is_plain() -> None:
    """Moved to its objects' middles it kept no misfit of its places, which counted as the worst."""
    look = Session(Evidence(WHEEL.image(), SearchConfig(), 35.0), SearchConfig())
    filling = standing(ring_filling(WHEEL.count), upright=True)
    near = {  # the true numbers, but for a part of a gondola
        "camera.rx": WHEEL.rx_deg,
        "camera.ry": WHEEL.ry_deg,
        "draw.x.radius.1": WHEEL.radius + 1,
        "draw.x.angle.1": WHEEL.first_deg + 2,
        "draw.x.offset.1": WHEEL.center[0],
        "draw.y.offset.1": WHEEL.center[1],
    }
    fit = fitted(look, filling, near, focal_mm=35.0, rounds=4)
    assert fit is not None
    assert drawn_ring(look, fit).sure > 0.5


def test_a_wheel_says_in_its_header_that_its_objects_hang_and_none_is_absent() -> None:
    result = p3i.synth(WHEEL.image(), focal_mm=35.0)
    assert result.program is not None and result.program.header is not None
    assert dict(result.program.header.fit)["upright"] is True
    assert result.record(image=None)["upright"] is True
    assert any("upright" in note for note in result.notes)
    assert result.absent == 0


def test_objects_that_turn_are_not_called_upright() -> None:
    result = p3i.synth(dataclasses.replace(WHEEL, upright=False).image(), focal_mm=35.0)
    assert result.program is not None and result.program.header is not None
    assert not result.upright
    assert "upright" not in dict(result.program.header.fit)
    assert "upright" not in result.record(image=None)


@pytest.mark.parametrize("focal_mm", [120.0, 200.0])
def test_an_open_ring_seen_through_a_long_lens_tells_its_focal(focal_mm: float) -> None:
    """Under 35 mm it would be an ellipse."""
    ring = DrawnRing(
        count=13, slots=20, radius=30.0, rx_deg=8.0, ry_deg=-58.0, focal_mm=focal_mm, canvas=Size(640, 480)
    )
    result = synthesize(ring.image(), SearchConfig())
    assert result.program is not None and result.structure == "circular"
    camera = Camera.of(result.program, focal_mm=result.focal_mm)
    assert result.focal_mm > 70
    assert abs(camera.ry_deg - ring.ry_deg) < 4
    assert away_px(result, ring) < 0.5 * ring.size * ring.canvas.unit_px

"""The focal that a lattice fixes, its cell taken as a square, a rectangle, a hexagon or a rhombus."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.evaluation.scenes import lattice_scene
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Polar, Program
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.optics.focal import estimate_focal, refocused
from p3i.search.synthesize import synthesize
from p3i.size import Size

SIZE = Size(640, 480)
TILTED = math.radians(45)


def lattice(
    *,
    tilt: float,
    azimuth: float,
    focal_mm: float,
    ratio: float = 1.0,
    angle: float = 90.0,
    turn: float = 20.0,
) -> Program:
    """An 8 x 8 lattice under a camera with this focal: sides 10 and 10 * ratio, `angle` degrees between."""
    normal = (math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt))
    camera = Camera.from_normal(normal, focal_mm=focal_mm)
    first, second = math.radians(turn), math.radians(turn + angle)
    u = 10 * math.cos(first), 10 * math.sin(first)
    v = 10 * ratio * math.cos(second), 10 * ratio * math.sin(second)
    x, y = (Affine(u[k], v[k], -3.5 * (u[k] + v[k])) for k in (0, 1))
    rows = For("j", Affine(), Affine(constant=8), Draw(x, y))
    return Program(CameraPose(camera.rx_deg, camera.ry_deg), For("i", Affine(), Affine(constant=8), rows))


def at_35mm(program: Program, focal_mm: float) -> Program:
    """What a search that assumes 35 mm finds of a picture of `program` taken with another lens."""
    return refocused(program, from_mm=focal_mm, to_mm=35.0)


@given(
    tilt=st.floats(0.05, 1.1),
    azimuth=st.floats(0, 6.28),
    focal=st.floats(18, 120),
    angle=st.floats(55, 125),
    ratio=st.floats(0.5, 2),
)
@settings(max_examples=60, deadline=None)
def test_told_with_another_focal_the_points_in_the_photo_stay(tilt, azimuth, focal, angle, ratio) -> None:
    program = lattice(tilt=tilt, azimuth=azimuth, focal_mm=focal, angle=angle, ratio=ratio)
    before, seen = compile(program).centers_px(size=SIZE, focal_mm=focal)
    after, also_seen = compile(at_35mm(program, focal)).centers_px(size=SIZE, focal_mm=35.0)
    assert torch.equal(seen, also_seen)
    near = seen & (before.abs() < 1000).all(1)
    assert float((before - after)[near].abs().max()) < 0.05


@pytest.mark.parametrize("focal", [28.0, 35.0, 50.0, 85.0])
@pytest.mark.parametrize(
    ("shape", "facts"),
    [("square", {}), ("rectangle", {"ratio": 1.4}), ("hexagon", {"angle": 60.0})],
)
def test_a_cell_of_a_known_kind_tells_the_focal(focal: float, shape: str, facts: dict[str, float]) -> None:
    program = lattice(tilt=TILTED, azimuth=0.9, focal_mm=focal, **facts)
    found = estimate_focal(at_35mm(program, focal), size=SIZE, focal_mm=35.0)
    assert (found.shape, found.focal_mm) == (shape, pytest.approx(focal, rel=0.02))
    assert f"taken as a {shape}" in found.reason


def test_a_pattern_seen_straight_on_tells_no_focal() -> None:
    program = lattice(tilt=math.radians(4), azimuth=0.9, focal_mm=50)
    found = estimate_focal(at_35mm(program, 50), size=SIZE, focal_mm=35.0)
    assert found.focal_mm is None and "straight on" in found.reason


def test_a_rectangle_along_the_horizon_tells_no_focal() -> None:
    """Its one side has no vanishing point, so its right angle holds under any focal."""
    program = lattice(tilt=TILTED, azimuth=math.radians(90), focal_mm=50, ratio=1.6, turn=0)
    found = estimate_focal(at_35mm(program, 50), size=SIZE, focal_mm=35.0)
    assert found.focal_mm is None and "one of its directions" in found.reason


def test_a_cell_that_could_be_two_things_tells_no_focal() -> None:
    program = lattice(tilt=TILTED, azimuth=1.2, focal_mm=50, angle=80)
    found = estimate_focal(at_35mm(program, 50), size=SIZE, focal_mm=35.0)
    assert found.focal_mm is None and found.reason.startswith("the cell may be a rectangle (32 mm) or")


def test_only_a_lattice_is_told_with_another_focal() -> None:
    ring = Polar("Cos", Affine(constant=20), Affine(j=30), Affine())
    program = Program(CameraPose(-40), For("j", Affine(), Affine(constant=12), Draw(ring, ring)))
    with pytest.raises(ValueError, match="lattice"):
        refocused(program, from_mm=35, to_mm=50)
    assert estimate_focal(program, size=SIZE, focal_mm=35).focal_mm is None


# Scenes whose cells are squares and rectangles, by the focal that they were rendered with.
@pytest.mark.parametrize(("seed", "focal"), [(8, 35.0), (12, 24.0), (3, 50.0)])
def test_auto_finds_the_focal_of_a_rendered_scene(seed: int, focal: float) -> None:
    scene = lattice_scene(seed, focal_mm=focal, size=Size(448, 336), tilt_deg=(15, 55))
    result = synthesize(scene.image(), SearchConfig(focal_mm="auto"))
    assert result.focal_source == "pattern", result.focal_reason
    assert result.focal_mm == pytest.approx(focal, rel=0.08)
    assert result.program is not None
    found = Camera(result.program.camera.rx_deg, result.program.camera.ry_deg).normal
    cosine = float(np.dot(found, scene.camera.normal))
    assert math.degrees(math.acos(min(1.0, cosine))) < 1.5

"""The mirrored tilt of a ring: told where the objects leave it open, and only there."""

import pytest
from drawn import DrawnRing

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.optics.mirrored import ambiguity_note, mirrored_camera

# Six objects far from the camera, beside the picture's size, and a ring that fills the picture.
FAR = DrawnRing(count=6, slots=6, center=(0, 0), radius=5, size=3, rx_deg=-30, ry_deg=0, noise=0.02)
NEAR = DrawnRing()


def answer(ring: DrawnRing) -> Answer:
    angle = f"{360 / ring.slots:g}*j + {ring.first_deg:g}"
    x, y = ring.center
    program = parse(
        f"SetCameraPose(rx={ring.rx_deg:g}, ry={ring.ry_deg:g})\nfor j in range(0, {ring.count}):\n"
        f"    Draw(x={ring.radius:g}*Cos({angle}) + {x:g}, y={ring.radius:g}*Sin({angle}) + {y:g})\n"
    )
    assert isinstance(program, Program)
    return Answer(program, "circular", 0.5, 100.0)


def test_a_small_ring_leans_to_either_side() -> None:
    other = mirrored_camera(FAR.evidence(), answer(FAR))
    assert other is not None
    assert other.rx_deg == pytest.approx(-FAR.rx_deg, abs=8) and other.ry_deg == pytest.approx(0, abs=8)


def test_a_ring_that_fills_the_picture_tells_its_tilt() -> None:
    assert mirrored_camera(NEAR.evidence(), answer(NEAR)) is None


def test_a_ring_seen_straight_on_has_one_tilt() -> None:
    flat = DrawnRing(count=6, slots=6, center=(0, 0), radius=9, size=4, rx_deg=0, ry_deg=0)
    assert mirrored_camera(flat.evidence(), answer(flat)) is None


def test_rows_have_no_mirrored_tilt() -> None:
    rows = parse("for i in range(0, 4):\n    for j in range(0, 4):\n        Draw(x=9*i - 15, y=9*j - 15)\n")
    assert mirrored_camera(NEAR.evidence(), Answer(rows, "lattice", 0.5, 100.0)) is None


def test_the_note_names_both_angles_of_the_other_tilt() -> None:
    assert "rx=30.0, ry=-4.5" in ambiguity_note(Camera(30.04, -4.46))

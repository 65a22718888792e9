"""Annotations say the same as the programs, read the way a scorer reads them."""

import math
from typing import Any

import numpy as np
import pytest

from p3i.evaluation.scenes import annotation, hybrid_scene, lattice_scene, ring_scene


def image_from_plane_px(pose: dict[str, float], width: int, height: int) -> np.ndarray:
    """Plane pixels to pixels through a 35 mm lens, written out anew."""
    a, b = math.radians(pose["rx"]), math.radians(pose["ry"])
    turn_x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    turn_y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    focal = 35 / 36 * max(width, height)
    lens = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    turn = turn_y @ turn_x
    return lens @ np.column_stack([turn[:, 0], turn[:, 1], [0, 0, focal]])


def seen(said: dict[str, Any], plane_px: np.ndarray) -> np.ndarray:
    matrix = image_from_plane_px(said["pose"], said["width"], said["height"])
    mapped = np.column_stack([plane_px, np.ones(len(plane_px))]) @ matrix.T
    return mapped[:, :2] / mapped[:, 2:]


def ring_points(ring: dict[str, Any]) -> np.ndarray:
    """The objects of a ring in plane pixels, from its own numbers."""
    turns = np.radians(ring["step_deg"] * np.array(ring["present"]))
    if "ellipse_e1" in ring:
        first, second = np.array(ring["ellipse_e1"]), np.array(ring["ellipse_e2"])
        return np.array(ring["center"]) + np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    turns = turns + np.radians(ring["phase_deg"])
    return np.array(ring["center"]) + ring["radius"] * np.column_stack([np.cos(turns), np.sin(turns)])


def test_a_lattice_is_base_plus_steps() -> None:
    said = annotation(lattice_scene(2), "a.png")
    lattice, indices = said["lattice"], np.array(said["indices"])
    plane = np.array(lattice["base"]) + indices @ np.array([lattice["u"], lattice["v"]])
    np.testing.assert_allclose(seen(said, plane), said["centers"], atol=0.02)
    assert said["structure"] == "lattice" and said["accept_structure"] == ["lattice"]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", [ring_scene, hybrid_scene])
def test_rings_are_centre_radius_phase_and_step(make: Any, seed: int) -> None:
    drawn = make(seed, clutter=2)
    said = annotation(drawn, "a.png")
    assert said["structure"] == drawn.structure in said["accept_structure"]
    together = []
    for ring in said["rings"]:
        assert ring["n"] == len(ring["present"]) == len(ring["centers"])
        assert ring["slots"] * ring["step_deg"] == pytest.approx(360)
        np.testing.assert_allclose(seen(said, ring_points(ring)), ring["centers"], atol=0.02)
        together += ring["centers"]
    assert together == said["centers"]
    assert said["hidden"] == np.flatnonzero(drawn.hidden).tolist()
    assert (len(said["rings"]) == 1) == (drawn.structure == "circular")


def test_the_region_holds_every_object() -> None:
    import cv2

    said = annotation(ring_scene(6), "a.png")
    hull = np.array(said["roi"], np.float32)
    assert all(cv2.pointPolygonTest(hull, center, True) > -0.1 for center in said["centers"])


def test_another_lens_is_told_by_its_vanishing_line_and_ellipses() -> None:
    others = 0
    for seed in range(6):
        drawn = ring_scene(seed, focals=True, clutter=0)
        said = annotation(drawn, "a.png")
        assert said["pose"]["focal_mm"] == 35
        if drawn.camera.focal_mm == 35:
            assert "camera" not in said and "ellipse_e1" not in said["rings"][0]
            continue
        others += 1
        assert said["camera"]["focal_mm"] == drawn.camera.focal_mm
        assert 24 <= drawn.camera.focal_mm <= 60
        np.testing.assert_allclose(seen(said, ring_points(said["rings"][0])), said["centers"], atol=0.05)
    assert others


def test_a_pose_that_few_objects_hardly_fix_is_not_called_reliable() -> None:
    for seed in range(4):
        drawn = ring_scene(seed, clutter=0)
        said = annotation(drawn, "a.png")
        assert drawn.pose_sigma_deg is not None
        assert said["pose_reliable"] == (drawn.pose_sigma_deg <= 0.5)
        assert said["pose_sigma_deg"] == pytest.approx(drawn.pose_sigma_deg, abs=1e-3)

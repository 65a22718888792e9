"""Rendered rings and hybrids: repeatable, fair by their own rules, and true."""

import cv2
import numpy as np
import pytest

from p3i.errors import UsageError
from p3i.evaluation import ring_plan
from p3i.evaluation.ring_layout import RingLayout, pose_sigma_deg
from p3i.evaluation.ring_looks import DOTS, MARKS, pointed
from p3i.evaluation.scene import Scene
from p3i.evaluation.scenes import hybrid_scene, ring_scene, scene
from p3i.grammar.ast import Polar
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera
from p3i.interp.unroll import nest, points
from p3i.language import check
from p3i.size import Size

RINGS = range(8)
HYBRIDS = range(6)


@pytest.fixture(scope="module")
def scenes() -> dict[tuple[str, int], Scene]:
    made = {("circular", seed): ring_scene(seed) for seed in RINGS}
    return made | {("hybrid", seed): hybrid_scene(seed) for seed in HYBRIDS}


def test_a_seed_gives_the_same_picture_twice_and_another_seed_another(scenes: dict) -> None:
    for structure in ("circular", "hybrid"):
        first, again, other = scenes[structure, 3], scene(structure, 3), scenes[structure, 4]
        np.testing.assert_array_equal(first.pixels, again.pixels)
        assert first.program == again.program != other.program
        assert first.jpeg == again.jpeg


def test_programs_are_in_normal_form_and_draw_what_the_truth_lists(scenes: dict) -> None:
    for (structure, _), drawn in scenes.items():
        text = format_program(drawn.program)
        assert parse(text) == drawn.program and list(check(text)) == []
        assert text.count("for ") == (1 if structure == "circular" else 2) and "Cos(" in text
        assert drawn.structure == structure
        rays = np.array(points(drawn.program))
        matrix = drawn.camera.image_from_plane(drawn.size).numpy()
        mapped = np.column_stack([rays[:, :2], np.ones(len(rays))]) @ matrix.T
        pixels = mapped[:, :2] / mapped[:, 2:]
        corner = (drawn.size.width - 1, drawn.size.height - 1)
        inside = ((pixels >= 0) & (pixels <= corner)).all(axis=1)
        np.testing.assert_allclose(drawn.centers_px, pixels[inside], atol=1e-6)
        assert drawn.index.tolist() == rays[inside, 2:].astype(int).tolist()


def test_pictures_keep_their_limits(scenes: dict) -> None:
    for drawn in scenes.values():
        assert drawn.pixels.dtype == np.uint8 and drawn.pixels.shape[2] == 3
        assert 480 <= drawn.size.longer <= 900
        assert 7.9 < drawn.camera.tilt_deg < 60.1 and drawn.camera.focal_mm == 35
        assert drawn.hidden.mean() <= 0.15
        assert drawn.pose_sigma_deg is not None
        assert len(drawn.index) < 8 or drawn.pose_sigma_deg <= 0.3
        apart = np.linalg.norm(drawn.centers_px[:, None] - drawn.centers_px, axis=2)
        assert (apart + 1e9 * np.eye(len(apart))).min() >= 14 * drawn.size.longer / 640 - 1e-6


def test_scenes_differ_in_kind(scenes: dict) -> None:
    rings = [drawn for drawn in scenes.values() if drawn.structure == "circular"]
    assert len({drawn.look for drawn in scenes.values()}) >= 6
    assert len({len(drawn.index) for drawn in rings}) >= 6
    assert {drawn.jpeg is None for drawn in rings} == {True, False}
    assert any(drawn.hidden.any() for drawn in rings)


@pytest.mark.parametrize(("arcs", "seeds"), [(0.0, (1, 2)), (1.0, (0, 1, 2, 3))])
def test_a_ring_is_closed_or_an_arc_of_most_of_the_circle_whose_ends_are_seen(
    arcs: float, seeds: tuple[int, ...]
) -> None:
    for seed in seeds:
        drawn = ring_scene(seed, size=Size(640, 640), clutter=0, arcs=arcs)
        parts = nest(drawn.program)
        assert parts.for_j is not None and isinstance(parts.draw.x, Polar)
        count, step = parts.for_j.stop.constant, parts.draw.x.angle.j
        if not arcs:
            assert count * step == pytest.approx(360)
            continue
        assert 0.6 * 360 - 1e-6 <= count * step <= 360 - 2 * step + 1e-6
        assert len(drawn.index) == count
        assert not drawn.hidden[[0, -1]].any()


def test_hybrids_come_in_three_kinds() -> None:
    for kind in ("concentric", "fan", "row"):
        drawn = hybrid_scene(1, kind=kind)
        world = nest(drawn.program)
        x, y = world.draw.x, world.draw.y
        assert world.for_i is not None and world.for_j is not None
        assert isinstance(x, Polar) and isinstance(y, Polar)
        assert (x.radius.i != 0) == (kind != "row")
        assert ((x.offset.i, y.offset.i) != (0, 0)) == (kind == "row")
        assert (world.for_j.stop.i != 0) == (kind == "fan")
        assert x.radius == y.radius and x.angle == y.angle and (x.function, y.function) == ("Cos", "Sin")
        assert len(set(drawn.index[:, 0].tolist())) in (2, 3, 4)


@pytest.mark.parametrize("look", ["disc", "bolt", "tick", "petal"])
def test_objects_stand_where_the_truth_says(look: str) -> None:
    drawn = ring_scene(5, look=look, jitter=0, noise=0, clutter=0, hidden=0, plates=0, jpeg=0)
    x, y = nest(drawn.program).draw.x, nest(drawn.program).draw.y
    assert isinstance(x, Polar) and isinstance(y, Polar)
    center = np.array([x.offset.constant, y.offset.constant])
    rays = np.array(points(drawn.program))[:, :2] - center
    matrix = drawn.camera.image_from_plane(drawn.size).numpy()

    def colours(plane: np.ndarray) -> np.ndarray:
        mapped = np.column_stack([plane, np.ones(len(plane))]) @ matrix.T
        columns, rows = np.rint(mapped[:, :2] / mapped[:, 2:]).astype(int).T
        lab = cv2.cvtColor(drawn.pixels, cv2.COLOR_RGB2LAB)
        return cv2.blur(lab, (3, 3))[rows, columns].astype(float)

    turn = np.radians(x.angle.j / 2)
    between = rays @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    apart = np.linalg.norm(colours(center + rays) - colours(center + between), axis=1)
    assert np.median(apart) > 20 and apart.min() > 8


def test_what_is_hidden_is_not_seen() -> None:
    found = 0
    for seed in range(12):
        drawn = ring_scene(seed, look="disc", jitter=0, noise=0, clutter=0, plates=0, jpeg=0, hidden=0.15)
        if not drawn.hidden.any():
            continue
        found += 1
        columns, rows = np.rint(drawn.centers_px).astype(int).T
        colours = cv2.blur(drawn.pixels, (3, 3))[rows, columns].astype(float)
        usual = np.median(colours[~drawn.hidden], axis=0)
        apart = np.linalg.norm(colours - usual, axis=1)
        assert np.median(apart[drawn.hidden]) > np.median(apart[~drawn.hidden])
    assert found >= 3


def test_a_mark_points_away_from_the_centre() -> None:
    wedge = MARKS["wedge"](np.random.default_rng(0))  # wider outside, so most of it lies there
    places = np.arange(wedge.shape[1]) - (wedge.shape[1] - 1) / 2
    for outward_deg, axis, sign in ((0, 0, 1), (180, 0, -1), (90, 1, 1), (-90, 1, -1)):
        mass = pointed(wedge, outward_deg)[..., 3].sum(axis=axis)
        assert sign * (mass * places).sum() / mass.sum() > 2


@pytest.mark.parametrize("look", sorted({**DOTS, **MARKS}))
def test_every_look_stays_within_the_circle_that_can_be_turned(look: str) -> None:
    pixels = ({**DOTS, **MARKS})[look](np.random.default_rng(2))
    y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]] - 63.5
    alpha = pixels[..., 3]
    assert 0.05 < alpha.mean() < 0.9
    if look in MARKS:
        assert (np.hypot(x, y)[alpha > 0.5] < 65).all()


def test_the_standard_error_of_the_tilt_is_what_repeated_fits_would_show() -> None:
    layout = RingLayout(center=(3, -5), radius=30, step_deg=24, count=15)
    size, jitter = Size(640, 480), 0.05
    steep, flat = Camera(-45, 10), Camera(-8, 3)
    assert pose_sigma_deg(layout, steep, size, jitter_units=jitter) < 0.2
    assert pose_sigma_deg(layout, flat, size, jitter_units=jitter) > 0.2
    few = RingLayout(center=(3, -5), radius=30, step_deg=72, count=5)
    ratio = pose_sigma_deg(few, steep, size, jitter_units=jitter) / pose_sigma_deg(
        layout, steep, size, jitter_units=jitter
    )
    assert 1.4 < ratio < 2.2, "three times the objects, about the root of three the precision"


def test_a_canvas_without_room_is_an_error_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ring_plan, "_CAMERAS", 2)
    with pytest.raises(UsageError, match="48 x 36 pixels"):
        ring_scene(0, size=Size(48, 36))

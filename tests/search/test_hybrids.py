"""Hybrids, from the photo to the program: one scene of each kind, and no hybrid where there is one ring."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch
from drawn import DrawnRing
from ringed import found_on, found_ring, searches_around

from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.evaluation.scene import Scene, on_canvas
from p3i.evaluation.scenes import scene as drawn_scene
from p3i.grammar.ast import Affine, Polar
from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.camera import Camera
from p3i.interp.unroll import nest
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import numbers_of
from p3i.search.fit.rings import _drawn_once, evenly_sure
from p3i.search.forms.spelled import rings_filling
from p3i.search.judge.answered import _without_empty_middle
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import NEEDED
from p3i.search.synthesize import searched, synthesize

SCENES = {"concentric": 12, "fan": 9, "row": 14}
CONFIG = SearchConfig(structure="hybrid", focal_mm=35.0)


@lru_cache
def shown(kind: str, seed: int | None = None, *, of: int = 1) -> tuple[Scene, Answer]:
    """The scene of a kind, and the answer from one of its rings, by default the second."""
    scene = hybrid_scene(SCENES[kind] if seed is None else seed, kind=kind)
    with pytest.MonkeyPatch.context() as patch:
        searches_around(patch, found_on(scene, of=of))
        answers = list(searched(Session(Evidence(scene.image(), CONFIG, 35.0), CONFIG)).asked())
    assert answers, f"no hybrid in the scene of kind {kind}"
    return scene, max(answers, key=lambda answer: answer.worth)


@pytest.mark.parametrize("kind", SCENES)
def test_every_object_of_a_hybrid_is_drawn_and_none_besides(kind: str) -> None:
    scene, answer = shown(kind)
    drawn, _, seen = on_canvas(answer.program, scene.size)
    apart = np.linalg.norm(scene.centers_px[:, None] - drawn[seen], axis=2)
    between = np.linalg.norm(scene.centers_px[:, None] - scene.centers_px, axis=2)
    reach = 0.25 * np.median(np.sort(between, axis=1)[:, 1])
    assert answer.structure == "hybrid"
    assert seen.sum() == len(scene.centers_px)
    assert (apart.min(1) < reach).all()


@pytest.mark.parametrize("kind", SCENES)
def test_the_pose_of_a_hybrid_is_right_to_a_degree(kind: str) -> None:
    scene, answer = shown(kind)
    between = np.dot(Camera.of(answer.program).normal, scene.camera.normal)
    assert math.degrees(math.acos(min(1.0, between))) < 1


def test_a_fan_is_found_from_its_inner_ring_though_the_outer_draws_lie_far_apart() -> None:
    scene, answer = shown("fan", 13, of=0)
    drawn, _, seen = on_canvas(answer.program, scene.size)
    apart = np.linalg.norm(scene.centers_px[:, None] - drawn[seen], axis=2)
    assert seen.sum() == len(scene.centers_px) == 18
    assert apart.min(1).max() < 10


def test_rings_of_objects_that_stand_upright_are_found_along_their_line() -> None:
    """Nuts that do not turn as they go round: their ring is no less sure, and comes again."""
    found = synthesize(drawn_scene("hybrid", 5043).image(), SearchConfig())
    assert found.structure == "hybrid" and found.upright
    assert len(found.centers) == 33


def test_a_ring_with_two_objects_hidden_still_comes_again() -> None:
    found = synthesize(drawn_scene("hybrid", 5046).image(), SearchConfig())
    assert found.structure == "hybrid" and len(found.centers) == 33


def rings_with(*contrasts: list[float]) -> Fit:
    """A fit of a row of rings of five whose objects in sight agree so well."""
    filling = rings_filling(0, 3, 5, fan=False, grows=True, moves=False)
    index = [(i, j) for i, ring in enumerate(contrasts) for j in range(len(ring))]
    together = torch.tensor([one for ring in contrasts for one in ring])
    return Fit(filling, torch.zeros(0), 35.0, 1.0, torch.tensor(index).double(), together)


def test_a_ring_of_which_two_objects_are_in_sight_makes_no_hybrid() -> None:
    sure = [0.9] * 5
    assert evenly_sure(rings_with(sure, [0.9] * 3, sure))
    assert not evenly_sure(rings_with(sure, [0.9] * 2, sure))


def test_a_ring_that_has_two_objects_of_another_one_makes_no_hybrid() -> None:
    sure = [0.9] * 5
    assert not evenly_sure(rings_with(sure, [0.9, 0.9, 0.0, 0.0, 0.0]))
    assert evenly_sure(rings_with(sure, [0.9, 0.9, 0.9, 0.0, 0.0]))


@pytest.mark.parametrize(("step", "once"), [(24.0, False), (40.0, True), (48.0, True)])
def test_a_ring_laid_over_its_own_objects_makes_no_hybrid(step: float, once: bool) -> None:
    """Six on a circle of 24: a step of one radius takes two thirds of them onto others."""
    filling = rings_filling(0, 2, 6, fan=False, grows=False, moves=True)
    values = dict.fromkeys((unknown.name for unknown in filling.moving), 0.0)
    z = numbers_of(filling, values | {"draw.x.radius.1": 24.0, "draw.x.offset.i": step})
    index = filling.pattern.index.double()
    assert _drawn_once(Fit(filling, z, 35.0, 24.0, index, torch.ones(len(index)))) == once


def test_an_empty_ring_about_the_centre_is_left_out_and_one_with_objects_stays() -> None:
    scene = hybrid_scene(SCENES["concentric"], kind="concentric")
    session = Session(Evidence(scene.image(), SearchConfig(focal_mm=35.0), 35.0), SearchConfig(focal_mm=35.0))
    whole = Answer(replace(scene.program, header=None), "hybrid", 0.5, 0.5)
    assert _without_empty_middle(session, whole) == whole
    value = leaves(whole.program)
    assert value["for_i.start.1"] == 0
    # Rings of half the growth: one nearer to the centre, and one between each two.
    halved = {f"draw.{axis}.radius.i": value["draw.x.radius.i"] / 2 for axis in "xy"}
    program = with_leaves(whole.program, halved | {"for_i.start.1": -1.0, "for_i.stop.1": 2.0})
    found = _without_empty_middle(session, replace(whole, program=program))
    assert leaves(found.program)["for_i.start.1"] == 0


def test_a_fan_is_written_with_a_count_that_grows_with_i() -> None:
    _, answer = shown("fan")
    for_j = nest(answer.program).for_j
    assert for_j is not None and for_j.stop == Affine(i=6)


def test_a_row_of_rings_moves_its_centre_with_i_and_not_its_radius() -> None:
    _, answer = shown("row")
    x = nest(answer.program).draw.x
    assert isinstance(x, Polar) and x.radius.i == 0 and x.offset.i != 0


def test_a_single_ring_is_no_hybrid(monkeypatch: pytest.MonkeyPatch) -> None:
    ring = DrawnRing()
    values = {
        "camera.rx": ring.rx_deg,
        "camera.ry": ring.ry_deg,
        "draw.x.radius.1": ring.radius,
        "draw.x.angle.1": ring.first_deg,
        "draw.x.offset.1": ring.center[0],
        "draw.y.offset.1": ring.center[1],
    }
    known = found_ring(ring.evidence(), values, count=ring.count)
    assert known.sure > NEEDED
    searches_around(monkeypatch, known)
    assert searched(Session(ring.evidence(), CONFIG)).found == []


def test_the_sketch_of_a_fan_draws_four_eight_and_twelve_objects() -> None:
    index = rings_filling(1, 4, 4, fan=True, grows=True, moves=False).pattern.index[:, 0]
    assert [int((index == i).sum()) for i in (1, 2, 3)] == [4, 8, 12]

"""Sketches that a person wrote, on rendered scenes: the search sees nothing but the holes."""

import functools
import math

import numpy as np
import pytest
import torch

import p3i
from p3i.evaluation.program_scenes import program_scene, spacing_px
from p3i.evaluation.scene import Scene
from p3i.grammar.leaves import leaves
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best, Found
from p3i.search.forms.guess import Guess
from p3i.search.forms.sketches import by_hand, sketches
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.propose import holes
from p3i.search.result import StopReason, SynthesisResult

TRUTH = {
    "spiral": (
        "SetCameraPose(rx=-35, ry=14)\nfor j in range(0, 18):\n"
        "    Draw(x=(1.1*j + 11)*Cos(31*j + 20) + 3, y=(1.1*j + 11)*Sin(31*j + 20) - 2)\n"
    ),
    "staggered row": (
        "SetCameraPose(rx=-40, ry=-12)\nfor i in range(0, 2):\n    for j in range(0, 7):\n"
        "        Draw(x=5*i + 10.5*j - 34, y=11*i + 2*j - 10)\n"
    ),
    "arc": (
        "SetCameraPose(rx=-38, ry=10)\nfor j in range(0, 14):\n"
        "    Draw(x=31*Cos(17*j + 180) + 2, y=31*Sin(17*j + 180) + 3)\n"
    ),
}
SKETCHES = {
    "spiral": (
        "SetCameraPose(rx=??(-50, 50), ry=??(-50, 50))\nfor j in range(0, 18):\n"
        "    Draw(x=(?a(0.5, 2)*j + ?b(6, 18))*Cos(?c(20, 45)*j + ?p(0, 360)) + ??(-10, 10),"
        " y=(?a*j + ?b)*Sin(?c*j + ?p) + ??(-10, 10))\n"
    ),
    "staggered row": (
        "SetCameraPose(rx=??, ry=??)\nfor i in range(0, 2):\n    for j in range(0, ?n(4, 10)):\n"
        "        Draw(x=??(0, 10)*i + ??(6, 15)*j + ??(-40, -25), y=??(6, 16)*i + ??(-4, 4)*j + ??(-20, 0))\n"
    ),
    "arc": (
        "SetCameraPose(rx=??(-60, 60), ry=??(-60, 60))\nfor j in range(0, ?n(8, 18)):\n"
        "    Draw(x=?r(20, 45)*Cos(?s(10, 30)*j + ?p(150, 240)) + ??(-10, 10),"
        " y=?r*Sin(?s*j + ?p) + ??(-10, 10))\n"
    ),
}
STRUCTURES = {"spiral": "circular", "staggered row": "lattice", "arc": "circular"}


def sketch(text: str) -> Sketch:
    found = parse_sketch(text)
    assert isinstance(found, Sketch), found
    return found


@functools.cache
def scene(kind: str) -> Scene:
    return program_scene(p3i.loads(TRUTH[kind]), 1, look="letter" if kind == "arc" else "flower")


@functools.cache
def filled(kind: str) -> SynthesisResult:
    return p3i.synth(scene(kind).image(), sketch=sketch(SKETCHES[kind]), top=3)


def pose_error_deg(result: SynthesisResult, truth: Scene) -> float:
    assert result.program is not None, result.reason
    normals = Camera.of(result.program).normal, truth.camera.normal
    return math.degrees(math.acos(min(1.0, sum(a * b for a, b in zip(*normals, strict=True)))))


def center_errors(result: SynthesisResult, truth: Scene) -> np.ndarray:
    """How far each true object lies from the nearest found one, as a share of the spacing."""
    found = np.array(result.centers)[:, :2]
    apart = np.linalg.norm(found[:, None] - truth.centers_px[None], axis=2)
    return apart.min(axis=0) / spacing_px(truth)


@pytest.mark.parametrize("kind", TRUTH)
def test_a_sketch_with_holes_finds_camera_and_objects(kind: str) -> None:
    result, truth = filled(kind), scene(kind)
    assert pose_error_deg(result, truth) < 2.0
    assert len(result.centers) == len(truth.centers_px)
    assert center_errors(result, truth).max() < 0.06
    assert result.structure == STRUCTURES[kind]


@pytest.mark.parametrize("kind", TRUTH)
def test_bounds_hold_and_plain_numbers_stay(kind: str) -> None:
    for candidate in filled(kind).candidates:
        values, template = leaves(candidate.program), sketch(SKETCHES[kind])
        holes = {hole.path: hole for hole in template.holes}
        for path, value in leaves(template.template).items():
            hole = holes.get(path)
            if hole is None:
                assert values[path] == value
            elif hole.lower is not None and hole.upper is not None:
                assert hole.lower <= values[path] <= hole.upper
    names = {hole.name: hole.path for hole in sketch(SKETCHES[kind]).holes if hole.name}
    values = leaves(filled(kind).candidates[0].program)
    for hole in sketch(SKETCHES[kind]).holes:
        if hole.name is not None:
            assert values[hole.path] == values[names[hole.name]]


def test_the_same_sketch_and_seed_give_the_same_text() -> None:
    again = p3i.synth(scene("staggered row").image(), sketch=sketch(SKETCHES["staggered row"]))
    first = filled("staggered row").program
    assert again.program is not None and first is not None
    assert p3i.dumps(again.program) == p3i.dumps(first)


def test_a_whole_program_is_refined_from_its_own_numbers() -> None:
    near = p3i.loads(TRUTH["staggered row"].replace("rx=-40", "rx=-44").replace("10.5*j - 34", "10.7*j - 35"))
    result = p3i.synth(scene("staggered row").image(), start=near)
    assert pose_error_deg(result, scene("staggered row")) < 2.0
    assert center_errors(result, scene("staggered row")).max() < 0.1
    assert result.program is not None
    bounds = {path: value for path, value in leaves(result.program).items() if path.startswith("for_")}
    assert bounds == {path: value for path, value in leaves(near).items() if path.startswith("for_")}


def test_a_start_within_a_sketch_and_a_count_tied_to_an_angle() -> None:
    ring = p3i.loads(
        "SetCameraPose(rx=-40, ry=5)\nfor j in range(0, 12):\n"
        "    Draw(x=25*Cos(30*j + 10) + 1, y=25*Sin(30*j + 10) + 2)\n"
    )
    truth = program_scene(ring, 3, look="window")
    holes = sketch(
        "SetCameraPose(rx=~-36, ry=~3)\nfor j in range(0, ?n(10, 14)):\n"
        "    Draw(x=?r(20, 30)*Cos(360/?n*j + ?p(0, 36)) + ~0, y=?r*Sin(360/?n*j + ?p) + ~0)\n"
    )
    result = p3i.synth(truth.image(), sketch=holes)
    assert pose_error_deg(result, truth) < 1.5
    assert result.program is not None
    assert leaves(result.program)["for_j.stop.1"] == 12
    assert leaves(result.program)["draw.x.angle.j"] == 30


def test_a_sketch_that_cannot_fit_says_what_was_needed() -> None:
    holes = sketch(
        "SetCameraPose(rx=??(-5, 5), ry=??(-5, 5))\nfor j in range(0, 9):\n"
        "    Draw(x=??(9, 11)*j + ??(-45, -40), y=??(-1, 1)*j + ??(25, 30))\n"
    )
    result = p3i.synth(scene("spiral").image(), sketch=holes)
    assert result.program is None
    assert result.stop is StopReason.NO_FIT
    assert "does not fit this photo (best 0.0" in result.reason and "needs" in result.reason


def test_the_trace_of_a_sketch_has_the_words_of_every_trace() -> None:
    steps: list[str] = []
    holes = sketch(TRUTH["staggered row"].replace("rx=-40", "rx=~-41"))
    p3i.synth(scene("staggered row").image(), sketch=holes, trace=lambda step: steps.append(step["step"]))
    assert steps.index("sketch") < steps.index("proposal") < steps.index("fit") < steps.index("answer")


@pytest.mark.parametrize(("off", "looked"), [(0.05, False), (0.6, True)])
def test_a_start_that_the_sketch_cannot_say_is_no_reason_to_look_no_further(
    monkeypatch: pytest.MonkeyPatch, off: float, looked: bool
) -> None:
    """A ring is near a spiral, and explains enough of it to seem sure."""
    own = by_hand("the sketch", sketch(SKETCHES["spiral"]))
    near = Answer(p3i.loads(TRUTH["arc"]), "circular", 0.6, 0.6)
    best = Best([Found(sketches(SearchConfig(structure="circular"))[0], None, (near,))])  # pyright: ignore
    monkeypatch.setattr(holes, "_from_grid", lambda *_, **__: [])
    monkeypatch.setattr(holes.PointMaps, "of", lambda _: None)
    monkeypatch.setattr(holes, "written_in", lambda every, _: Guess(every[0], torch.zeros(0), -off))
    image = scene("spiral").image()
    rounds = holes.hole_guesses(Session(Evidence(image, SearchConfig(), 35.0), SearchConfig()), own, best)
    assert len(next(rounds)) == 1
    best.found.append(Found(own, None, (near,)))  # pyright: ignore[reportArgumentType]
    assert (next(rounds, None) is not None) == looked


def test_a_sketch_of_which_only_a_range_is_open_keeps_its_numbers() -> None:
    """With no number to move it ended in a tensor of the wrong kind."""
    text = TRUTH["staggered row"].replace("range(0, 7)", "range(0, ?n(4, 10))")
    result = p3i.synth(scene("staggered row").image(), sketch=sketch(text))
    assert result.program is not None, result.reason
    assert leaves(result.program) == leaves(p3i.loads(TRUTH["staggered row"]))
    assert len(result.centers) == 14

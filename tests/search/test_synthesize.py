"""From a photo to its program, on scenes of known truth, and the honest answer where there is none."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from drawn import DrawnRing
from found import finds
from truth import PATTERN, SMALL, evidence_of, lattice_error, lattice_of, pose_error_deg, small_scene

from p3i.evaluation.scenes import Scene
from p3i.grammar.ast import Program
from p3i.grammar.departures import departures
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera
from p3i.search import synthesize as synthesize_module
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.grow import measure
from p3i.search.forms.guess import lattice_guess
from p3i.search.judge import accept
from p3i.search.outcome import focal_of
from p3i.search.result import NEEDED, NEEDED_BITS, StopReason, SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image

SEEDS = (3, 7, 10, 14, 15, 18)
QUICK = 14
"""The scene on which options are tried."""
MANY_TRIES = 13
"""A scene of which more than one proposal is refined."""


@cache
def answer(scene: int, **options: Any) -> SynthesisResult:
    return synthesize(small_scene(scene).image(), SearchConfig(**options))


def text_of(result: SynthesisResult) -> str:
    assert result.program is not None, result.reason
    return format_program(result.program)


def steps_away(scene: Scene, result: SynthesisResult) -> np.ndarray:
    """How far from each true object the answer's nearest lies, in spacings of the true objects there."""
    found = np.array([(x, y) for x, y, _, _ in result.centers])
    away = np.linalg.norm(scene.centers_px[:, None] - found[None], axis=2).min(1)
    apart = np.linalg.norm(scene.centers_px[:, None] - scene.centers_px[None], axis=2)
    return away / np.where(apart > 0, apart, np.inf).min(1)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_program_of_a_scene_is_found(seed: int) -> None:
    scene, result = small_scene(seed), answer(seed)
    assert result.stop is StopReason.FOUND and result.reason == ""
    assert result.program is not None and result.agreement is not None
    assert NEEDED <= result.agreement <= 1
    assert pose_error_deg(result.program, scene.program) < 1
    found, truth = lattice_of(result.program), lattice_of(scene.program)
    assert lattice_error(found.basis, truth.basis) < 0.1
    away = steps_away(scene, result)
    assert np.median(away) < 0.1
    assert (away < 0.25).mean() > 0.9, "objects of the scene are missing"
    assert len(result.centers) < 1.15 * len(scene.index), "objects where the scene has none"


def test_the_centres_are_those_that_the_program_draws_in_the_photo() -> None:
    result = answer(QUICK)
    assert result.program is not None
    lattice = lattice_of(result.program)
    matrix = Camera.of(result.program).image_from_plane(SMALL).numpy()
    for x, y, i, j in result.centers:
        at = matrix @ [*(lattice.origin + np.array([i, j]) @ lattice.basis), 1.0]
        np.testing.assert_allclose([x, y], at[:2] / at[2], atol=1e-6)
        assert -0.5 <= x <= SMALL.width - 0.5 and -0.5 <= y <= SMALL.height - 0.5


def test_the_same_photo_and_options_give_the_same_text_twice() -> None:
    again = synthesize(small_scene(QUICK).image(), SearchConfig())
    assert text_of(again) == text_of(answer(QUICK))
    assert again == answer(QUICK)


def test_another_seed_finds_the_same_lattice() -> None:
    other, first = answer(QUICK, seed=5), answer(QUICK)
    assert other.seed == 5
    assert other.program is not None and first.program is not None
    assert lattice_error(lattice_of(other.program).basis, lattice_of(first.program).basis) < 0.05
    assert pose_error_deg(other.program, first.program) < 0.5


def noise() -> np.ndarray:
    return np.random.default_rng(0).uniform(size=(240, 320, 3)).astype(np.float32)


def gradient() -> np.ndarray:
    y, x = np.mgrid[0:240, 0:320] / 320
    return np.stack([0.3 + 0.5 * y, 0.7 - 0.4 * x, 0.2 + 0.3 * (x + y)], -1).astype(np.float32)


def photo(pixels: np.ndarray, valid: np.ndarray | None = None) -> Image:
    return Image(pixels, np.ones(pixels.shape[:2], bool) if valid is None else valid)


@pytest.mark.parametrize("pixels", [noise(), gradient()], ids=["noise", "gradient"])
def test_what_has_no_pattern_is_refused_with_its_evidence(pixels: np.ndarray) -> None:
    result = synthesize(photo(pixels), SearchConfig())
    assert (result.program, result.stop) == (None, StopReason.NO_PATTERN)
    assert result.centers == () and result.candidates == ()
    assert result.agreement is not None and result.agreement < NEEDED and result.needed is None
    assert result.score is None and result.margin_bits is None
    assert result.bits is None or result.bits < NEEDED_BITS
    told = "" if result.bits is None else f" (the best found is worth {result.bits:.0f} bits, an answer 4.3)"
    assert result.reason == f"no regular pattern{told}"


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (photo(np.full((240, 320, 3), 0.4, np.float32)), StopReason.FLAT),
        (photo(np.zeros((1, 1, 3), np.float32)), StopReason.TOO_SMALL),
        (photo(noise()[:31]), StopReason.TOO_SMALL),
        (photo(noise(), np.zeros((240, 320), bool)), StopReason.TOO_LITTLE_KNOWN),
        (photo(noise(), np.arange(240 * 320).reshape(240, 320) < 5000), StopReason.TOO_LITTLE_KNOWN),
    ],
    ids=["flat", "pixel", "strip", "unknown", "nearly unknown"],
)
def test_a_hopeless_picture_is_not_searched(image: Image, reason: StopReason) -> None:
    result = synthesize(image, SearchConfig(), trace=lambda step: pytest.fail(f"searched: {step}"))
    assert (result.program, result.stop) == (None, reason)
    assert result.reason == reason.value != ""


def test_when_the_time_is_up_the_answer_says_so() -> None:
    result = answer(QUICK, time_s=1e-6)
    assert result.stop is StopReason.TIME_UP
    assert "time" in result.reason


class Interrupt:
    """Progress that interrupts the search when it does `doing` for the `turn`-th time."""

    def __init__(self, doing: str, *, turn: int = 1) -> None:
        self.doing, self.left = doing, turn

    def __call__(self, doing: str, share: float) -> None:
        assert 0 <= share <= 1
        self.left -= doing == self.doing
        if self.left == 0:
            self.left = -1
            raise KeyboardInterrupt


def test_an_interrupt_before_anything_was_found_ends_without_a_program() -> None:
    result = synthesize(small_scene(QUICK).image(), SearchConfig(), progress=Interrupt("straightening"))
    assert (result.program, result.stop) == (None, StopReason.INTERRUPTED)


def test_an_interrupt_gives_the_best_so_far() -> None:
    scene = small_scene(MANY_TRIES)
    result = synthesize(scene.image(), SearchConfig(), progress=Interrupt("refining", turn=2))
    assert result.stop is StopReason.INTERRUPTED
    assert result.program is not None and result.agreement is not None and result.agreement >= NEEDED
    assert pose_error_deg(result.program, scene.program) < 1


def test_an_interrupt_while_a_runner_up_is_worked_out_keeps_the_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = small_scene(QUICK)
    theta = lattice_of(scene.program).moved_to(np.median(scene.index, axis=0).round()).theta(PATTERN)
    fit = measure(evidence_of(scene).level_for(40.0), PATTERN, theta)
    guess = lattice_guess(lattice_of(scene.program), 1.0, local=False)
    monkeypatch.setattr(synthesize_module, "_fitted", lambda *_, **__: [(guess, fit), (guess, fit)])
    monkeypatch.setattr(synthesize_module, "same_lattice", lambda *_: False)
    stop = Interrupt("reading off the objects", turn=2)
    result = synthesize(scene.image(), SearchConfig(top=2), progress=stop)
    assert stop.left < 0, "the search should come that far"
    assert result.stop is StopReason.INTERRUPTED
    assert result.program is not None and pose_error_deg(result.program, scene.program) < 1


def answered_by(monkeypatch: pytest.MonkeyPatch, program: str, *, structure: str = "circular") -> None:
    """Let the search find this program, with a score beyond doubt."""
    found = parse(program)
    assert isinstance(found, Program)
    answer = Answer(found, structure, 0.9, 0.9)  # pyright: ignore[reportArgumentType]
    finds(monkeypatch, answer)


def test_a_program_that_costs_more_than_it_explains_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    answered_by(monkeypatch, "for j in range(0, 9):\n    Draw(x=9*Cos(40*j), y=9*Sin(40*j))\n")
    monkeypatch.setattr(accept, "score_of_program", lambda *_, **__: 0.9)
    result = synthesize(photo(noise()), SearchConfig())
    assert (result.program, result.stop) == (None, StopReason.NO_PATTERN)
    assert "bits" in result.reason


def test_a_ring_that_the_extent_of_the_image_cannot_continue_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    ring = DrawnRing(count=6, slots=6, center=(0, 0), size=12)
    x, y = "24*Cos(60*j + 20)", "24*Sin(60*j + 20)"
    answered_by(monkeypatch, f"SetCameraPose(rx=-32, ry=14)\nfor j in range(0, 6):\n    Draw(x={x}, y={y})\n")
    told = [
        any("continues lattices only" in note for note in synthesize(ring.image(), config).notes)
        for config in (SearchConfig(extent="image"), SearchConfig())
    ]
    assert told == [True, False]


@pytest.mark.parametrize(("radius", "told"), [(5, True), (24, False)])
def test_a_ring_that_leaves_its_tilt_open_says_so(
    monkeypatch: pytest.MonkeyPatch, radius: float, told: bool
) -> None:
    ring = DrawnRing(count=6, slots=6, center=(0, 0), radius=radius, size=0.6 * radius, rx_deg=-30, ry_deg=0)
    x, y = f"{radius}*Cos(60*j + 20)", f"{radius}*Sin(60*j + 20)"
    answered_by(monkeypatch, f"SetCameraPose(rx=-30, ry=0)\nfor j in range(0, 6):\n    Draw(x={x}, y={y})\n")
    result = synthesize(ring.image(), SearchConfig())
    assert result.program is not None
    assert (result.mirrored is not None) == told
    assert any("mirrored" in note for note in result.notes) == told


@pytest.mark.parametrize(("center", "shown"), [((0.0, 0.0), True), ((-46.0, -36.0), False)])
def test_a_ring_most_of_which_lies_outside_the_picture_is_no_answer(
    monkeypatch: pytest.MonkeyPatch, center: tuple[float, float], shown: bool
) -> None:
    """A corner of the picture holds 4 of its 12 objects, which agree as well as ever."""
    ring = DrawnRing(center=center, rx_deg=0, ry_deg=0)
    (x, y), angle = center, "30*j + 20"
    answered_by(
        monkeypatch, f"for j in range(0, 12):\n    Draw(x=24*Cos({angle}) + {x}, y=24*Sin({angle}) + {y})\n"
    )
    monkeypatch.setattr("p3i.search.judge.accept.score_of_program", lambda *_, **__: 0.9)
    result = synthesize(ring.image(), SearchConfig())
    assert (result.program is not None) == shown
    assert result.stop is (StopReason.FOUND if shown else StopReason.OUT_OF_SIGHT)


@pytest.mark.parametrize(("radius", "rx", "open_tilt"), [(6, 0, True), (24, -30, False)])
def test_an_answer_says_how_well_its_tilt_is_known(
    monkeypatch: pytest.MonkeyPatch, radius: float, rx: float, open_tilt: bool
) -> None:
    count = 6 if open_tilt else 12
    nudges = {number: (0.1 * (-1) ** number, 0.05 * (number % 3)) for number in range(count)}
    ring = DrawnRing(count, count, center=(0, 0), radius=radius, size=3, rx_deg=rx, ry_deg=0, nudges=nudges)
    angle = f"{360 // count}*j + 20"
    x, y = f"{radius}*Cos({angle})", f"{radius}*Sin({angle})"
    text = f"SetCameraPose(rx={rx}, ry=0)\nfor j in range(0, {count}):\n    Draw(x={x}, y={y})\n"
    answered_by(monkeypatch, text)
    result = synthesize(ring.image(), SearchConfig())
    assert result.program is not None and result.pose_sigma_deg is not None
    assert (result.pose_sigma_deg > 3) == open_tilt
    assert sum("degrees only" in note for note in result.notes) == open_tilt


def test_progress_tells_what_is_done_and_never_goes_back() -> None:
    told: list[tuple[str, float]] = []
    steps: list[Mapping[str, Any]] = []
    scene = small_scene(QUICK)
    result = synthesize(
        scene.image(), SearchConfig(top=3), progress=lambda *said: told.append(said), trace=steps.append
    )
    shares = [share for _, share in told]
    assert shares == sorted(shares) and told[-1] == ("done", 1.0)
    assert all(doing for doing, _ in told)
    # The trace: plain numbers and lists, a step of each kind.
    assert json.loads(json.dumps(steps)) == steps
    assert {step["step"] for step in steps} >= {"proposal", "fit", "answer"}
    assert max(step["score"] for step in steps if step["step"] == "answer") == pytest.approx(result.agreement)
    # The candidates: distinct programs, the first of them the answer.
    texts = [format_program(candidate.program) for candidate in result.candidates]
    assert 1 <= len(texts) <= 3 and len(set(texts)) == len(texts)
    assert result.candidates[0].program == result.program and result.candidates[0].score == result.score
    assert all(NEEDED <= (candidate.agreement or 0) <= 1 for candidate in result.candidates)
    assert text_of(result) == text_of(answer(QUICK)), "asking for more candidates changes no answer"


def test_what_a_mask_hides_is_no_evidence() -> None:
    scene = small_scene(10)
    image, outline = scene.image(), cv2.convexHull(scene.centers_px.astype(np.float32))
    hidden = np.zeros(image.valid.shape, np.uint8)
    cv2.fillConvexPoly(hidden, outline.round().astype(np.int32), 1)
    hidden = cv2.dilate(hidden, np.ones((61, 61), np.uint8)).astype(bool)
    assert (~hidden).mean() > 0.4, "the scene should be one that leaves some ground to see"
    assert answer(10).program is not None
    result = synthesize(Image(image.pixels, ~hidden), SearchConfig())
    assert (result.program, result.stop) == (None, StopReason.NO_PATTERN)


def test_a_mask_over_a_part_leaves_the_rest_of_the_pattern() -> None:
    scene = small_scene(QUICK)
    image, valid = scene.image(), np.ones((SMALL.height, SMALL.width), bool)
    pixels = image.pixels.copy()
    valid[110:220, 150:300] = False
    pixels[~valid] = np.random.default_rng(3).uniform(size=(int((~valid).sum()), 3))
    result = synthesize(Image(pixels, valid), SearchConfig())
    assert result.program is not None
    assert pose_error_deg(result.program, scene.program) < 1
    assert (steps_away(scene, result) < 0.25).mean() > 0.85


def test_another_focal_is_another_pose_and_the_same_objects() -> None:
    scene, other = small_scene(QUICK), answer(QUICK, focal_mm=60.0)
    assert (other.focal_mm, other.focal_source) == (60.0, "option")
    assert (answer(QUICK).focal_mm, answer(QUICK).focal_source) == (35.0, "default")
    assert other.program is not None
    assert pose_error_deg(other.program, scene.program) > 3
    found = np.array([(x, y) for x, y, _, _ in other.centers])
    first = np.array([(x, y) for x, y, _, _ in answer(QUICK).centers])
    nearest = np.linalg.norm(first[:, None] - found[None], axis=2).min(1)
    assert np.median(nearest) < 2


def test_the_focal_is_that_of_the_option_then_of_the_photo() -> None:
    image = small_scene(QUICK).image()
    exif = replace(image, focal_mm=28.0)
    assert focal_of(image, SearchConfig()) == (35.0, "default")
    assert focal_of(exif, SearchConfig()) == (28.0, "exif")
    assert focal_of(exif, SearchConfig(focal_mm=50.0)) == (50.0, "option")


def test_extent_image_fills_the_picture_with_the_same_lattice() -> None:
    found, filled = answer(QUICK), answer(QUICK, extent="image")
    assert found.program is not None and filled.program is not None
    assert np.array_equal(lattice_of(filled.program).basis, lattice_of(found.program).basis)
    assert filled.program.camera == found.program.camera
    assert len(filled.centers) >= len(found.centers)
    at = np.array([(x, y) for x, y, _, _ in filled.centers])
    assert at[:, 0].min() < 0.2 * SMALL.width and at[:, 0].max() > 0.8 * SMALL.width
    assert at[:, 1].min() < 0.2 * SMALL.height and at[:, 1].max() > 0.8 * SMALL.height


def test_a_strict_answer_is_a_string_of_table_1_and_says_how_far_it_is_off() -> None:
    strict, free = answer(QUICK, strict=True), answer(QUICK)
    assert strict.program is not None and free.program is not None
    assert departures(strict.program) == ()
    assert parse(format_program(strict.program, layout="table1"), strict=True) == strict.program
    assert strict.program.camera == free.program.camera
    assert len(strict.notes) == 1 and "pixels from the free fit" in strict.notes[0]
    # It goes through the middle of the picture, and has as many objects (but for those that left the frame).
    assert np.array_equal(lattice_of(strict.program).origin, np.zeros(2))
    middle = np.array(SMALL.middle)
    assert min(np.linalg.norm(np.array([x, y]) - middle) for x, y, _, _ in strict.centers) < 1e-6
    assert abs(len(strict.centers) - len(free.centers)) <= 0.35 * len(free.centers)


def test_a_chequered_floor_is_answered_with_squares_of_one_colour() -> None:
    size = Size(400, 300)
    camera = Camera(-40.0, 8.0)
    x, y = np.meshgrid(np.arange(2 * size.width), np.arange(2 * size.height))
    photo_px = np.stack([(x.ravel() + 0.5) / 2 - 0.5, (y.ravel() + 0.5) / 2 - 0.5, np.ones(x.size)])
    plane = np.linalg.inv(camera.image_from_plane(size).numpy()) @ photo_px
    dark = np.floor(plane[:2] / plane[2] / 7.0).sum(0) % 2 == 0
    grey = cv2.resize(
        np.where(dark, 0.25, 0.75).reshape(x.shape).astype(np.float32),
        (400, 300),
        interpolation=cv2.INTER_AREA,
    )
    noisy = grey[:, :, None] + np.random.default_rng(0).normal(0, 0.01, (300, 400, 3))
    result = synthesize(photo(noisy.clip(0, 1).astype(np.float32)), SearchConfig())
    assert result.program is not None
    found = lattice_of(result.program)
    assert pose_error_deg(found, replace(found, rx_deg=camera.rx_deg, ry_deg=camera.ry_deg)) < 1
    assert lattice_error(found.basis, np.array([[7.0, 7.0], [7.0, -7.0]])) < 0.05

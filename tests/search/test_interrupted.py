"""An interrupt, or the end of the time, after something was found: the best so far comes back."""

import importlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from drawn import DrawnRing
from ringed import found_on, guess_of, proposes, searches_around
from truth import pose_error_deg, small_scene

import p3i
from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.evaluation.program_scenes import program_scene
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search import synthesize as synthesize_module
from p3i.search.config import SearchConfig
from p3i.search.fit.fitted import Drawn
from p3i.search.forms.sketches import by_hand
from p3i.search.look.session import Session
from p3i.search.optics import lens as lens_module
from p3i.search.propose import climb, holes, paper, proposers
from p3i.search.result import StopReason, SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image

RING = DrawnRing()
ROWS = (
    "SetCameraPose(rx={rx}, ry=-12)\nfor i in range(0, 2):\n    for j in range(0, 7):\n"
    "        Draw(x=5*i + {step}*j - 34, y=11*i + 2*j - 10)\n"
)


@cache
def row_image() -> Image:
    return program_scene(p3i.loads(ROWS.format(rx=-40, step=10.5)), 1, look="flower").image()


def row_sketch() -> Sketch:
    made = parse_sketch(ROWS.format(rx="??(-50, -30)", step="??(9, 12)"))
    assert isinstance(made, Sketch)
    return made


@cache
def ring_of_fan() -> tuple[Image, Drawn]:
    scene = hybrid_scene(9, kind="fan")
    return scene.image(), found_on(scene, of=1)


Search = Callable[[pytest.MonkeyPatch], Callable[..., SynthesisResult]]
"""Prepares a short search of one structure, to be called with `progress` and `trace`."""


def lattice(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    return lambda **told: synthesize(small_scene(14).image(), SearchConfig(), **told)


def ring(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    """Two guesses close to the ring."""
    x, y = RING.center
    near = [replace(RING, rx_deg=RING.rx_deg + off, center=(x + off / 3, y + off / 3)) for off in (1.0, -1.0)]
    proposes(patch, *map(guess_of, near))
    config = SearchConfig(structure="circular", focal_mm=35.0)
    return lambda **told: synthesize(RING.image(), config, **told)


def hybrid(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    image, known = ring_of_fan()
    searches_around(patch, known)
    config = SearchConfig(structure="hybrid", focal_mm=35.0)
    return lambda **told: synthesize(image, config, **told)


def filled(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    """A small grid of which two points are fitted, be they alike, and nothing to begin with."""
    patch.setattr(climb, "distinct", lambda _, found: found)
    patch.setattr(holes, "distinct", lambda _, found: found)
    patch.setattr(synthesize_module, "sketches", lambda config: [by_hand("the sketch", config.sketch)])
    patch.setattr(holes, "BY_HAND", holes.Effort(1500, 500, 2, 1))
    return lambda **told: synthesize(row_image(), SearchConfig(sketch=row_sketch()), **told)


def started(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    near = p3i.loads(ROWS.format(rx=-41, step=10.5))
    return lambda **told: synthesize(row_image(), SearchConfig(start=near), **told)


def papers(patch: pytest.MonkeyPatch) -> Callable[..., SynthesisResult]:
    patch.setattr(paper, "LOOKED_AT", 600)
    patch.setattr(paper, "DESCENTS", 4)
    image = small_scene(14).image()
    return lambda **told: synthesize(image, SearchConfig(recipe="paper"), **told)


SEARCHES: dict[str, Search] = {
    "lattice": lattice, "ring": ring, "hybrid": hybrid, "sketch": filled, "start": started, "paper": papers,
}  # fmt: skip


class Once:
    """Raises an interrupt in the `turn`-th call, and never again; other calls go on to `inner`."""

    def __init__(self, turn: int, inner: Callable[..., Any] = lambda *_, **__: None) -> None:
        self.left, self.inner = turn, inner

    def __call__(self, *args: Any, **options: Any) -> Any:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return self.inner(*args, **options)


class Said(Once):
    """Progress or trace that interrupts when it is told `what` for the `turn`-th time."""

    def __init__(self, what: str, turn: int) -> None:
        super().__init__(turn)
        self.what = what

    def __call__(self, *args: Any, **options: Any) -> Any:
        told = args[0] if isinstance(args[0], str) else args[0]["step"]
        return super().__call__() if told == self.what else None


IN_A_CALL = [
    ("lattice", "synthesize.with_others", 1),
    ("ring", "synthesize.fit_places", 2),
    ("ring", "fit.fitting.as_far_as_it_goes", 1),
    ("ring", "extent.ring.places", 1),
    ("hybrid", "synthesize.fit_places", 2),
    ("hybrid", "extent.further_rings._one_more", 1),
    ("hybrid", "fit.fitting.measured", 2),
    ("hybrid", "judge.answered.explained_bits", 1),
    ("sketch", "propose.climb.score_points", 3),
    ("sketch", "propose.climb.distinct_share", 6),
    ("sketch", "propose.climb._descended", 1),
    ("sketch", "propose.holes.distinct", 1),
    ("sketch", "extent.setting._on_objects", 1),
    ("sketch", "extent.setting._centred", 2),
    ("start", "extent.setting._best_extent", 1),
    ("paper", "propose.paper.equation2", 3),
    ("paper", "judge.answered.score_of_program", 2),
    ("ring", "judge.answered.explained", 1),
    ("ring", "outcome.distinct_answers", 1),
]


@pytest.mark.parametrize(("kind", "name", "turn"), IN_A_CALL, ids=lambda value: str(value))
def test_an_interrupt_within_a_step_keeps_the_best_so_far(
    monkeypatch: pytest.MonkeyPatch, kind: str, name: str, turn: int
) -> None:
    search = SEARCHES[kind](monkeypatch)
    file, _, function = name.rpartition(".")
    module = importlib.import_module(f"p3i.search.{file}")
    stop = Once(turn, getattr(module, function))
    monkeypatch.setattr(module, function, stop)
    result = search()
    assert stop.left <= 0, "the search should come that far"
    assert result.program is not None
    assert result.stop is StopReason.INTERRUPTED


TOLD = [
    ("lattice", "trace", "candidate", 1),
    ("ring", "trace", "fit", 1),
    ("hybrid", "trace", "candidate", 1),
    ("sketch", "progress", "refining", 2),
    ("sketch", "trace", "proposal", 1),
    ("sketch", "trace", "fit", 1),
    ("paper", "progress", "the paper's grid", 2),
    ("paper", "progress", "the paper's descent", 3),
    ("paper", "trace", "candidate", 1),
    ("ring", "progress", "done", 1),
    ("ring", "trace", "answer", 1),
]


@pytest.mark.parametrize(("kind", "listener", "what", "turn"), TOLD)
def test_an_interrupt_by_who_listens_keeps_the_best_so_far(
    monkeypatch: pytest.MonkeyPatch, kind: str, listener: str, what: str, turn: int
) -> None:
    search, stop = SEARCHES[kind](monkeypatch), Said(what, turn)
    result = search(**{listener: stop})
    assert stop.left <= 0, "the search should come that far"
    assert result.program is not None
    assert result.stop is StopReason.INTERRUPTED


def test_a_second_interrupt_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def raising(*_: object) -> None:
        raise KeyboardInterrupt

    search = ring(monkeypatch)
    monkeypatch.setattr("p3i.search.fit.fitting.as_far_as_it_goes", raising)
    with pytest.raises(KeyboardInterrupt):
        search()


@pytest.mark.parametrize("kind", SEARCHES)
def test_when_the_time_is_up_the_best_so_far_is_the_answer(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """The clock is asked again and again; it says no from the second time on, or in the middle."""
    search = SEARCHES[kind](monkeypatch)
    asked_for = 0
    limit = 10**9

    def go_on(self: Session) -> bool:
        nonlocal asked_for
        asked_for += 1
        if asked_for > limit and self.stopped is None:
            self.stopped = StopReason.TIME_UP
        return self.stopped is None

    monkeypatch.setattr(Session, "go_on", go_on)
    assert search().stop is StopReason.FOUND
    whole = asked_for
    for limit in sorted({1, whole // 2} - {0, whole}):
        asked_for = 0
        result = search()
        assert result.stop is StopReason.TIME_UP
        assert result.program is not None, f"nothing after {limit} of {whole}"


def test_an_interrupt_while_the_lens_is_estimated_keeps_what_the_photo_showed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(lens_module, "lens_told", Once(1))
    scene = small_scene(14)
    result = synthesize(scene.image(), SearchConfig(lens="auto"))
    assert result.stop is StopReason.INTERRUPTED
    assert result.program is not None and pose_error_deg(result.program, scene.program) < 1


def test_once_interrupted_no_further_kind_of_pattern_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    image = DrawnRing(canvas=Size(224, 168)).image()
    monkeypatch.setattr(proposers, "ring_rounds", lambda *_: pytest.fail("searched on"))
    result = synthesize(image, SearchConfig(), progress=Said("straightening", 1))
    assert (result.program, result.stop) == (None, StopReason.INTERRUPTED)

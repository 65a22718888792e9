"""Rings, from the photo to the program: found where there is one, whole or open, and nothing in blotches."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import DrawnRing, noise_image, tilt_error_deg
from truth import small_scene

from p3i.cli.main import run
from p3i.evaluation.scenes import scene
from p3i.grammar.ast import Polar
from p3i.grammar.parser import parse
from p3i.interp.unroll import nest, points
from p3i.search import synthesize as synthesize_module
from p3i.search.config import SearchConfig
from p3i.search.fit.arc import as_far_as_it_goes
from p3i.search.fit.places import measured
from p3i.search.forms.guess import Guess
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.propose import proposers
from p3i.search.result import NEEDED, StopReason
from p3i.search.synthesize import searched, synthesize

RING = DrawnRing()
WORDS = ["--structure", "circular", "--focal", "35", "--format", "jsonl"]


def session_on(ring: DrawnRing) -> Session:
    return Session(ring.evidence(), SearchConfig(focal_mm=35.0))


def test_auto_answers_a_ring_with_its_ring() -> None:
    result = synthesize(RING.image(), SearchConfig(focal_mm=35.0))
    assert result.stop is StopReason.FOUND and result.structure == "circular"
    assert result.program is not None and result.agreement is not None and result.agreement >= NEEDED
    assert len(points(result.program)) == RING.count
    assert tilt_error_deg(result.program, RING.rx_deg, RING.ry_deg) < 1
    found = np.array([(x, y) for x, y, _, _ in result.centers])
    away = np.linalg.norm(RING.seen(RING.places())[:, None] - found, axis=2).min(1)
    assert away.max() < 0.5 * RING.size * RING.canvas.unit_px


def test_auto_answers_a_lattice_scene_with_its_lattice() -> None:
    assert synthesize(small_scene(14).image(), SearchConfig()).structure == "lattice"


def test_the_command_finds_the_ring_of_a_scene_where_rings_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn = scene("circular", 0)
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("ring.png", drawn.pixels[..., ::-1])
    assert run(["synth", "ring.png", *WORDS]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["structure"] == "circular"
    found = parse(told["program"])
    assert len(points(found)) == len(points(drawn.program))
    assert tilt_error_deg(found, drawn.camera.rx_deg, drawn.camera.ry_deg) < 1


def test_blotches_have_no_ring_that_would_be_an_answer() -> None:
    config = SearchConfig(structure="circular")
    best = searched(Session(Evidence(noise_image(), config, 35.0), config))
    assert best.found and all(answer.score < NEEDED for answer in best.asked())


def test_a_search_whose_time_is_up_fits_one_ring_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Guess] = []
    session = Session(RING.evidence(), SearchConfig(structure="circular"))
    session.stopped = StopReason.TIME_UP
    numbers = RING.numbers(RING.filling())
    guesses = [Guess(RING.filling(), numbers, 1.0, focal_mm=35.0)] * 3
    monkeypatch.setattr(proposers, "ring_rounds", lambda *_: iter([guesses]))
    monkeypatch.setattr(synthesize_module, "fit_places", lambda _, guess: tried.append(guess))
    searched(session)
    assert len(tried) == 1


@pytest.mark.parametrize(("drawn", "slots"), [(9, 14), (8, 12)])
def test_an_open_ring_is_drawn_as_far_as_it_goes(drawn: int, slots: int) -> None:
    """From the fit of a whole ring, a third of which is not there."""
    ring = DrawnRing(count=drawn, slots=slots)
    session, filling = session_on(ring), ring_filling(slots)
    whole = measured(session.evidence, filling, ring.numbers(filling), focal_mm=35.0)
    assert whole is not None
    arc = as_far_as_it_goes(session, whole)
    draw = nest(arc.program()).draw
    assert len(arc.filling.pattern.index) == drawn
    assert isinstance(draw.x, Polar)
    assert draw.x.angle.j == pytest.approx(360 / slots, rel=0.01)
    assert draw.x.angle.constant == pytest.approx(ring.first_deg, abs=1)
    assert arc.quality > 0.8 > whole.quality


def test_a_ring_fitted_with_one_object_too_few_grows_round_and_closes() -> None:
    session, filling = session_on(RING), ring_filling(11)
    wrong = measured(session.evidence, filling, RING.numbers(filling), focal_mm=35.0)
    assert wrong is not None
    closed = as_far_as_it_goes(session, wrong)
    assert len(closed.filling.pattern.index) == 12
    assert "draw.x.angle.j" not in [unknown.name for unknown in closed.filling.moving], "the step is 360/12"
    assert closed.quality > 0.9 > 0.3 > wrong.quality


def test_a_closed_ring_with_a_gap_stays_closed() -> None:
    ring = DrawnRing(missing=frozenset({5}))
    session, filling = session_on(ring), ring.filling()
    fit = measured(session.evidence, filling, ring.numbers(filling), focal_mm=35.0)
    assert fit is not None
    assert as_far_as_it_goes(session, fit) is fit

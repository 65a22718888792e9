"""Answers within Table 1: every program found under strict is a string of it, and the note is true."""

import re
from dataclasses import replace

import numpy as np
import pytest
from drawn import DrawnRing
from found import finds
from ringed import found_on, guess_of, proposes, searches_around
from truth import small_scene

import p3i
from p3i.errors import SketchError
from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.result import StopReason, SynthesisResult
from p3i.search.synthesize import synthesize

ON_PHASE = DrawnRing(first_deg=0.0)
"""A ring that Table 1 can say exactly."""
OFF_PHASE = DrawnRing(first_deg=12.0)
ARC = DrawnRing(count=9, slots=14, first_deg=60.0)


def is_in_table1(result: SynthesisResult) -> None:
    """Every candidate, printed in the table's layout, reads back by the table's own grammar."""
    assert result.program is not None, result.reason
    assert result.candidates[0].program == result.program
    for candidate in result.candidates:
        text = format_program(candidate.program, layout="table1")
        assert parse(text, strict=True) == candidate.program


def near(ring: DrawnRing) -> DrawnRing:
    x, y = ring.center
    rx_deg, ry_deg, radius = ring.rx_deg + 1, ring.ry_deg - 1, 1.02 * ring.radius
    return replace(ring, rx_deg=rx_deg, ry_deg=ry_deg, center=(x + 0.3, y + 0.3), radius=radius)


def found(ring: DrawnRing, monkeypatch: pytest.MonkeyPatch, *, strict: bool) -> SynthesisResult:
    """The answer on a drawn ring, from a proposal close to it: what proposes is tested elsewhere."""
    proposes(monkeypatch, guess_of(near(ring)))
    return synthesize(ring.image(), SearchConfig(structure="circular", focal_mm=35.0, strict=strict, top=3))


@pytest.mark.parametrize("ring", [ON_PHASE, OFF_PHASE, ARC], ids=["on phase", "off phase", "arc"])
def test_a_strict_ring_is_in_table_1_and_says_how_far_it_is_off(
    ring: DrawnRing, monkeypatch: pytest.MonkeyPatch
) -> None:
    strict, free = (found(ring, monkeypatch, strict=strict) for strict in (True, False))
    is_in_table1(strict)
    assert strict.structure == "circular" and len(strict.centers) == len(free.centers)
    ours, theirs = (np.array(result.centers)[:, :2] for result in (strict, free))
    away = np.median(np.linalg.norm(ours[:, None] - theirs, axis=2).min(1))
    notes = [note for note in strict.notes if "pixels from the free fit" in note]
    assert len(notes) == 1
    # Told of the numbers as fitted, measured here between numbers as printed.
    told = re.search(r"lie ([\d.]+) pixels", notes[0])
    assert told is not None and float(told[1]) == pytest.approx(away, abs=0.1)
    assert not any("free fit" in note for note in free.notes)


def hybrid_found(kind: str, seed: int, of: int, monkeypatch: pytest.MonkeyPatch) -> SynthesisResult:
    scene = hybrid_scene(seed, kind=kind)
    searches_around(monkeypatch, found_on(scene, of=of))
    return synthesize(scene.image(), SearchConfig(structure="hybrid", focal_mm=35.0, strict=True, top=3))


@pytest.mark.parametrize(("kind", "seed", "of", "told"), [("concentric", 12, 1, 24), ("fan", 9, 1, 18)])
def test_strict_rings_in_rings_are_in_table_1(
    kind: str, seed: int, of: int, told: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = hybrid_found(kind, seed, of, monkeypatch)
    is_in_table1(result)
    assert result.structure == "hybrid"
    # Rings of equal counts are drawn i times over; each object counts once.
    assert len(result.centers) == told
    assert any("pixels from the free fit" in note for note in result.notes)


def test_what_table_1_has_no_words_for_is_no_answer_and_the_result_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = hybrid_found("row", 14, 0, monkeypatch)
    assert (result.program, result.stop) == (None, StopReason.OUTSIDE_TABLE_1)
    assert "Table 1" in result.reason


SPIRAL = (
    "SetCameraPose(rx=1, ry=2)\nfor j in range(0, 9):\n    Draw(x=(j + 9)*Cos(40*j), y=(j + 9)*Sin(40*j))\n"
)


def test_no_proposer_gets_a_program_past_table_1(monkeypatch: pytest.MonkeyPatch) -> None:
    spiral = Answer(p3i.loads(SPIRAL), "circular", 0.9, 0.9)
    finds(monkeypatch, spiral)
    image = OFF_PHASE.image()
    result = synthesize(image, SearchConfig(strict=True))
    assert (result.program, result.stop) == (None, StopReason.OUTSIDE_TABLE_1)


def test_an_answer_says_that_something_else_was_found_outside_table_1(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ring = OFF_PHASE
    text = f"SetCameraPose(rx={ring.rx_deg:g}, ry={ring.ry_deg:g})\nfor j in range(0, 12*i):\n"
    text += "    Draw(x=24*Cos(30*j) + 4, y=24*Sin(30*j) - 3)\n"
    inside = Answer(p3i.loads(text), "circular", 0.5, 0.5)
    outside = replace(inside, program=p3i.loads(SPIRAL), structure="hybrid", score=0.9)
    finds(monkeypatch, inside, outside)
    result = synthesize(ring.image(), SearchConfig(strict=True))
    is_in_table1(result)
    assert any("a hybrid would be an answer without strict" in note for note in result.notes)


@pytest.mark.parametrize("more", [{"focal_mm": "auto"}, {"extent": "image"}])
def test_options_that_change_a_lattice_leave_it_in_table_1(more: dict) -> None:
    is_in_table1(synthesize(small_scene(14).image(), SearchConfig(strict=True, top=3, **more)))


LATTICE = (
    "SetCameraPose(rx=-40, ry=-12)\nfor i in range(-3, 4):\n    for j in range(-3, 4):\n"
    "        Draw(x=3*i + 10.5*j{x}, y=11*i + 2*j)\n"
)


def sketch(text: str) -> Sketch:
    made = parse_sketch(text)
    assert isinstance(made, Sketch), made
    return made


@pytest.mark.parametrize("hole", [" + ??(-5, 5)", " + ~0", " + ??"])
def test_a_strict_sketch_with_a_hole_that_table_1_lacks_is_refused_whatever_its_middle(hole: str) -> None:
    image = small_scene(14).image()
    with pytest.raises(SketchError, match="leaves Table 1"):
        synthesize(image, SearchConfig(strict=True, sketch=sketch(LATTICE.format(x=hole))))


def test_a_strict_start_stays_in_table_1() -> None:
    from p3i.evaluation.program_scenes import program_scene

    truth = p3i.loads(LATTICE.format(x=""))
    near_it = p3i.loads(LATTICE.format(x="").replace("rx=-40", "rx=-41"))
    image = program_scene(truth, 1, look="flower").image()
    is_in_table1(synthesize(image, SearchConfig(strict=True, start=near_it)))

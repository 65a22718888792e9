"""What suffices for an answer: more bits than a picture without a pattern would ever show."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p3i.language import loads
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.judge import accept
from p3i.search.judge.accept import beyond_noise, false_alarms, suffices, with_printed_scores
from p3i.search.look.evidence import Evidence
from p3i.search.result import MOST_FALSE_ALARMS, NEEDED, StructureFound
from p3i.vision.image import Image

PROGRAM = loads("SetCameraPose(rx=1, ry=2)\nfor i in range(0, 9):\n    Draw(x=9*i, y=0)\n")
ENOUGH = -math.log2(MOST_FALSE_ALARMS)


def answer(structure: StructureFound = "lattice", *, score: float, bits: float) -> Answer:
    return Answer(PROGRAM, structure, score, bits)


@given(st.floats(0.1, 20), st.integers(1, 400), st.integers(1, 400))
def test_more_objects_that_explain_as_much_are_fewer_false_alarms(
    each: float, objects: int, more: int
) -> None:
    few, many = (false_alarms(each * count) for count in (objects, objects + more))
    assert many < few or many == few == 0


def test_the_bits_that_suffice_are_those_of_the_alarms_allowed() -> None:
    assert beyond_noise(ENOUGH + 0.01) and not beyond_noise(ENOUGH - 0.01)


@pytest.mark.parametrize("bits", [-1e6, -1.0, 0.0])
def test_a_find_that_costs_more_than_it_explains_is_expected_in_every_picture(bits: float) -> None:
    assert false_alarms(bits) == 1


def test_a_find_beyond_all_numbers_has_no_false_alarms() -> None:
    assert false_alarms(1e6) == 0


@pytest.mark.parametrize("structure", ["lattice", "circular", "hybrid"])
def test_one_rule_serves_all_structures_whatever_their_score(structure: StructureFound) -> None:
    sure, poor = (answer(structure, score=0.01, bits=ENOUGH + by) for by in (0.1, -0.1))
    assert suffices(sure, None) and not suffices(poor, None)


@pytest.mark.parametrize("structure", ["lattice", "circular", "hybrid"])
def test_what_agrees_no_more_than_half_a_step_away_is_none_unless_its_cells_are_few(
    structure: StructureFound,
) -> None:
    none = answer(structure, score=0.0, bits=500)
    few = replace(
        none, program=loads("SetCameraPose(rx=1, ry=2)\nfor i in range(0, 6):\n    Draw(x=9*i, y=0)\n")
    )
    assert not suffices(none, None)
    assert suffices(few, None) == (structure == "lattice")


@pytest.mark.parametrize(("printed", "enough"), [(NEEDED + 0.02, True), (NEEDED / 2, False)])
def test_what_was_asked_for_must_reach_the_score_before_and_after_and_needs_no_bits(
    monkeypatch: pytest.MonkeyPatch, printed: float, enough: bool
) -> None:
    monkeypatch.setattr(accept, "score_of_program", lambda *_, **__: printed)
    sure = answer(score=NEEDED + 0.01, bits=-50)
    lower = replace(sure, score=NEEDED / 2)
    image = Image(np.zeros((40, 40, 3), np.float32), np.ones((40, 40), bool))
    evidence = Evidence(image, SearchConfig(), 35.0)
    told = with_printed_scores(evidence, [sure, lower], needed=NEEDED)
    assert [one.score for one in told] == [printed, lower.score]
    assert [suffices(one, NEEDED) for one in told] == [enough, False]

"""What suffices for an answer: how well objects agree on the mean, or what all of them explain together."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p3i.language import loads
from p3i.search.answer import Answer
from p3i.search.judge.accept import (
    LOG2_TESTS,
    MOST_FALSE_ALARMS,
    beyond_noise,
    convincing,
    false_alarms,
)
from p3i.search.propose import windows
from p3i.search.propose.poses import pose_grid
from p3i.search.result import NEEDED, StructureFound

PROGRAM = loads("SetCameraPose(rx=1, ry=2)\nfor i in range(0, 9):\n    Draw(x=9*i, y=0)\n")


def answer(structure: StructureFound = "lattice", *, score: float, bits: float) -> Answer:
    return Answer(PROGRAM, structure, score, bits)


@given(st.floats(0.1, 20), st.integers(1, 400), st.integers(1, 400))
def test_more_objects_that_explain_as_much_are_fewer_false_alarms(
    each: float, objects: int, more: int
) -> None:
    few, many = (false_alarms("lattice", each * count) for count in (objects, objects + more))
    assert few is not None and many is not None and (many < few or many == few == 0)


def test_the_bits_that_suffice_are_those_of_the_tests_and_of_the_alarms_allowed() -> None:
    enough = LOG2_TESTS["lattice"] - math.log2(MOST_FALSE_ALARMS)
    assert beyond_noise("lattice", enough + 0.01) and not beyond_noise("lattice", enough - 0.01)


@pytest.mark.parametrize("bits", [-1e6, -1.0, 0.0])
def test_a_find_that_explains_nothing_is_a_false_alarm_in_every_test(bits: float) -> None:
    assert false_alarms("lattice", bits) == 2 ** LOG2_TESTS["lattice"]


def test_a_find_beyond_all_numbers_has_no_false_alarms() -> None:
    assert false_alarms("lattice", 1e6) == 0


@pytest.mark.parametrize("structure", ["circular", "hybrid"])
def test_rings_are_not_accepted_by_bits_alone(structure: StructureFound) -> None:
    assert false_alarms(structure, 1e4) is None and not beyond_noise(structure, 1e4)
    assert convincing(*[[answer(structure, score=NEEDED / 2, bits=1e4)]] * 2, needed=NEEDED) == []


def test_tests_are_no_fewer_than_the_starts_phases_and_ranges_of_the_search() -> None:
    """By the grids themselves: pairs of the shifts in reach, under each pose or in each window."""

    def pairs(least: float, most: float) -> float:
        y, x = np.mgrid[-int(most) : int(most) + 1, -int(most) : int(most) + 1]
        shifts = ((np.hypot(x, y) >= least) & (np.hypot(x, y) <= most)).sum() / 2
        return shifts * (shifts - 1) / 2

    side = windows.FINE
    views = len(pose_grid(windows.POSE_STEP_DEG, windows.MOST_TILT_DEG)) * pairs(*windows._SHIFTS)
    starts = len(windows._starts(side, windows._WINDOW)) ** 2 * (1 + 2 * 8) * pairs(5, windows._WINDOW / 2)
    cells = side // 4
    ranges = (cells * (cells + 1) / 2) ** 2
    tests = math.log2(views + starts) + math.log2(24 * 24) + math.log2(ranges)
    assert tests <= LOG2_TESTS["lattice"] < tests + 2


def test_either_rule_suffices_and_the_printed_score_must_reach_what_is_needed_by_the_first() -> None:
    sure, faint, poor = (
        answer(score=NEEDED + 0.01, bits=1),
        answer(score=NEEDED / 2, bits=3000),
        answer(score=NEEDED / 2, bits=10),
    )
    assert convincing([sure, faint, poor], [sure, faint, poor], needed=NEEDED) == [sure, faint]
    lower = replace(sure, score=NEEDED / 2)
    assert convincing([sure], [lower], needed=NEEDED) == []
    assert convincing([lower], [sure], needed=NEEDED) == []
    assert convincing([sure], [lower], needed=NEEDED, fills=True) == [lower]

"""Where nothing convinces on all of a large photo, the part that promises most is looked at closer, once."""

import dataclasses
import math

import numpy as np
import pytest
from walls import Wall, hall

import p3i
from p3i.api.search import without
from p3i.grammar.ast import Program
from p3i.search.answer import Answer
from p3i.search.closer import looked_closer, promising_part
from p3i.search.config import SearchConfig
from p3i.search.judge.accept import chosen_among, false_alarms
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.vision.image import Image, resized

SIZE = (1600, 1200)
# 3.6 pixels a lamp where the photo is reduced to 640, and a seventh of its area.
WALL = Wall((880, 560), 9.0, (64, 44))
LATTICE = SearchConfig(structure="lattice")
FEW = """SetCameraPose(rx=0, ry=0)
for i in range(0, 3):
    for j in range(0, 3):
        Draw(x=4*i, y=4*j)
"""


@pytest.fixture(scope="module")
def photo() -> Image:
    return hall(SIZE, WALL)


@pytest.fixture(scope="module")
def result(photo: Image) -> SynthesisResult:
    return synthesize(photo, LATTICE)


def session(photo: Image, config: SearchConfig = LATTICE) -> Session:
    return Session(Evidence(photo, config, 35.0), config)


def test_a_wall_of_small_lamps_in_a_large_photo_is_found(result: SynthesisResult) -> None:
    assert result.program is not None, result.reason
    assert 0.9 * 64 * 44 < len(result.centers) <= 64 * 44
    low, high = np.array(result.centers)[:, :2].min(0), np.array(result.centers)[:, :2].max(0)
    assert np.abs(low - WALL.outline.min(0) - 4.5).max() < 1.5 * WALL.step
    assert np.abs(high - WALL.outline.max(0) + 4.5).max() < 1.5 * WALL.step


def test_the_answer_says_where_it_was_looked_closer(result: SynthesisResult) -> None:
    assert any(note.startswith("found by a closer look at ") for note in result.notes)


def test_the_part_that_promises_most_holds_most_of_the_wall(photo: Image) -> None:
    box = promising_part(Evidence(photo, LATTICE, 35.0))
    assert box is not None and (box.width, box.height) == (800, 600)
    (x0, y0), (x1, y1) = WALL.outline.min(0), WALL.outline.max(0)
    inside = (min(x1, box.right) - max(x0, box.left)) * (min(y1, box.bottom) - max(y0, box.top))
    assert inside > 0.7 * (x1 - x0) * (y1 - y0)


def not_again(_: Session) -> list[Answer]:
    return pytest.fail("it was looked at again")


def test_the_choice_of_the_part_is_paid_in_bits() -> None:
    answer = Answer(Program.__new__(Program), "lattice", 0.2, 100.0)
    chosen = chosen_among(25, answer)
    assert chosen.worth == pytest.approx(100 - math.log2(25))
    assert false_alarms(chosen.worth) == pytest.approx(25 * false_alarms(answer.worth))


def test_a_closer_look_is_convinced_by_bits_alone(photo: Image) -> None:
    few = Answer(p3i.loads(FEW), "lattice", 0.9, 1.0)
    seen = looked_closer(session(photo), lambda _: [few])
    assert seen is not None and seen[1] == []


@pytest.mark.parametrize(
    "config",
    [
        SearchConfig(structure="circular"),
        SearchConfig(extent="image"),
        SearchConfig(lens=-0.1),
        SearchConfig(recipe="paper"),
    ],
)
def test_what_was_asked_for_by_name_gets_no_second_look(photo: Image, config: SearchConfig) -> None:
    assert looked_closer(session(photo, config), not_again) is None


def test_a_photo_that_the_finest_map_holds_gets_no_second_look(photo: Image) -> None:
    assert looked_closer(session(resized(photo, 640)), not_again) is None


def test_no_time_is_no_second_look(photo: Image) -> None:
    late = session(photo, dataclasses.replace(LATTICE, time_s=1e-9))
    assert looked_closer(late, not_again) is None


def test_a_refusal_says_how_small_a_step_was_too_small_to_see() -> None:
    things = hall((1280, 960), things=60)
    refused = synthesize(things, LATTICE)
    assert refused.program is None and refused.least_period_px == 16
    assert refused.reason.endswith("; repeats of less than 16 pixels are not seen: --roi looks closer")
    roi = ((0.0, 0.0), (639.0, 0.0), (639.0, 400.0), (0.0, 400.0))
    within = synthesize(without(things, mask=None, roi=roi), LATTICE)
    assert within.program is None and within.least_period_px is None

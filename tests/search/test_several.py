"""Every pattern of a photo, one after another, each by itself; the others are told beside the first."""

import dataclasses

import numpy as np
import pytest
from walls import Wall, hall

import p3i
from p3i.errors import UsageError
from p3i.search.config import SearchConfig
from p3i.search.result import StopReason, SynthesisResult
from p3i.search.several import MOST_PATTERNS, all_patterns, explained_ground
from p3i.vision.image import Image

LEFT = Wall((40, 60), 24.0, (10, 12))
RIGHT = Wall((370, 90), 19.0, (12, 16), colour=(0.4, 0.8, 0.95))
LATTICE = SearchConfig(structure="lattice")
PROGRAM = p3i.loads(
    "SetCameraPose(rx=0, ry=0)\nfor i in range(0, 4):\n    for j in range(0, 3):\n"
    "        Draw(x=10*i - 40, y=10*j - 20)\n"
)
REFUSED = SynthesisResult(program=None, stop=StopReason.NO_PATTERN, score=0.01, needed=0.13)


@pytest.fixture(scope="module")
def photo() -> Image:
    return hall((640, 480), LEFT, RIGHT, things=12)


@pytest.fixture(scope="module")
def results(photo: Image) -> tuple[SynthesisResult, ...]:
    return p3i.synth_all(photo, LATTICE)


def blank() -> Image:
    return Image(np.full((400, 600, 3), 0.5, np.float32), np.ones((400, 600), bool))


def found(stop: StopReason = StopReason.FOUND, **more) -> SynthesisResult:
    centers = tuple((60.0 + 60 * i, 80.0 + 60 * j, i, j) for i in range(4) for j in range(3))
    told = {"structure": "lattice", "score": 0.5, "centers": centers, **more}
    return SynthesisResult(program=PROGRAM, stop=stop, **told)


def test_each_board_of_a_hall_gets_its_program(results: tuple[SynthesisResult, ...]) -> None:
    middles = sorted(np.median(np.array(one.centers)[:, 0]) for one in results)
    assert len(results) == 2
    for middle, wall in zip(middles, (LEFT, RIGHT), strict=True):
        assert abs(middle - wall.outline[:, 0].mean()) < wall.step
    assert sorted(len(one.centers) for one in results) == [120, 192]
    assert all(one.program is not None and one.program.header is not None for one in results)


def test_the_first_of_all_is_the_answer_for_one_and_knows_of_the_other(
    photo: Image, results: tuple[SynthesisResult, ...]
) -> None:
    alone = p3i.synth(photo, LATTICE)
    assert alone.program == results[0].program
    (other,) = alone.others
    second = np.array(results[1].centers)[:, :2]
    assert np.abs(np.array(other.center) - np.median(second, 0)).max() < 20
    assert (other.structure, other.objects) == ("lattice", len(second))
    assert other.score > 0.13 and len(other.region) >= 4
    record = alone.record()
    assert record["others"] == [other.record()]
    assert results[0].others == () and "others" not in results[0].record()


def test_what_was_explained_is_masked_before_the_next_is_sought() -> None:
    seen: list[Image] = []

    def search(image: Image, config: SearchConfig) -> SynthesisResult:
        seen.append(image)
        return found() if len(seen) == 1 else REFUSED

    assert all_patterns(blank(), SearchConfig(), search) == (found(),)
    assert seen[0].valid.all() and not seen[1].valid[80, 60]
    assert seen[1].valid[350, 500], "far from the objects all is known"
    assert np.array_equal(~seen[1].valid, explained_ground(found(), blank()))


def test_a_refusal_of_the_first_is_the_answer() -> None:
    assert all_patterns(blank(), SearchConfig(), lambda *_: REFUSED) == (REFUSED,)


def test_a_pattern_on_explained_ground_is_none_and_the_search_ends() -> None:
    calls: list[int] = []

    def search(image: Image, config: SearchConfig) -> SynthesisResult:
        calls.append(1)
        return found()

    assert len(all_patterns(blank(), SearchConfig(), search)) == 1
    assert len(calls) <= MOST_PATTERNS


def test_the_time_is_for_all_together_and_an_end_ends_all() -> None:
    asked: list[float | None] = []

    def search(image: Image, config: SearchConfig) -> SynthesisResult:
        asked.append(config.time_s)
        return found(StopReason.FOUND if len(asked) == 1 else StopReason.TIME_UP)

    all_patterns(blank(), SearchConfig(time_s=50.0), search)
    first, second = asked
    assert first == 50.0 and second is not None and second < 50.0


@pytest.mark.parametrize(
    ("change", "named"),
    [({"top": 3}, "top"), ({"recipe": "paper"}, "recipe paper"), ({"extent": "image"}, "extent image")],
)
def test_options_that_speak_of_one_pattern_are_refused_beside_all(change: dict, named: str) -> None:
    config = dataclasses.replace(SearchConfig(), **change)
    with pytest.raises(UsageError, match=named):
        p3i.synth_all(blank(), config)

"""An answer may be told with a focal of its own; centres, header and record follow it."""

from dataclasses import replace

import numpy as np
import pytest
from found import finds

from p3i import api
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Program
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.judge import accept
from p3i.search.judge.region import centers_px
from p3i.search.outcome import focal_of
from p3i.vision.image import Image

ROWS = For("j", Affine(), Affine(constant=3), Draw(Affine(9), Affine(0, 9)))
PROGRAM = Program(CameraPose(-40, 10), For("i", Affine(), Affine(constant=4), ROWS))


@pytest.fixture
def image() -> Image:
    pixels = np.random.default_rng(0).uniform(size=(90, 120, 3)).astype(np.float32)
    return Image(pixels, np.ones((90, 120), bool))


def with_answers(monkeypatch: pytest.MonkeyPatch, *answers: Answer) -> None:
    # The picture is noise, which no program explains: what an answer is worth is as the test says.
    finds(monkeypatch, *answers, bits=99.0)
    monkeypatch.setattr(accept, "score_of_program", lambda *_, **__: 0.9)


def test_an_answer_with_its_own_focal_is_told_with_it(image: Image, monkeypatch) -> None:
    own = Answer(PROGRAM, "lattice", 0.9, 0.9, focal_mm=60.0, focal_reason="estimated, its cell a square")
    other = Answer(replace(PROGRAM, camera=CameraPose(5, 5)), "lattice", 0.8, 0.5)
    with_answers(monkeypatch, own, other)
    result = api.synth(image, SearchConfig(top=2))
    assert (result.focal_mm, result.focal_source) == (60.0, "pattern")
    assert result.focal_reason == "estimated, its cell a square"
    assert result.centers == centers_px(PROGRAM, image, 60.0) != centers_px(PROGRAM, image, 35.0)
    assert result.program is not None and result.program.header is not None
    assert result.program.header.focal_mm == 60.0
    assert dict(result.program.header.fit)["focal_from"] == "pattern"
    assert [candidate.focal_mm for candidate in result.candidates] == [60.0, 35.0]
    headers = [candidate.program.header for candidate in result.candidates]
    assert [header.focal_mm for header in headers if header] == [60.0, 35.0]
    record = result.record(image="a.png", seconds=1.0)
    assert record["camera"]["focal"] == 60.0
    assert record["camera"]["focal_reason"] == "estimated, its cell a square"


def test_an_answer_without_a_focal_is_told_with_the_assumed_one(image: Image, monkeypatch) -> None:
    reason = "assumed: seen nearly straight on"
    with_answers(monkeypatch, Answer(PROGRAM, "lattice", 0.9, 0.9, focal_reason=reason))
    result = api.synth(replace(image, focal_mm=28.0))
    assert (result.focal_mm, result.focal_source, result.focal_reason) == (28.0, "exif", reason)


def test_auto_assumes_what_the_photo_says_until_the_pattern_says_more(image: Image) -> None:
    auto = SearchConfig(focal_mm="auto")
    assert focal_of(image, auto) == (35.0, "default")
    assert focal_of(replace(image, focal_mm=28.0), auto) == (28.0, "exif")

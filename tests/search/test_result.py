"""The answer's reasons are sentences, and its record is that of the documented JSON lines."""

import pytest

from p3i.grammar.ast import Affine, CameraPose, Draw, Header, Program
from p3i.search.result import StopReason, SynthesisResult

PROGRAM = Program(CameraPose(), Draw(x=Affine(), y=Affine()))


def test_a_refusal_names_the_best_agreement_and_the_one_that_is_needed() -> None:
    result = SynthesisResult(program=None, stop=StopReason.NO_PATTERN, agreement=0.123, needed=0.35)
    assert result.reason == "no regular pattern (best 0.12, needs 0.35)"


def test_a_refusal_without_any_candidate_names_no_agreement() -> None:
    assert SynthesisResult(program=None, stop=StopReason.NO_PATTERN).reason == "no regular pattern"


def test_an_answer_needs_no_reason() -> None:
    assert SynthesisResult(program=PROGRAM, stop=StopReason.FOUND).reason == ""


@pytest.mark.parametrize("program", [None, PROGRAM])
def test_only_a_program_with_a_canvas_has_a_record(program: Program | None) -> None:
    result = SynthesisResult(program=program, stop=StopReason.FOUND)
    with pytest.raises(ValueError, match="canvas"):
        result.record(image="a.jpg", seconds=1.0)


def test_a_record_tells_of_a_lens_and_of_the_other_tilt_only_where_there_is_one() -> None:
    program = Program(CameraPose(), Draw(x=Affine(), y=Affine()), header=Header(canvas=(40, 30)))
    plain = SynthesisResult(program=program, stop=StopReason.FOUND)
    open_tilt = SynthesisResult(
        program=program, stop=StopReason.FOUND, mirrored=(12.5, -3.25), lens_k1=-0.0312
    )
    camera = plain.record(image="a.jpg", seconds=1.0)["camera"]
    assert "mirrored" not in camera and "lens_k1" not in camera
    camera = open_tilt.record(image="a.jpg", seconds=1.0)["camera"]
    assert camera["mirrored"] == [12.5, -3.25] and camera["lens_k1"] == -0.0312


def test_a_record_tells_how_well_the_tilt_is_known() -> None:
    program = Program(CameraPose(), Draw(x=Affine(), y=Affine()), header=Header(canvas=(40, 30)))
    result = SynthesisResult(program=program, stop=StopReason.FOUND, pose_sigma_deg=0.217)
    assert result.record(image="a.jpg", seconds=1.0)["camera"]["pose_sigma_deg"] == 0.217

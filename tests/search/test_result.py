"""The answer's reasons are sentences, and its record is that of the documented JSON lines."""

import pytest

from p3i.grammar.ast import Affine, CameraPose, Draw, Header, Program
from p3i.search.result import Candidate, Reading, StopReason, SynthesisResult

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


CROSSING, FIELD = Reading("crossing", 0.70446, (0.0, 0.0)), Reading("field", 0.25, (0.5, 0.5))


def test_a_record_tells_which_place_of_the_cell_is_the_object() -> None:
    program = Program(CameraPose(), Draw(x=Affine(), y=Affine()), header=Header(canvas=(40, 30)))
    lattice = SynthesisResult(program=program, stop=StopReason.FOUND, readings=(CROSSING, FIELD))
    record = lattice.record(image="a.jpg", seconds=1.0)
    assert (record["object"], record["object_confidence"]) == ("crossing", 0.7045)
    record = SynthesisResult(program=program, stop=StopReason.FOUND).record(image="a.jpg", seconds=1.0)
    assert (record["object"], record["object_confidence"]) == (None, None)


def test_a_refusal_of_a_place_names_those_that_the_cell_offers() -> None:
    told = (CROSSING, FIELD, Reading("3", 0.02, (0.5, 0.0)))
    refused = SynthesisResult(program=None, stop=StopReason.NO_SUCH_OBJECT, readings=told)
    assert refused.reason.endswith("has no such place (it offers crossing, field, 3)")
    assert refused.reading is None


@pytest.mark.parametrize(
    ("changes", "title"),
    [
        ({}, "lattice, score 0.35"),
        ({"reading": CROSSING}, "lattice, objects on the crossings (0.70), score 0.35"),
        (
            {"reading": FIELD, "same_lattice": True},
            "the same lattice, objects on the fields (0.25), score 0.35",
        ),
        (
            {"reading": Reading("3", 0.02, (0.0, 0.0))},
            "lattice, objects on place 3 of the cell (0.02), score 0.35",
        ),
    ],
)
def test_a_candidate_is_titled_by_what_it_is(changes: dict, title: str) -> None:
    assert Candidate(program=PROGRAM, score=0.35, structure="lattice", **changes).title == title

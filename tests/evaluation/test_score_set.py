"""`p3i eval`: what is right gets full marks, and each kind of wrong costs what its measure says."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import solvers

from p3i import api
from p3i.cli.main import run
from p3i.errors import FileError
from p3i.evaluation import score_set
from p3i.evaluation.annotations import annotation
from p3i.evaluation.measures import Measures, f1, measure
from p3i.evaluation.scenes import Scene, scene
from p3i.evaluation.truth import Truth, read_truth
from p3i.grammar.ast import Affine, CameraPose, Draw, Program
from p3i.grammar.printer import format_program
from p3i.interp.unroll import nest
from p3i.vision.write import write_image

KINDS = ("lattice", "circular", "hybrid")


def written(folder: Path, *scenes: Scene, **changes: object) -> Path:
    """A set of these scenes in `folder`; `changes` go into every annotation."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    told = []
    for number, one in enumerate(scenes):
        write_image(folder / "images" / f"{number}.png", one.pixels, force=True)
        told.append({**annotation(one, f"images/{number}.png"), **changes})
    (folder / "annotations.json").write_text(json.dumps(told))
    return folder


@pytest.fixture(scope="module")
def lattice() -> Scene:
    return scene("lattice", 3)


def truth_of(one: Scene, folder: Path, **changes: object) -> Truth:
    return read_truth(written(folder, one, **changes))[0]


def moved(program: Program, **numbers: float) -> Program:
    """The lattice program with numbers of its Draw changed by name: xi, xj, x1, yi, ..."""
    draw = nest(program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    fields = {"i": "i", "j": "j", "1": "constant"}
    x, y = (
        replace(
            part,
            **{fields[k[1]]: getattr(part, fields[k[1]]) + v for k, v in numbers.items() if k[0] == name},
        )
        for name, part in (("x", draw.x), ("y", draw.y))
    )

    def within(statement):
        if isinstance(statement, Draw):
            return replace(statement, x=x, y=y)
        return replace(statement, body=within(statement.body))

    return replace(program, world=within(program.world))


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_itself_gets_full_marks(kind, tmp_path: Path) -> None:
    one = scene(kind, 5)
    found = measure(one.program, truth_of(one, tmp_path))
    assert found.pose_deg < 0.01 and found.pose_l1 < 0.02
    assert found.chamfer < 0.002
    assert found.f1 > 0.99 and found.f1_free >= found.f1
    assert found.structure_ok
    assert (found.lattice_ok, found.index) == (
        (True, pytest.approx(1, abs=0.02)) if kind == "lattice" else (None, None)
    )


def test_the_same_view_through_another_lens_costs_nothing(lattice: Scene, tmp_path: Path) -> None:
    from p3i.search.optics.focal import refocused

    assert lattice.program.header is not None
    told = refocused(lattice.program, from_mm=35, to_mm=60)
    told = replace(told, header=replace(lattice.program.header, focal_mm=60.0))
    found = measure(told, truth_of(lattice, tmp_path))
    assert found.pose_deg < 0.01 and found.f1 > 0.99 and found.lattice_ok


def test_a_turned_camera_costs_its_angle(lattice: Scene, tmp_path: Path) -> None:
    pose = lattice.program.camera
    told = replace(lattice.program, camera=CameraPose(pose.rx_deg + 3, pose.ry_deg))
    found = measure(told, truth_of(lattice, tmp_path))
    assert found.pose_deg == pytest.approx(3, abs=0.01)


def test_between_the_objects_only_the_free_f1_finds_them(lattice: Scene, tmp_path: Path) -> None:
    draw = nest(lattice.program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    told = moved(lattice.program, x1=draw.x.i / 2, y1=draw.y.i / 2)
    found = measure(told, truth_of(lattice, tmp_path))
    assert found.f1 == 0 and found.f1_free > 0.8 and found.lattice_ok


def test_every_second_object_is_index_2_and_half_the_objects(lattice: Scene, tmp_path: Path) -> None:
    draw = nest(lattice.program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    told = moved(lattice.program, xi=draw.x.i, yi=draw.y.i)
    truth = truth_of(lattice, tmp_path)
    found = measure(told, truth)
    assert found.index == pytest.approx(2, abs=0.05) and found.lattice_ok is False
    assert found.f1 < 0.7 and found.gt_det > 0.03
    assert measure(told, replace(truth, accept_index=(1, 2))).lattice_ok


def test_another_reading_of_the_object_is_right_too(lattice: Scene, tmp_path: Path) -> None:
    away = (lattice.centers_px + 12).tolist()
    strict = truth_of(lattice, tmp_path / "a", centers=away)
    wide = truth_of(
        lattice, tmp_path / "b", centers=away, alt_objects=[{"centers": lattice.centers_px.tolist()}]
    )
    assert measure(lattice.program, strict).chamfer > 0.01
    assert measure(lattice.program, wide).chamfer < 0.001


def test_what_draws_nothing_in_sight_gets_the_worst_but_keeps_its_pose(
    lattice: Scene, tmp_path: Path
) -> None:
    told = moved(lattice.program, x1=5000.0)
    found = measure(told, truth_of(lattice, tmp_path))
    assert (found.chamfer, found.f1, found.f1_free, found.lattice_ok) == (2, 0, 0, False)
    assert found.pose_deg < 0.01


def test_f1_counts_each_true_object_once() -> None:
    true = np.array([[0.0, 0], [10, 0], [20, 0], [30, 0]])
    found = np.array([[0.0, 0.1], [0, -0.1], [10, 1], [24, 0], [99, 0]])
    assert f1(found, true, within=2.5) == pytest.approx(2 * 2 / (5 + 4))
    assert f1(found[:0], true, within=2.5) == 0


def results_file(folder: Path, *scenes: Scene) -> Path:
    lines = [
        {"image": f"{number}.png", "program": format_program(one.program), "seconds": 1.5}
        for number, one in enumerate(scenes)
    ]
    path = folder / "r.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def test_missing_and_unreadable_answers_count_as_the_worst(lattice: Scene, tmp_path: Path) -> None:
    folder = written(tmp_path, lattice, lattice, lattice, lattice)
    answers = results_file(tmp_path, lattice)
    refusal = {"image": "1.png", "program": None, "error": "no regular pattern"}
    broken = {"image": "2.png", "program": "Draw(x=i*i, y=0)"}
    answers.write_text(answers.read_text() + json.dumps(refusal) + "\n{\n" + json.dumps(broken) + "\n")
    score = api.eval_set(folder, results=answers)
    assert [row.error == "" for row in score.rows] == [True, False, False, False]
    assert score.rows[1].error == "no regular pattern" and score.rows[3].error == "no answer"
    assert score.rows[1].measures == Measures(lattice_ok=False)
    means = score.summary["lattice"]
    assert (means["n"], means["failed"], means["answered"]) == (4, 3, 0.25)
    assert means["pose_mean"] == pytest.approx(67.5, abs=0.1) and means["chamfer_answered"] < 0.01
    assert means["pose_mean_answered"] < 0.1 and means["seconds"] == 1.5


def test_unreliable_poses_are_left_out_of_the_poses(lattice: Scene, tmp_path: Path) -> None:
    folder = written(tmp_path, lattice, pose_reliable=False)
    means = api.eval_set(folder, results=results_file(tmp_path, lattice)).summary["all"]
    assert means["pose_median"] is None and means["f1"] > 0.99


def test_a_set_is_searched_scored_and_written_down(tmp_path: Path, capsys) -> None:
    folder = written(tmp_path, scene("lattice", 3))
    assert run(["eval", str(folder), "--structure", "lattice", "--out", str(tmp_path / "o.json")]) == 0
    printed = capsys.readouterr().out
    assert "0.png" in printed and "CPU" in printed
    told = json.loads((tmp_path / "o.json").read_text())
    assert told["rows"][0]["pose_deg"] < 2 and told["rows"][0]["lattice_ok"]
    assert told["summary"]["lattice"]["n"] == 1 and told["cpu"] > 0
    assert run(["eval", str(folder), "--out", str(tmp_path / "o.json")]) == 3


def test_more_processes_give_the_same_rows_in_the_same_order(lattice: Scene, tmp_path: Path) -> None:
    folder = written(tmp_path, lattice, lattice)
    write_image(folder / "images/0.png", np.full((48, 64, 3), 128, np.uint8), force=True)
    write_image(folder / "images/1.png", np.full((20, 20, 3), 128, np.uint8), force=True)
    one, two = (api.eval_set(folder, jobs=jobs) for jobs in (1, 2))
    assert [row.error for row in one.rows] == [row.error for row in two.rows]
    assert ["contrast" in row.error for row in two.rows] == [True, False]
    assert "too small" in two.rows[1].error
    assert two.peak_mb and two.cpu is not None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "no JSON"),
        ("[]", "list of photos"),
        ('[{"file": "a.png"}]', "photo 1 (a.png): 'structure' is missing"),
        ('[{"file": "a.png", "structure": "spiral", "pose": {}}]', "not 'spiral'"),
        ("[3]", "photo 1"),
    ],
)
def test_what_is_no_set_is_refused_with_its_place(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "annotations.json").write_text(text)
    with pytest.raises(FileError, match=says.replace("(", r"\(").replace(")", r"\)")):
        read_truth(tmp_path)
    with pytest.raises(FileError, match="there is no file"):
        read_truth(tmp_path / "none")


def test_nothing_left_to_score_is_said(lattice: Scene, tmp_path: Path, capsys) -> None:
    folder = written(tmp_path, lattice)
    assert run(["eval", str(folder), "--only", "cat"]) == 2
    assert run(["eval", str(folder), "--jobs", "0"]) == 2
    (tmp_path / "r.jsonl").write_text("nothing\n")
    assert run(["eval", str(folder), "--results", str(tmp_path / "r.jsonl")]) == 3
    assert capsys.readouterr().err.count("error: ") == 3


def test_a_process_that_the_system_ends_costs_its_own_photo_only(
    lattice: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ["a_quick", "b_slow", "c_killed", "d_quick"]
    told = [annotation(lattice, f"images/{name}.png") for name in names]
    (tmp_path / "annotations.json").write_text(json.dumps(told))
    monkeypatch.setattr(score_set, "_answer", solvers.measured)
    found = api.eval_set(tmp_path, jobs=2)
    assert [row.file for row in found.rows] == [f"images/{name}.png" for name in names]
    errors = [row.error for row in found.rows]
    assert errors[:2] == ["answered"] * 2 and errors[3] == "answered"
    assert "ended the process" in errors[2] and "memory" in errors[2]

"""`p3i examples`: a whole set, the same bytes twice, nothing overwritten unasked."""

import json
from pathlib import Path

import numpy as np
import pytest

import p3i
from p3i.cli.main import run
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.paint.draw.view import camera_view

FEW = ["--lattices", "1", "--rings", "2", "--hybrids", "1", "--seed", "3"]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("examples") / "deep" / "set"
    assert run(["examples", str(folder), *FEW]) == 0
    return folder


def test_a_set_is_pictures_programs_and_annotations(made: Path) -> None:
    said = json.loads((made / "annotations.json").read_text())
    assert [entry["structure"] for entry in said] == ["lattice", "circular", "circular", "hybrid"]
    names = {"lattice_000", "ring_000", "ring_001", "hybrid_000"}
    assert {path.stem for path in (made / "images").iterdir()} == names
    assert {path.name for path in (made / "programs").iterdir()} == {f"{name}.p3p" for name in names}
    assert run(["check", str(made / "programs")]) == 0
    assert run(["fmt", "--check", str(made / "programs")]) == 0


def test_annotations_pictures_and_programs_agree(made: Path) -> None:
    for entry in json.loads((made / "annotations.json").read_text()):
        picture = made / entry["file"]
        image = p3i.read_image(picture)
        assert (image.size.width, image.size.height) == (entry["width"], entry["height"])
        program = p3i.load(made / "programs" / f"{picture.stem}.p3p")
        assert program.header is not None and program.header.image is not None
        assert (made / "programs" / program.header.image).resolve() == picture.resolve()
        drawn = np.array(points(program))
        pixels, _ = camera_view(Camera.of(program), image.size).project(drawn[:, :2])
        apart = np.linalg.norm(pixels[:, None] - np.array(entry["centers"]), axis=2)
        assert (apart.min(axis=0) < 0.02).all()


def test_the_same_seed_writes_the_same_bytes_and_another_others(made: Path, tmp_path: Path) -> None:
    assert run(["examples", str(tmp_path / "again"), *FEW]) == 0
    assert contents(tmp_path / "again") == contents(made)
    assert run(["examples", str(tmp_path / "other"), *FEW[:-1], "4"]) == 0
    other = contents(tmp_path / "other")
    assert other["annotations.json"] != (made / "annotations.json").read_bytes()


def test_a_set_that_exists_is_kept_unless_forced(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = ["--lattices", "1", "--rings", "0", "--hybrids", "0"]
    assert run(["examples", str(tmp_path), *one]) == 0
    before = contents(tmp_path)
    (tmp_path / "annotations.json").unlink()
    capsys.readouterr()
    assert run(["examples", str(tmp_path), *one, "--seed", "1"]) == 3
    assert "--force" in capsys.readouterr().err
    assert {name: data for name, data in before.items() if name != "annotations.json"} == contents(tmp_path)
    assert run(["examples", str(tmp_path), *one, "--seed", "1", "--force"]) == 0
    assert contents(tmp_path).keys() == before.keys()
    assert contents(tmp_path) != before


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        (["--lattices", "-1"], 2, "0 to 1000 scenes"),
        (["--rings", "1001"], 2, "0 to 1000 scenes"),
        (["--lattices", "0", "--rings", "0", "--hybrids", "0"], 2, "no scenes"),
        (["--seed", "-1"], 2, "seed"),
        (["--rings", "many"], 2, "many"),
    ],
)
def test_calls_that_make_no_sense_are_refused_before_anything_is_written(
    words: list[str], code: int, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["examples", str(tmp_path / "set"), *words]) == code
    assert reason in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


def test_a_file_where_the_folder_should_be_is_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "set").write_text("mine")
    assert run(["examples", str(tmp_path / "set"), *FEW]) == 3
    assert "is a file" in capsys.readouterr().err
    assert (tmp_path / "set").read_text() == "mine"

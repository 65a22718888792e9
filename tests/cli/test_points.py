"""The shells of `p3i points` and `p3i show`: what they write and where, and what they refuse."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from click import unstyle

from p3i import api
from p3i.api import search
from p3i.cli.main import run
from p3i.search.result import StopReason, SynthesisResult
from p3i.vision.image import read_image
from p3i.vision.write import write_image

GRID = """\
# /// p3p
# version = 1
# canvas = [64, 48]
# ///
SetCameraPose(rx=-20, ry=10)
for i in range(0, 4):
    for j in range(0, 3):
        Draw(x=14*i - 20, y=14*j - 14)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a program and a photo of noise."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "grid.p3p").write_text(GRID)
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    write_image(tmp_path / "photo.png", noise)
    return tmp_path


def test_csv_comes_on_stdout_and_the_counts_on_stderr(folder: Path, capsys) -> None:
    assert run(["points", "grid.p3p"]) == 0
    out, err = capsys.readouterr()
    assert len(list(csv.DictReader(io.StringIO(out)))) == 12
    assert unstyle(err) == "info: grid.p3p: 12 objects\n"


def test_the_suffix_says_the_format_and_files_are_not_overwritten(folder: Path, capsys) -> None:
    assert run(["points", "grid.p3p", "-q", "-o", "out.geojson"]) == 0
    assert json.loads((folder / "out.geojson").read_text())["type"] == "FeatureCollection"
    assert run(["points", "grid.p3p", "-o", "out.geojson"]) == 3
    assert "--force" in capsys.readouterr().err
    assert run(["points", "grid.p3p", "-q", "-o", "out.geojson", "--force", "--format", "csv"]) == 0
    assert (folder / "out.geojson").read_text().startswith("name,row")


def test_with_a_photo_there_is_presence_and_there_are_crops(folder: Path, capsys) -> None:
    assert (
        run(["points", "grid.p3p", "--image", "photo.png", "--format", "json", "--crops", "crops/all"]) == 0
    )
    out, err = capsys.readouterr()
    record = json.loads(out)
    assert record["image"] == "photo.png"
    assert all(0 <= each["presence"] <= 1 for each in record["objects"] if each["presence"] is not None)
    assert " there, " in err
    names = sorted(path.name for path in (folder / "crops" / "all").iterdir())
    assert names == sorted(f"{each['name']}.png" for each in record["objects"])
    assert read_image(folder / "crops" / "all" / "B2.png").size.width > 4


def test_plain_crops_are_pieces_of_the_photo(folder: Path) -> None:
    assert run(["points", "grid.p3p", "-q", "--image", "photo.png", "--crops", "c", "--plain"]) == 0
    crop, photo = read_image(folder / "c" / "B2.png").pixels, read_image(folder / "photo.png").pixels
    height, width = crop.shape[:2]
    places = np.lib.stride_tricks.sliding_window_view(photo, (height, width, 3))[:, :, 0]
    cell = {each.name: each for each in api.points("grid.p3p").objects}["B2"].cell_px
    assert np.abs(np.ptp(np.array(cell), axis=0) - (width, height)).max() < 2
    assert (places == crop).all(axis=(2, 3, 4)).sum() == 1


def test_an_expectation_that_holds_exits_with_0_and_one_that_does_not_with_1(folder: Path, capsys) -> None:
    assert run(["points", "grid.p3p", "--expect", "4x3"]) == 0
    capsys.readouterr()
    assert run(["points", "grid.p3p", "--expect", "3x4"]) == 1
    out, err = capsys.readouterr()
    assert "expected 3 columns x 4 rows, but found 4 x 3" in err
    assert out.startswith("name,row")  # the list comes all the same


def test_several_programs_go_into_a_folder(folder: Path) -> None:
    (folder / "bad.p3p").write_text("Draw(x=10*k, y=0)")
    assert run(["points", "grid.p3p", "bad.p3p", "-q", "-o", "lists/", "--format", "coco"]) == 6
    assert [path.name for path in (folder / "lists").iterdir()] == ["grid.coco.json"]


def test_a_photo_has_its_program_found_first(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    asked = []

    def found(photo, config=None, **_):
        asked.append(photo)
        return SynthesisResult(program=api.loads(GRID), stop=StopReason.FOUND)

    monkeypatch.setattr(search, "synth", found)
    assert run(["points", "photo.png"]) == 0
    assert len(asked) == 1 and capsys.readouterr().out.startswith("name,row")
    assert run(["show", "photo.png", "-o", "over.png", "-q"]) == 0
    assert read_image(folder / "over.png").size == read_image(folder / "photo.png").size


def test_a_photo_without_a_pattern_exits_with_5(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    nothing = SynthesisResult(program=None, stop=StopReason.NO_PATTERN, agreement=0.02, needed=0.13)
    monkeypatch.setattr(search, "synth", lambda *_, **__: nothing)
    assert run(["points", "photo.png"]) == 5
    assert "no regular pattern" in capsys.readouterr().err


def test_a_picture_drawn_here_is_a_program(folder: Path, capsys) -> None:
    assert run(["render", "grid.p3p", "-o", "drawn.png"]) == 0
    assert run(["points", "drawn.png"]) == 0
    assert capsys.readouterr().out.count("\n") == 13


@pytest.mark.parametrize(
    ("words", "code", "answer"),
    [
        (["points", "gone.p3p"], 3, "gone.p3p"),
        (["points", "grid.p3p", "--image", "gone.png"], 3, "gone.png"),
        (["points", "grid.p3p", "--image", "grid.p3p"], 3, "grid.p3p"),
        (["points", "photo.png", "--image", "photo.png"], 2, "both are photos"),
        (["points", "bare.p3p"], 2, "how large is the photo"),
        (["points", "behind.p3p"], 4, "in front of its camera"),
        (["points", "sketch.p3p"], 4, "hole"),
        (["points", "grid.p3p", "--min-presence", "2"], 2, "between 0 and 1"),
        (["points", "grid.p3p", "--min-presence", "nan"], 2, "between 0 and 1"),
        (["points", "grid.p3p", "--expect", "12"], 2, "no size"),
        (["points", "grid.p3p", "--expect", "0x3"], 2, "no size"),
        (["points", "grid.p3p", "--label", " "], 2, "label"),
        (["points", "grid.p3p", "--focal", "-3"], 2, "focal"),
        (["points", "grid.p3p", "--format", "xls"], 2, "xls"),
        (["points", "grid.p3p", "-o", "out.xls"], 2, "cannot tell the format"),
        (["points", "grid.p3p", "-o", "nowhere/out.csv"], 3, "nowhere"),
        (["points", "grid.p3p", "--crops", "crops"], 2, "--image"),
        (["points", "grid.p3p", "grid2.p3p"], 2, "FOLDER"),
        (["points", "grid.p3p", "grid2.p3p", "-o", "lists/", "--crops", "c"], 2, "--crops"),
        (["points", "lists2/"], 3, "lists2"),
        (["show", "gone.png", "grid.p3p"], 3, "gone.png"),
        (["show", "photo.png", "gone.p3p"], 3, "gone.p3p"),
        (["show", "photo.png", "behind.p3p"], 4, "in front of its camera"),
        (["show", "photo.png", "grid.p3p", "-o", "out.gif"], 2, "cannot tell the kind"),
        (["show", "photo.png", "grid.p3p", "--longer", "3"], 2, "longer side"),
        (["show", "photo.png", "grid.p3p", "--labels", "all"], 2, "labels"),
        (["show", "photo.png", "plain.png", "photo.png"], 2, "FOLDER"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_bad_input_gets_one_line_and_its_exit_code(folder: Path, words, code, answer, capsys) -> None:
    bare = GRID.partition("# ///\nSet")[2]
    (folder / "bare.p3p").write_text("Set" + bare)
    (folder / "grid2.p3p").write_text(GRID)
    (folder / "behind.p3p").write_text(GRID.replace("rx=-20", "rx=80").replace("14*j - 14", "0*j - 900"))
    (folder / "sketch.p3p").write_text(GRID.replace("14*i", "??*i"))
    assert run(words) == code
    err = unstyle(capsys.readouterr().err)
    assert answer in err and "Traceback" not in err and "bug" not in err


def test_errors_are_json_where_asked(folder: Path, capsys) -> None:
    assert run(["points", "grid.p3p", "--expect", "1x1", "--error-format", "json"]) == 1
    records = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert records[-1]["code"] == 1


def test_show_writes_svg_and_pdf_too(folder: Path) -> None:
    for kind, head in (("svg", b"<?xml"), ("pdf", b"%PDF")):
        assert run(["show", "photo.png", "grid.p3p", "-q", "-o", f"over.{kind}"]) == 0
        assert (folder / f"over.{kind}").read_bytes().startswith(head)

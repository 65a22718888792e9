"""The shell of `p3i inpaint`: masks and removed objects, what is written and where, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from marked import LATTICE, drawn

from p3i.cli.main import run
from p3i.vision.image import read_image
from p3i.vision.write import write_image


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a photo, its program, and a mask of a box in its middle."""
    monkeypatch.chdir(tmp_path)
    photo = drawn(LATTICE, width=240, height=200)
    write_image(tmp_path / "photo.png", photo.pixels)
    (tmp_path / "grid.p3p").write_text(LATTICE)
    mask = np.zeros((200, 240, 3), np.uint8)
    mask[90:115, 100:130] = 255
    write_image(tmp_path / "mask.png", mask)
    return tmp_path


def test_a_mask_is_filled_and_all_else_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inpaint", "photo.png", "grid.p3p", "--mask", "mask.png", "-o", "out.png", "-v"]) == 0
    before, after = (read_image(folder / name).pixels for name in ("photo.png", "out.png"))
    marked = read_image(folder / "mask.png").pixels[:, :, 0] > 0.5
    assert np.array_equal(before[~marked], after[~marked])
    assert not np.array_equal(before[marked], after[marked])
    assert "750 pixels filled" in capsys.readouterr().err


def test_the_facts_go_to_a_file_and_the_picture_elsewhere(folder: Path) -> None:
    words = ["inpaint", "photo.png", "grid.p3p", "--mask", "mask.png", "-q"]
    assert run([*words, "-o", "out.png", "--json", "facts.json"]) == 0
    facts = json.loads((folder / "facts.json").read_text())
    assert (facts["method"], facts["filled"], facts["unlike"]) == ("stack", 750, 0)
    assert (folder / "out.png").exists()


def test_several_objects_are_restored_at_once(folder: Path) -> None:
    words = ["--restore", "0,0", "--restore", "D6"]
    assert run(["inpaint", "photo.png", "grid.p3p", *words, "-o", "out.png", "-q"]) == 0
    before, after = (read_image(folder / name).pixels for name in ("photo.png", "out.png"))
    columns = np.flatnonzero((before != after).any((0, 2)))
    assert np.ptp(columns) > 30  # two cells side by side


def test_removing_takes_the_object_away_and_says_that_it_meant_another_thing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["inpaint", "photo.png", "grid.p3p", "--remove", "0,0"]
    assert run([*words, "-o", "out.png", "--json", "facts.json"]) == 0
    assert "--restore" in capsys.readouterr().err
    facts = json.loads((folder / "facts.json").read_text())
    assert facts["removed"] == 1 and facts["holes"][0]["ground"] == 1
    assert any("--restore" in note for note in facts["notes"])


def test_what_is_marred_is_written_as_a_mask_that_can_be_filled(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pixels = read_image(folder / "photo.png").pixels.copy()
    pixels[96:106, 118:131] = (0.4, 0.2, 0.1)
    write_image(folder / "marred.png", pixels)
    assert (
        run(["inpaint", "marred.png", "grid.p3p", "--find", "-o", "found.png", "--json", "a.json", "-v"]) == 0
    )
    said = capsys.readouterr().err
    assert "marred: " in said and "none filled" in said
    facts = json.loads((folder / "a.json").read_text())
    assert len(facts["found"]) == 1 and facts["found"][0]["objects"]
    assert run(["inpaint", "marred.png", "grid.p3p", "--mask", "found.png", "-o", "out.png", "-q"]) == 0
    after = read_image(folder / "out.png").pixels
    assert np.abs(after - read_image(folder / "photo.png").pixels).mean() * 255 < 1


def test_a_clean_pattern_has_nothing_marred(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inpaint", "photo.png", "grid.p3p", "--find", "-o", "found.png"]) == 0
    assert "nothing is marred" in capsys.readouterr().err
    assert read_image(folder / "found.png").pixels.max() == 0


def test_a_jpeg_says_that_it_stores_all_anew(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inpaint", "photo.png", "grid.p3p", "--restore", "0,0", "-o", "out.jpg"]) == 0
    assert "JPG stores every pixel anew" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--mask", "no.png"], 3, "there is no file no.png"),
        (["--restore", "Z99"], 2, "there is no object Z99"),
        ([], 2, "nothing is to be filled"),
        (["--restore", "0,0", "--time", "5"], 2, "--time belongs to the method npn"),
        (["--restore", "0,0", "--steps", "0"], 2, "at least one step"),
        (["--mask", "photo.png"], 3, "colours"),
        (["--find", "--mask", "mask.png"], 2, "leave out --mask"),
        (["--find", "--remove", "0,0"], 2, "leave out --remove"),
        (["--find", "--only-pattern"], 2, "leave out --only-pattern"),
        (["--remove", "Z99"], 2, "there is no object Z99"),
    ],
)
def test_what_cannot_be_filled_is_refused_by_name(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: int, said: str
) -> None:
    assert run(["inpaint", "photo.png", "grid.p3p", *words, "-o", "out.png"]) == code
    assert said in capsys.readouterr().err
    assert not (folder / "out.png").exists()


def test_a_file_that_exists_is_not_overwritten(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "out.png").write_bytes(b"mine")
    assert run(["inpaint", "photo.png", "grid.p3p", "--restore", "0,0", "-o", "out.png"]) == 3
    assert "--force" in capsys.readouterr().err
    assert (folder / "out.png").read_bytes() == b"mine"

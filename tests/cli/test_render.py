"""The shell of `p3i render`: what it writes and where, what it refuses, and with which exit code."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from p3i.cli import render as shell
from p3i.cli.main import run
from p3i.options.render import KINDS
from p3i.vision.image import read_image
from p3i.vision.write import write_image

GRID = """\
SetCameraPose(rx=-40, ry=10)
for i in range(0, 4):
    for j in range(0, 4):
        Draw(x=18*i - 27, y=18*j - 27)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a program, a photo and a sprite."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "grid.p3p").write_text(GRID)
    write_image(tmp_path / "photo.png", np.full((48, 64, 3), 90, np.uint8))
    write_image(tmp_path / "sprite.png", np.full((8, 8, 3), 200, np.uint8))
    return tmp_path


@pytest.mark.parametrize("kind", KINDS)
def test_the_suffix_tells_the_kind(folder: Path, kind: str) -> None:
    assert run(["render", "grid.p3p", "-o", f"out.{kind}"]) == 0
    beginnings = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert (folder / f"out.{kind}").read_bytes().startswith(beginnings[kind])


@pytest.mark.parametrize("form, beginning", [([], b"\x89PNG"), (["--format", "svg"], b"<?xml")])
def test_without_a_file_the_picture_goes_to_stdout(
    folder: Path, capfdbinary: pytest.CaptureFixture[bytes], form: list[str], beginning: bytes
) -> None:
    assert run(["render", "grid.p3p", *form]) == 0
    assert capfdbinary.readouterr().out.startswith(beginning)
    assert run(["render", "grid.p3p", "-o", "-", *form]) == 0
    assert capfdbinary.readouterr().out.startswith(beginning)


def test_every_option_reaches_the_picture(folder: Path) -> None:
    words = "--size 128x96 --image photo.png --cells --no-markers --horizon --focal 28 --max-px 20000 -q"
    assert run(["render", "grid.p3p", "-o", "a.png", *words.split()]) == 0
    assert read_image(folder / "a.png").size.width == 128
    plain = ["render", "grid.p3p", "--size", "128x96", "-q", "--force", "-o", "b.svg"]
    said = {}
    for option in ["", "--plane", "--no-cells", "--no-markers", "--sprite sprite.png", "--focal 80"]:
        assert run([*plain, *option.split()]) == 0
        said[option] = (folder / "b.svg").read_text()
    for option in ["--sprite sprite.png --sprite-units 3", "--image photo.png", "--cells --image photo.png"]:
        assert run([*plain, *option.split()]) == 0
        said[option] = (folder / "b.svg").read_text()
    assert len(set(said.values())) == len(said)


def test_nothing_is_overwritten_without_force(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "out.png").write_bytes(b"mine")
    assert run(["render", "grid.p3p", "-o", "out.png"]) == 3
    assert "--force" in capsys.readouterr().err
    assert (folder / "out.png").read_bytes() == b"mine"
    assert run(["render", "grid.p3p", "-o", "out.png", "--force"]) == 0


def test_a_drawn_picture_can_be_drawn_again_as_another_kind(folder: Path) -> None:
    assert run(["render", "grid.p3p", "-o", "drawn.png"]) == 0
    assert run(["render", "drawn.png", "-o", "other.svg"]) == 0
    assert run(["render", "other.svg", "-o", "again.png"]) == 0
    assert (folder / "again.png").read_bytes() == (folder / "drawn.png").read_bytes()


def test_several_programs_go_to_a_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "row.p3p").write_text("for i in range(0, 3):\n    Draw(x=9*i, y=0)\n")
    assert run(["render", "grid.p3p", "row.p3p", "-o", "one.png"]) == 2
    assert run(["render", ".", "-o", "drawn/", "--format", "svg"]) == 0
    assert sorted(path.name for path in (folder / "drawn").iterdir()) == ["grid.svg", "row.svg"]
    (folder / "bad.p3p").write_text("Draw(x=)")
    assert run(["render", "*.p3p", "-o", "more/"]) == 6
    assert sorted(path.name for path in (folder / "more").iterdir()) == ["grid.png", "row.png"]
    assert "bad.p3p" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words, code, sentence",
    [
        ("missing.p3p -o a.png", 3, "no file missing.p3p"),
        ("photo.png -o a.png", 3, "carries no program"),
        ("grid.p3p -o a.gif", 2, ".png, .svg, .pdf"),
        ("grid.p3p -o a.png --size 640", 2, "640x480"),
        ("grid.p3p -o a.png --size 0x10", 2, "640x480"),
        ("grid.p3p -o a.png --size 100000x100000", 2, "--max-px 10000000000"),
        ("grid.p3p -o a.png --image missing.jpg", 3, "missing.jpg"),
        ("grid.p3p -o a.png --image photo.png --size 50x50", 2, "distort"),
        ("grid.p3p -o a.png --sprite grid.p3p", 3, "grid.p3p"),
        ("grid.p3p -o a.png --focal 0", 2, "focal"),
        ("grid.p3p -o none/a.png", 3, "no folder"),
        ("grid.p3p --watch", 2, "--watch"),
        ("sketch.p3p -o a.png", 4, "P116"),
        ("bomb.p3p -o a.png", 4, "P122"),
        ("huge.p3p -o a.png", 2, "max-px"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, code: int, sentence: str
) -> None:
    (folder / "sketch.p3p").write_text("Draw(x=??, y=2)\n")
    (folder / "bomb.p3p").write_text("for i in range(0, 1000000000):\n    Draw(x=i, y=2)\n")
    header = "# /// p3p\n# version = 1\n# canvas = [1000000, 1000000]\n# ///\n"
    (folder / "huge.p3p").write_text(header + GRID)
    assert run(["render", *words.split()]) == code
    shown = capsys.readouterr().err
    assert sentence in shown
    assert "Traceback" not in shown
    assert not list(folder.glob("a.*")) and not list(folder.glob(".a*")), "nothing half written"


def test_errors_come_as_json_where_asked(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "missing.p3p", "-o", "a.png", "--error-format", "json"]) == 3
    said = json.loads(capsys.readouterr().err)
    assert said["code"] == 3 and "missing.p3p" in said["error"]


def test_a_picture_beside_the_programs_folder_needs_a_word_of_leave(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "red.png"
    write_image(elsewhere, np.full((8, 8, 3), (200, 0, 0), np.uint8))
    (folder / "named.p3p").write_text(f'Draw("{elsewhere}", x=0, y=0)')
    words = ["render", "named.p3p", "--size", "40x40", "-o", "named.png"]
    assert run(words) == 3
    assert "--allow-outside reads it" in capsys.readouterr().err
    assert run([*words, "--allow-outside"]) == 0
    assert (read_image(folder / "named.png").pixels[20, 20] * 255).round().tolist() == [200, 0, 0]


def test_notes_are_said_unless_quiet(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "none.p3p").write_text("for i in range(0, 0):\n    Draw(x=9*i, y=0)\n")
    assert run(["render", "none.p3p", "-o", "a.png"]) == 0
    assert "none.p3p: the program draws nothing" in capsys.readouterr().err
    assert run(["render", "none.p3p", "-o", "b.png", "-q"]) == 0
    assert capsys.readouterr().err == ""
    assert run(["render", "grid.p3p", "-o", "c.png", "-v", "--size", "64x48"]) == 0
    assert "64 x 48 px, focal 35 mm (default)" in capsys.readouterr().err


def test_watching_draws_again_when_the_program_changes(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    target, seen = folder / "out.svg", []
    edits = [GRID.replace("range(0, 4)", "range(0, 2)"), "Draw(x=", "Draw(x=1, y=2)"]

    def sleep(_seconds: float) -> None:
        """Stands in for the waiting between two looks: an edit each time, Ctrl-C in the end."""
        seen.append(target.read_text().count("<ellipse"))
        if not edits:
            raise KeyboardInterrupt
        path = folder / "grid.p3p"
        path.write_text(edits.pop(0))
        os.utime(path, ns=(len(seen), len(seen)))

    monkeypatch.setattr(shell.time, "sleep", sleep)
    assert run(["render", "grid.p3p", "-o", "out.svg", "--watch"]) == 130
    assert seen == [16, 4, 4, 1], "a broken program leaves the last picture"
    assert "grid.p3p:1" in capsys.readouterr().err

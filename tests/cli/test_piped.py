"""Every verb that takes a program takes it as text, as a drawing that carries it, and from a pipe."""

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click import unstyle
from marked import LATTICE, drawn

from p3i.cli.main import COMMANDS, run
from p3i.vision.write import write_image

# PROG stands where the program is asked for; the photo is photo.png.
TAKES: dict[str, str] = {
    "show": "photo.png PROG -o out.png",
    "render": "PROG -o out.png",
    "rectify": "photo.png PROG -o out.png",
    "tile": "photo.png PROG -o out.png",
    "inpaint": "photo.png PROG --remove 0,0 -o out.png",
    "extend": "photo.png PROG --by 4 --beyond continue -o out.png",
    "edit": "photo.png PROG grid.p3p -o out.png",
    "points": "photo.png PROG -o out.csv",
    "score": "photo.png PROG",
}
ON_TEXT = {"check", "fmt", "expand"}
TAKE_NONE = {"eval", "examples", "trace", "synth", "doctor"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a photo, its program, and drawings that carry it."""
    monkeypatch.chdir(tmp_path)
    write_image(tmp_path / "photo.png", drawn(LATTICE, width=240, height=200).pixels)
    (tmp_path / "grid.p3p").write_text(LATTICE)
    return tmp_path


def pipe(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: False))


def test_the_table_below_knows_every_command() -> None:
    assert set(COMMANDS) <= TAKES.keys() | ON_TEXT | TAKE_NONE


@pytest.mark.parametrize("verb", TAKES)
def test_a_program_comes_from_a_pipe(
    verb: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    pipe(monkeypatch, LATTICE.encode())
    assert run([verb, *TAKES[verb].replace("PROG", "-").split()]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("kind", ["png", "svg"])
@pytest.mark.parametrize("verb", TAKES)
def test_a_program_comes_from_a_drawing(verb: str, kind: str, folder: Path, capsys) -> None:
    assert run(["render", "grid.p3p", "-q", "-o", f"drawn.{kind}"]) == 0
    assert run([verb, *TAKES[verb].replace("PROG", f"drawn.{kind}").split()]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("verb", sorted(ON_TEXT))
def test_the_verbs_on_text_read_a_pipe_too(verb: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe(monkeypatch, LATTICE.encode())
    assert run([verb, "-"]) == 0


@pytest.mark.parametrize("kind", ["png", "svg"])
@pytest.mark.parametrize("verb", sorted(ON_TEXT))
def test_the_verbs_on_text_read_what_a_drawing_carries(
    verb: str, kind: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    assert run([verb, "grid.p3p"]) == 0  # which fmt brings into its canonical form
    assert run(["render", "grid.p3p", "-q", "-o", f"drawn.{kind}"]) == 0
    capsys.readouterr()
    pipe(monkeypatch, (folder / "grid.p3p").read_bytes())
    assert run([verb, "-"]) == 0
    of_text = capsys.readouterr().out
    pipe(monkeypatch, (folder / f"drawn.{kind}").read_bytes())
    assert run([verb, "-"]) == 0
    assert capsys.readouterr().out == of_text
    if verb != "fmt":
        assert run([verb, f"drawn.{kind}"]) == 0
        assert capsys.readouterr().out == of_text


@pytest.mark.parametrize("kind", ["png", "svg"])
@pytest.mark.parametrize("option", ["--layout=python", "--check", "--diff"])
def test_fmt_writes_no_text_over_a_drawing(kind: str, option: str, folder: Path, capsys) -> None:
    assert run(["render", "grid.p3p", "-q", "-o", f"drawn.{kind}"]) == 0
    before = (folder / f"drawn.{kind}").read_bytes()
    assert run(["fmt", option, f"drawn.{kind}", "grid.p3p"]) == 3
    assert f"drawn.{kind} is a picture" in unstyle(capsys.readouterr().err)
    assert (folder / f"drawn.{kind}").read_bytes() == before


@pytest.mark.parametrize("verb", sorted(ON_TEXT))
def test_a_picture_without_a_program_is_a_file_error_of_the_verbs_on_text(
    verb: str, folder: Path, capsys
) -> None:
    assert run([verb, "photo.png"]) == 3
    assert "photo.png carries no program" in unstyle(capsys.readouterr().err)


@pytest.mark.parametrize(
    "words",
    [
        "rectify - -",
        "rectify photo.png - --back -",
        "show - -",
        "inpaint - grid.p3p --mask -",
        "inpaint photo.png - --mask -",
        "edit photo.png - -",
        "points - --image -",
        "score - -",
        "render - --image -",
        "render - --sprite -",
        "tile - -",
        "extend - -",
        "render - - -o out/",
        "check - -",
        "fmt - -",
        "synth - --mask -",
        "synth - --start -",
        "synth photo.png --mask - --start -",
    ],
)
def test_standard_input_serves_one_argument(words: str, folder: Path, monkeypatch, capsys) -> None:
    pipe(monkeypatch, LATTICE.encode())
    output = ["-o", "out.json" if words.startswith("score") else "out.png"]
    if "-o" in words or words.startswith(("check", "fmt")):
        output = []
    assert run([*words.split(), *output]) == 2
    assert "standard input" in unstyle(capsys.readouterr().err)


@pytest.mark.parametrize("start", ["-", "drawn.png", "drawn.svg"])
def test_synth_starts_from_a_program_wherever_it_comes_from(
    start: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from p3i import api, loads
    from p3i.cli import synth
    from p3i.search.result import StopReason, SynthesisResult

    asked = []

    def found(photo, config, **_):
        asked.append(config.start)
        return SynthesisResult(program=loads(LATTICE), stop=StopReason.FOUND)

    assert run(["render", "grid.p3p", "-q", "-o", "drawn.png"]) == 0
    assert run(["render", "grid.p3p", "-q", "-o", "drawn.svg"]) == 0
    monkeypatch.setattr(api, "synth", found)
    assert synth.api is api
    pipe(monkeypatch, LATTICE.encode())
    (folder / "list.txt").write_text("photo.png\n")
    assert run(["synth", "@list.txt", "--start", start, "-o", "out.p3p"]) == 0
    assert asked == [loads(LATTICE)]


def test_a_mask_from_a_pipe_is_read_once(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    import p3i
    from p3i.api import search
    from p3i.search.result import StopReason, SynthesisResult

    seen = []

    def found(photo, config=None, **_):
        seen.append(photo)
        return SynthesisResult(program=p3i.loads(LATTICE), stop=StopReason.FOUND)

    monkeypatch.setattr(search, "synth", found)
    mask = np.zeros((200, 240, 3), np.uint8)
    mask[90:115, 100:130] = 255
    write_image(folder / "mask.png", mask)
    pipe(monkeypatch, (folder / "mask.png").read_bytes())
    assert run(["inpaint", "photo.png", "--mask", "-", "-o", "out.png", "-v"]) == 0, capsys.readouterr().err
    assert "750 pixels filled" in capsys.readouterr().err
    assert not seen[0].valid[100, 110], "the hole is no evidence"

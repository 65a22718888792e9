"""A program made for another photo: what is said, and that every command that takes both says it."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import p3i
from p3i.cli.main import run
from p3i.place.belongs import doubt
from p3i.size import Size
from p3i.vision.write import write_image

GRID = """SetCameraPose(rx=-20, ry=5)
for i in range(0, 4):
    for j in range(0, 4):
        Draw(x=14*i - 21, y=14*j - 21)
"""


def program(canvas: str | None = "[640, 480]", image: str | None = "photos/wall.jpg") -> p3i.Program:
    facts = [f"canvas = {canvas}"] * (canvas is not None) + [f"image = '{image}'"] * (image is not None)
    return p3i.loads("\n# ".join(["# /// p3p", "version = 1", *facts]) + "\n# ///\n" + GRID)


@pytest.mark.parametrize(
    ("canvas", "image", "size", "name"),
    [
        ("[640, 480]", "photos/wall.jpg", Size(640, 480), "elsewhere/wall.jpg"),
        ("[640, 480]", "wall.jpg", Size(1280, 960), "wall.png"),
        ("[640, 480]", "wall.jpg", Size(639, 480), "Wall-filled.png"),
        ("[640, 480]", "wall-filled.png", Size(640, 480), "wall.jpg"),
        ("[640, 480]", "wall.jpg", Size(640, 480), None),
        ("[640, 480]", None, Size(640, 480), "other.jpg"),
        (None, None, Size(64, 480), "other.jpg"),
    ],
)
def test_nothing_is_said_of_the_same_photo(canvas, image, size: Size, name: str | None) -> None:
    assert doubt(program(canvas, image), size, name) is None


@pytest.mark.parametrize(
    ("image", "size", "name", "words"),
    [
        ("wall.jpg", Size(640, 480), "floor.jpg", "made for wall.jpg, and this is floor.jpg"),
        ("wall.jpg", Size(640, 480), "wall2.jpg", "made for wall.jpg, and this is wall2.jpg"),
        ("a\\wall1.jpg", Size(320, 240), "x/wall10.jpg", "made for wall1.jpg, and this is wall10.jpg"),
        ("wall.jpg", Size(480, 640), "floor.jpg", "not the photo .* canvas of wall.jpg of 640 x 480"),
        ("wall.jpg", Size(480, 640), "wall.jpg", "not the photo .* canvas of 640 x 480"),
        (None, Size(640, 400), None, "not the photo .* shape of this photo of 640 x 400"),
    ],
)
def test_another_photo_is_told(image, size: Size, name: str | None, words: str) -> None:
    assert re.search(words, doubt(program(image=image), size, name) or "")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a program of wall.png, that photo, and two others."""
    monkeypatch.chdir(tmp_path)
    random = np.random.default_rng(0)
    blocks = random.integers(40, 220, (12, 16, 3)).repeat(10, axis=0).repeat(10, axis=1).astype(np.uint8)
    write_image(tmp_path / "wall.png", blocks)
    write_image(tmp_path / "turned.png", np.ascontiguousarray(blocks.swapaxes(0, 1)))
    shutil.copy(tmp_path / "wall.png", tmp_path / "floor.png")
    (tmp_path / "wall.p3p").write_text(p3i.dumps(program("[160, 120]", "wall.png")))
    return tmp_path


COMMANDS = [
    "show",
    "rectify",
    "tile",
    "points",
    "score",
    "extend --by 2% --beyond continue",
    "inpaint --remove B2",
    "edit",
]


@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_with_photo_and_program_tells(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    verb, *options = words.split()
    new = ["wall.p3p"] * (verb == "edit")
    for photo, said in (
        ("wall.png", ""),
        ("floor.png", "made for wall.png"),
        ("turned.png", "not the photo"),
    ):
        ending = {"points": "csv", "score": "txt"}.get(verb, "png")
        code = run([verb, photo, "wall.p3p", *new, *options, "-o", f"out.{ending}", "--force"])
        heard = capsys.readouterr().err
        assert code == 0, heard
        assert (said in heard) if said else ("made for" not in heard)


def test_a_drawing_over_another_photo_tells_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "wall.p3p", "--image", "turned.png", "-o", "a.png"]) == 0
    assert capsys.readouterr().err.count("not the photo") == 1
    assert run(["points", "wall.p3p", "--image", "floor.png", "-o", "a.csv"]) == 0
    assert "this is floor.png" in capsys.readouterr().err

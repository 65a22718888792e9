"""Names that no photo, program or output should have: each is refused in a line, none by a traceback."""

import json
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from p3i.cli.main import run
from p3i.options.points import FORMATS

TEXT = """SetCameraPose(rx=-10, ry=5)
for i in range(-2, 3):
    for j in range(-2, 3):
        Draw(x=9*i, y=9*j)
"""
COMMANDS = [
    "synth {}",
    "synth a.png -o {}",
    "synth a.png --mask {}",
    "synth a.png --sketch {}",
    "synth a.png --trace {}",
    "synth a.png --format jsonl -o {}",
    "show {} a.p3p -o out.png",
    "render {} -o out.png",
    "render a.p3p --image {} -o out.png",
    "render a.p3p -o {}.png",
    "rectify {} a.p3p -o out.png",
    "rectify a.png {} -o out.png",
    "rectify a.png a.p3p -o out.png --json {}",
    "inpaint a.png a.p3p --mask {} -o out.png",
    "inpaint a.png a.p3p --mask a.png --method npn --checkpoint {} -o out.png",
    "extend a.png a.p3p --by 5% --beyond continue -o {}.png",
    "edit a.png a.p3p {} -o out.png",
    "points {}",
    "points a.p3p --image {}",
    "points a.p3p -o {}.csv",
    "check {}",
    "fmt {}",
    "expand {}",
    "score a.png {}",
    "trace {} -o out.gif",
    "eval sub --results {}",
    "eval sub --out {}",
    "examples {}/x",
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    noise = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    cv2.imwrite("a.png", noise)
    Path("a.p3p").write_text(TEXT)
    Path("sub").mkdir()
    for loop in ("loop", "loop.png", "loop.csv"):
        Path(loop).symlink_to(loop)
    return tmp_path


@pytest.mark.parametrize("name", ["loop", "n" * 256, "a.png/x"], ids=["a circle", "too long", "in a file"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_name_that_cannot_be_is_a_file_error(
    command: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(os.listdir(folder))
    assert run([word.format(name) for word in command.split()]) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert "error: " in said.err and "bug" not in said.err
    assert sorted(os.listdir(folder)) == before


@pytest.mark.parametrize("form", [form for form in FORMATS if form != "dxf"])
def test_a_photo_whose_name_is_no_text_is_listed(
    form: str, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    odd = os.fsdecode(b"tiles\xff.png")
    shutil.copy("a.png", odd)
    assert run(["points", "a.p3p", "--image", odd, "--format", form]) == 0
    text = capsysbinary.readouterr().out.decode("utf-8")
    if form in ("json", "coco", "labelme"):
        assert "tiles\N{REPLACEMENT CHARACTER}.png" in json.dumps(json.loads(text), ensure_ascii=False)


def test_a_program_found_in_a_photo_whose_name_is_no_text_is_written() -> None:
    odd = os.fsdecode(b"tiles\xff.p3p")
    shutil.copy("a.p3p", odd)
    for words in (["fmt"], ["check", "-q"], ["expand"]):
        assert run([*words, odd]) == 0


def test_the_photo_is_not_written_over_by_another_of_its_names(capsys: pytest.CaptureFixture[str]) -> None:
    os.link("a.png", "twin.png")
    Path("link.png").symlink_to("a.png")
    before = Path("a.png").read_bytes()
    for name in ("a.png", "twin.png", "link.png", "sub/../a.png"):
        assert run(["rectify", "a.png", "a.p3p", "-o", name, "--force"]) == 2
        assert "is read here" in capsys.readouterr().err
    assert Path("a.png").read_bytes() == before


@pytest.mark.parametrize(
    "words", [["fmt", ""], ["fmt", "a.p3p", ""], ["examples", ""], ["render", "a.p3p", ""]]
)
def test_an_empty_name_is_wrong_usage_and_touches_nothing(
    words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("loose.p3p").write_text("Draw(x = 1,y=2)")
    before = sorted(os.listdir(folder))
    assert run(words) == 2
    assert "empty" in capsys.readouterr().err
    assert Path("loose.p3p").read_text() == "Draw(x = 1,y=2)"
    assert sorted(os.listdir(folder)) == before

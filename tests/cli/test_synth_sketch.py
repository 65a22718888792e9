"""`p3i synth --sketch`, `--start`, `--recipe` and `--exhaustive`: what they refuse, and with which code."""

from pathlib import Path

import cv2
import pytest

import p3i
from p3i.cli.main import run
from p3i.evaluation.program_scenes import program_scene
from p3i.search.config import SearchConfig
from p3i.size import Size

ROW = (
    "SetCameraPose(rx=-40, ry=-12)\nfor i in range(0, 2):\n    for j in range(0, 7):\n"
    "        Draw(x=5*i + 10.5*j - 34, y=11*i + 2*j - 10)\n"
)


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("photos") / "row.png"
    scene = program_scene(p3i.loads(ROW), 1, look="window", size=Size(320, 240))
    cv2.imwrite(str(path), scene.pixels[..., ::-1])
    return path


def said(
    photo: Path, text: str, capsys: pytest.CaptureFixture[str], *more: str, option: str = "--sketch"
) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a synth of `photo` with `text` as its sketch."""
    path = photo.parent / "given.p3p"
    path.write_text(text)
    code = run(["synth", "-q", str(photo), option, str(path), *more])
    out, err = capsys.readouterr()
    return code, out, err


def test_a_sketch_is_filled(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = said(photo, ROW.replace("rx=-40", "rx=~-37").replace("10.5*j", "??(10, 11)*j"), capsys)
    assert code == 0
    program = p3i.loads(out)
    assert abs(program.camera.rx_deg + 40) < 2
    assert program.camera.ry_deg == -12
    assert program.header is not None and program.header.canvas == (320, 240)


def test_a_start_is_refined(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = said(photo, ROW.replace("-40", "-42"), capsys, option="--start")
    assert code == 0
    assert abs(p3i.loads(out).camera.rx_deg + 40) < 2


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (ROW, 4, "nothing in it is left to be found; write `??`"),
        (ROW.replace("10.5*j", "?? + ??"), 4, "P117"),
        (ROW.replace("10.5*j", "??*j").replace("for", "if"), 4, "P1"),
        (
            "# /// p3p\n# version = 1\n# canvas = [400, 400]\n# ///\n" + ROW.replace("10.5*j", "??*j"),
            4,
            "its canvas is 400 x 400, and the photo is 320 x 240; give the photo",
        ),
        ("SetCameraPose(rx=??, ry=0)\nfor j in range(0, 3):\n    Draw(x=9*j, y=2)\n", 4, "draws 3 objects"),
        (
            "SetCameraPose(rx=0, ry=0)\nfor j in range(0, 8):\n"
            "    Draw(x=??(4, 5)*j + 10, y=??(-1, 0)*j - 30)\n",
            5,
            "the sketch does not fit this photo (best 0.",
        ),
    ],
)
def test_a_sketch_that_cannot_be_filled_says_why(
    photo: Path, capsys: pytest.CaptureFixture[str], text: str, code: int, words: str
) -> None:
    found, out, err = said(photo, text, capsys)
    assert (found, out) == (code, "")
    assert words in err


def test_strict_refuses_a_sketch_beyond_table1(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = said(photo, ROW.replace("10.5*j", "??*j"), capsys, "--strict")
    assert code == 4
    assert "it leaves Table 1" in err and "leave out --strict" in err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--recipe", "paper"], "--sketch and --recipe paper contradict each other"),
        (["--exhaustive", "3"], "--sketch and --exhaustive contradict each other"),
        (["--structure", "lattice"], "--sketch and --structure lattice contradict each other"),
        (["--extent", "image"], "leave out --extent image"),
    ],
)
def test_a_sketch_and_another_way_to_search_contradict_each_other(
    photo: Path, capsys: pytest.CaptureFixture[str], more: list[str], words: str
) -> None:
    code, _, err = said(photo, ROW.replace("10.5*j", "??*j"), capsys, *more)
    assert code == 2
    assert words in err


def test_a_file_that_is_not_there_is_code_3(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["synth", str(photo), "--sketch", str(photo.parent / "none.p3p")]) == 3
    assert "none.p3p" in capsys.readouterr().err


def test_the_papers_recipe_is_one_configuration() -> None:
    config = SearchConfig(recipe="paper")
    assert (config.features_used, config.extent_used) == ("rgb", "image")
    assert SearchConfig(recipe="paper", weights=Path("alexnet.pth")).features_used == "alexnet"
    with pytest.raises(p3i.UsageError):
        SearchConfig(exhaustive_s=0)

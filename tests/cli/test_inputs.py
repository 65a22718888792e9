"""Which words of a call are photos and which is the program, told by their place, names and content."""

import os
from pathlib import Path

import numpy as np
import pytest

import p3i
from p3i.cli.inputs import Inputs, files, photos_and_programs
from p3i.errors import FileError
from p3i.vision.write import write_image

TEXT = "for i in range(0, 4):\n    for j in range(0, 3):\n        Draw(x=14*i - 20, y=14*j - 14)\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Photos a.png, b.jpg and c (without a suffix), programs, a drawing, a folder, a list."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.png", "b.jpg", "more/d.png", "more/e.jpg", "photo.png"):
        Path(name).parent.mkdir(exist_ok=True)
        write_image(name, np.full((9, 12, 3), 90, np.uint8))
    Path("photo.png").rename("c")
    Path("grid.p3p").write_text(TEXT)
    Path("grid.txt").write_text(TEXT)
    p3i.render(p3i.loads(TEXT), size=p3i.Size(40, 30)).save("drawn.png")
    p3i.render(p3i.loads(TEXT), size=p3i.Size(40, 30)).save("drawn.svg")
    Path("list.txt").write_bytes(b"b.jpg\r\n\nmore\n")
    Path("broken.jpg").write_text("this is no photo")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "photos", "programs"),
    [
        ("a.png", "a.png", ""),
        ("a.png grid.p3p", "a.png", "grid.p3p"),
        ("grid.p3p a.png", "a.png", "grid.p3p"),
        ("a.png grid.txt", "a.png", "grid.txt"),
        ("a.png drawn.svg", "a.png", "drawn.svg"),
        ("a.png drawn.png", "a.png", "drawn.png"),
        ("drawn.png grid.p3p", "drawn.png", "grid.p3p"),
        ("drawn.png", "drawn.png", ""),
        ("drawn.png a.png", "drawn.png a.png", ""),
        ("a.png -", "a.png", "-"),
        ("-", "-", ""),
        ("- grid.p3p", "-", "grid.p3p"),
        ("a.png b.jpg", "a.png b.jpg", ""),
        ("a.png b.jpg c", "a.png b.jpg c", ""),
        ("c grid.p3p", "c", "grid.p3p"),
        ("a.png b.jpg grid.p3p", "a.png b.jpg", "grid.p3p"),
        ("more grid.p3p", "more/d.png more/e.jpg", "grid.p3p"),
        ("more/*.png a.png grid.p3p", "more/d.png a.png", "grid.p3p"),
        ("@list.txt grid.p3p", "b.jpg more/d.png more/e.jpg", "grid.p3p"),
        ("a.png gone.p3p", "a.png", "gone.p3p"),
        ("gone.png grid.p3p", "gone.png", "grid.p3p"),
        ("grid.p3p gone.jpg", "gone.jpg", "grid.p3p"),
        ("a.png broken.jpg", "a.png broken.jpg", ""),
        ("grid.p3p", "grid.p3p", ""),
    ],
)
def test_the_program_comes_last_or_first_where_that_is_clear(words: str, photos: str, programs: str) -> None:
    assert photos_and_programs(words.split()) == Inputs(tuple(photos.split()), tuple(programs.split()))


@pytest.mark.parametrize(
    ("words", "photos", "programs"),
    [
        ("a.png grid.p3p grid.txt", "a.png", "grid.p3p grid.txt"),
        ("a.png - grid.txt", "a.png", "- grid.txt"),
        ("a.png grid.txt", "a.png", "grid.txt"),
        ("drawn.png grid.p3p grid.txt", "drawn.png", "grid.p3p grid.txt"),
        ("drawn.png grid.txt", "drawn.png", "grid.txt"),
        ("a.png b.jpg grid.p3p grid.txt", "a.png b.jpg", "grid.p3p grid.txt"),
    ],
)
def test_two_programs_may_follow(words: str, photos: str, programs: str) -> None:
    found = photos_and_programs(words.split(), most=2)
    assert found == Inputs(tuple(photos.split()), tuple(programs.split()))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_named_pipe_is_a_program_in_its_place_and_is_not_opened() -> None:
    os.mkfifo("pipe")
    assert photos_and_programs(["a.png", "pipe"]) == Inputs(("a.png",), ("pipe",))
    assert photos_and_programs(["pipe"]) == Inputs(("pipe",))


def test_a_list_names_files_globs_and_folders_and_a_file_may_begin_with_its_sign() -> None:
    Path("globs.txt").write_text("more/*.jpg\na.png\n")
    assert files(["@globs.txt"], suffixes={".png"}) == ("more/e.jpg", "a.png")
    Path("@b.jpg").touch()
    assert files(["@b.jpg"], suffixes={".png"}) == ("@b.jpg",)
    Path("empty.txt").write_text("\n  \n")
    with pytest.raises(FileError, match=r"empty\.txt holds no name"):
        files(["@empty.txt"], suffixes={".png"})
    with pytest.raises(FileError, match=r"no file gone\.txt"):
        files(["@gone.txt"], suffixes={".png"})

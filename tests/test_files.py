"""Files are named as people expect and written whole or not at all."""

import os
from pathlib import Path

import pytest

from p3i.errors import FileError
from p3i.files import check_writable, gather, make_folder, names_folder, replacing

KINDS = {".jpg", ".png"}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("b.jpg", "a.PNG", "notes.txt", "x[1].jpg"):
        Path(name).touch()
    Path("sub").mkdir()
    Path("sub/c.jpg").touch()
    return tmp_path


def test_a_folder_gives_its_files_of_known_kinds_by_name() -> None:
    assert gather(["."], suffixes=KINDS) == [Path("a.PNG"), Path("b.jpg"), Path("x[1].jpg")]


def test_words_keep_their_order_and_each_file_comes_once() -> None:
    found = gather(["sub/c.jpg", "*.jpg", "b.jpg", "gone.jpg"], suffixes=KINDS)
    assert found == [Path("sub/c.jpg"), Path("b.jpg"), Path("x[1].jpg"), Path("gone.jpg")]


def test_a_file_whose_name_looks_like_a_glob_is_a_file() -> None:
    assert gather(["x[1].jpg"], suffixes=KINDS) == [Path("x[1].jpg")]


def test_two_stars_go_into_folders() -> None:
    assert Path("sub/c.jpg") in gather(["**/*.jpg"], suffixes=KINDS)


def test_a_slash_or_a_folder_that_exists_means_a_folder() -> None:
    assert names_folder("sub") and names_folder("new/") and not names_folder("new")


def test_a_file_appears_whole_and_with_unix_line_ends() -> None:
    with replacing(Path("out.txt"), force=False) as stream:
        stream.write("one\ntwo\n")
        assert not Path("out.txt").exists()
    assert Path("out.txt").read_bytes() == b"one\ntwo\n"


def test_a_failure_half_way_leaves_the_old_file_and_nothing_else(folder: Path) -> None:
    Path("out.txt").write_text("old")
    before = sorted(os.listdir(folder))
    with pytest.raises(RuntimeError), replacing(Path("out.txt"), force=True) as stream:
        stream.write("half")
        raise RuntimeError
    assert Path("out.txt").read_text() == "old"
    assert sorted(os.listdir(folder)) == before


@pytest.mark.parametrize(
    ("path", "reason"), [("b.jpg", "--force"), ("sub", "is a folder"), ("gone/x.txt", "no folder gone")]
)
def test_what_cannot_be_written_is_said_beforehand(path: str, reason: str) -> None:
    with pytest.raises(FileError, match=reason):
        check_writable(Path(path), force=False)


def test_a_folder_in_the_place_of_a_file_is_refused() -> None:
    with pytest.raises(FileError, match=r"cannot make the folder b\.jpg"):
        make_folder(Path("b.jpg/sub"))

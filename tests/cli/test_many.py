"""The verbs on pictures speak one way: many photos with one program, their files, their facts, their talk."""

import importlib
import json
import os
import threading
import time
from pathlib import Path

import click
import pytest
from click import unstyle
from marked import LATTICE, drawn

import p3i
from p3i.api import search
from p3i.cli.main import COMMANDS, run
from p3i.search.result import StopReason, SynthesisResult
from p3i.vision.write import write_image

# What each verb needs beside its photos and the program, and how its files end.
VERBS: dict[str, tuple[list[str], str]] = {
    "show": ([], ".png"),
    "rectify": ([], ".png"),
    "tile": ([], ".png"),
    "inpaint": (["--remove", "0,0"], ".png"),
    "extend": (["--by", "4", "--beyond", "continue"], ".png"),
    "edit": ([], ".png"),
    "points": ([], ".csv"),
    "score": ([], ".txt"),
}
# Of the program itself, rather than of photos by it.
ALL = [*VERBS, "render"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with photos a and b in photos/, a program, and what is no photo."""
    monkeypatch.chdir(tmp_path)
    Path("photos").mkdir()
    for seed, name in enumerate("ab"):
        write_image(f"photos/{name}.png", drawn(LATTICE, seed=seed, width=180, height=150).pixels)
    Path("grid.p3p").write_text(LATTICE)
    Path("text.jpg").write_text("this is no photo\n")
    Path("list.txt").write_text("photos/a.png\nphotos/b.png\n")
    return tmp_path


def call(verb: str, *photos: str) -> list[str]:
    programs = ["grid.p3p", "grid.p3p"] if verb == "edit" else ["grid.p3p"]
    return [verb, *photos, *programs, *VERBS[verb][0]]


def made(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("verb", VERBS)
def test_a_photo_that_fails_costs_no_other(verb: str, folder: Path, capsys) -> None:
    assert run([*call(verb, "photos/a.png", "text.jpg", "photos/b.png"), "-o", "out/"]) == 6
    assert made(folder / "out") == [f"a{VERBS[verb][1]}", f"b{VERBS[verb][1]}"]
    assert unstyle(capsys.readouterr().err).count("error: text.jpg") == 1


@pytest.mark.parametrize("verb", VERBS)
def test_where_all_fail_alike_the_exit_code_is_theirs(verb: str, folder: Path) -> None:
    (folder / "more.jpg").write_text("nor is this\n")
    assert run([*call(verb, "text.jpg", "more.jpg"), "-o", "out/"]) == 3


@pytest.mark.parametrize("words", [["photos/"], ["photos/*.png"], ["@list.txt"]], ids=str)
@pytest.mark.parametrize("verb", ["show", "rectify", "points"])
def test_folders_globs_and_lists_name_photos(verb: str, words: list[str], folder: Path) -> None:
    assert run([*call(verb, *words), "-o", "out/", "-q", "--json", "facts.jsonl"]) == 0
    assert made(folder / "out") == [f"a{VERBS[verb][1]}", f"b{VERBS[verb][1]}"]
    facts = [json.loads(line) for line in (folder / "facts.jsonl").read_text().splitlines()]
    assert [each["image"] for each in facts] == ["photos/a.png", "photos/b.png"]


def test_without_a_program_that_of_each_photo_is_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def found(photo, config=None, **_):
        asked.append(photo.size)
        return SynthesisResult(program=p3i.loads(LATTICE), stop=StopReason.FOUND)

    monkeypatch.setattr(search, "synth", found)
    for verb in VERBS:
        words = ["grid.p3p"] if verb == "edit" else []
        target = f"{verb}/"
        assert run([verb, "photos/", *words, *VERBS[verb][0], "-o", target, "-q"]) == 0
        assert len(made(folder / target)) == 2
    assert len(asked) == 2 * len(VERBS)


@pytest.mark.parametrize("verb", ALL)
def test_help_says_what_the_words_may_be(verb: str, capsys) -> None:
    assert run([verb, "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "is a file, a glob, a folder, @LIST" in shown and "a PNG or SVG that carries it" in shown


@pytest.mark.parametrize("verb", VERBS)
def test_json_on_stdout_is_the_whole_answer_and_quiet_is_quiet(verb: str, folder: Path, capsys) -> None:
    assert run([*call(verb, "photos/a.png"), "--json", "-", "-q"]) == 0
    out, err = capsys.readouterr()
    assert isinstance(json.loads(out), dict) and err == ""
    assert made(folder) == ["grid.p3p", "list.txt", "photos", "text.jpg"]


@pytest.mark.parametrize("verb", VERBS)
def test_verbose_says_more_and_force_writes_over(verb: str, folder: Path, capsys) -> None:
    target = f"out{VERBS[verb][1]}"
    words = [*call(verb, "photos/a.png"), "-o", target]
    assert run(words) == 0
    plain = capsys.readouterr().err
    assert run(words) == 3
    assert "--force" in capsys.readouterr().err
    assert run([*words, "--force", "-v"]) == 0
    assert len(capsys.readouterr().err.splitlines()) == len(plain.splitlines()) + 1


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb != "edit"])
def test_the_old_order_is_understood_where_the_files_tell(verb: str, folder: Path, capsys) -> None:
    target = f"out{VERBS[verb][1]}"
    assert run([verb, "grid.p3p", "photos/a.png", *VERBS[verb][0], "-o", target]) == 0
    assert run([*call(verb, "photos/a.png"), "-o", f"new{target}"]) == 0
    assert (folder / target).read_bytes() == (folder / f"new{target}").read_bytes()


@pytest.mark.parametrize("verb", ["check", "fmt"])
def test_the_verbs_on_text_take_lists_too(verb: str, folder: Path, capsys) -> None:
    (folder / "programs.txt").write_text("grid.p3p\n")
    assert run([verb, "@programs.txt"]) == 0
    assert run([verb, "@gone.txt"]) == 3


def test_several_programs_that_fail_alike_exit_as_one_does(folder: Path) -> None:
    for name in ("bad.p3p", "worse.p3p"):
        (folder / name).write_text("Draw(x=")
    for verb in ("render", "points"):
        assert run([verb, "bad.p3p", "worse.p3p", "-o", "out/"]) == 4
        assert run([verb, "bad.p3p", "gone.p3p", "-o", "out/"]) == 6


@pytest.mark.parametrize("words", ["rectify --back photos/a.png", "inpaint --mask -", "points --crops crops"])
def test_what_serves_one_photo_is_refused_for_two(words: str, folder: Path, capsys) -> None:
    verb, *rest = words.split()
    assert run([verb, "photos/a.png", "photos/b.png", "grid.p3p", *rest, "-o", "out/"]) == 2
    assert "takes one photo" in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_a_shared_option_has_one_meaning() -> None:
    commands = [importlib.import_module(COMMANDS[verb].module).command for verb in ALL]
    shared = (
        "--output",
        "--json",
        "--force",
        "--quiet",
        "--verbose",
        "--error-format",
        "--format",
        "--focal",
    )
    for word in shared:
        found = [
            option
            for each in commands
            for option in each.params
            if isinstance(option, click.Option) and word in option.opts
        ]
        assert len(found) == len(commands), f"{word} is missing"
        assert len({(option.name, option.metavar, str(option.opts), option.is_flag) for option in found}) == 1
    for word in ("--json", "--force", "--quiet", "--verbose"):
        helps = {
            o.help for each in commands for o in each.params if isinstance(o, click.Option) and word in o.opts
        }
        assert len(helps) == 1, helps


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes of POSIX")
@pytest.mark.parametrize("verb", ["show", "rectify", "points", "score", "render"])
def test_a_pipe_that_is_called_anything_takes_the_first_kind(verb: str, folder: Path, capsys) -> None:
    os.mkfifo("anything")
    words = ["render", "grid.p3p"] if verb == "render" else call(verb, "photos/a.png")
    end = os.open("anything", os.O_RDONLY | os.O_NONBLOCK)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(_until_closed(end)))
    reader.start()
    try:
        assert run([*words, "-o", "anything"]) == 0, capsys.readouterr().err
    finally:
        reader.join(30)
        os.close(end)
    assert len(read[0]) > 20 and Path("anything").is_fifo()


def _until_closed(end: int) -> bytes:
    """What is written into a pipe until nobody holds it open."""
    parts: list[bytes] = []
    until = time.monotonic() + 20
    while time.monotonic() < until:
        try:
            part = os.read(end, 65536)
        except BlockingIOError:
            part = None
        if part:
            parts.append(part)
        elif part == b"" and parts:
            break
        else:
            time.sleep(0.01)
    return b"".join(parts)


def test_a_folder_for_crops_that_cannot_be_is_refused_before_a_search(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def searched(*_: object, **__: object) -> None:
        raise AssertionError("searched for nothing")

    monkeypatch.setattr(search, "synth", searched)
    assert run(["points", "photos/a.png", "--crops", "grid.p3p"]) == 3

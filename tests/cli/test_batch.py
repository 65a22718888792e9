"""Many inputs through one piece of work: what each costs the others, and the exit code of all."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from p3i.cli import batch
from p3i.cli.batch import Answer, Made, Talk, exit_code, run
from p3i.cli.streams import OutputError
from p3i.cli.targets import Kinds, Targets, targets
from p3i.errors import FileError, NoPatternError, UsageError

KINDS = Kinds(by_suffix={".txt": "txt", ".doc": "doc"}, text=frozenset({"txt"}), what="kind")
LINES = Kinds(by_suffix={".txt": "txt"}, text=frozenset({"txt"}), lines=frozenset({"txt"}), what="kind")
TALK = Talk(quiet=False, verbose=False, as_json=False)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        Path(name).write_bytes(b"photo")
    return tmp_path


def to(inputs: list[str], *, kinds: Kinds = KINDS, **given: object) -> Targets:
    words = {"output": None, "kind": None, "json_to": None, "force": False} | given
    return targets(words, inputs=inputs, kinds=kinds)


def work(failing: dict[str, BaseException], codes: dict[str, int] | None = None) -> Callable[..., Answer]:
    def one(name: str, update: batch.Update) -> Answer:
        update("working", 0.5)
        if name in failing:
            raise failing[name]
        code = (codes or {}).get(name, 0)
        return Answer(
            make=lambda: Made(f"{name}\n".encode()), facts=lambda: {"n": 1}, code=code, refusal="it is wrong"
        )

    return one


@pytest.mark.parametrize(
    ("codes", "code"),
    [([], 0), ([0, 0], 0), ([5, 5], 5), ([4], 4), ([0, 5], 6), ([3, 5], 6), ([0, 0, 1], 6), ([0, 130], 130)],
)
def test_the_exit_code_is_that_of_all_or_6(codes: list[int], code: int) -> None:
    assert exit_code(codes) == code


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (NoPatternError("no pattern"), 5),
        (FileError("gone"), 3),
        (ZeroDivisionError("a bug"), 70),
        (MemoryError(), 3),
        (OSError(28, "No space left on device"), 3),
        (RecursionError(), 70),
    ],
    ids=lambda value: type(value).__name__,
)
def test_no_failure_of_one_input_costs_another(
    failure: BaseException, code: int, folder: Path, capsys
) -> None:
    inputs = ["a.jpg", "b.jpg", "c.jpg"]
    found = to(inputs, output="out/")
    assert run(inputs, work({"b.jpg": failure}), to=found, talk=TALK) == 6
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["a.txt", "c.txt"]
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("error: b.jpg: ")
    everything = {name: failure for name in inputs}
    assert run(inputs, work(everything), to=to(inputs, output="more/"), talk=TALK) == code


def test_a_file_that_cannot_be_written_costs_no_other(folder: Path, capsys) -> None:
    inputs = ["a.jpg", "b.jpg"]
    found = to(inputs, output="out/")
    (folder / "out" / "a.txt").mkdir()  # since it was checked
    assert run(inputs, work({}), to=found, talk=TALK) == 6
    assert (folder / "out" / "b.txt").read_text() == "b.jpg\n"


@pytest.mark.parametrize("closed", [BrokenPipeError, OutputError])
def test_a_standard_output_that_takes_no_more_ends_the_call(
    closed: type[OSError], folder: Path, monkeypatch
) -> None:
    begun: list[str] = []

    def one(name: str, update: batch.Update) -> Answer:
        begun.append(name)
        return work({})(name, update)

    def refuse(data: object, *, err: bool = False, **_: object) -> None:
        if not err:
            raise closed(28, "no space left on device")

    monkeypatch.setattr("click.echo", refuse)
    both = ["a.jpg", "b.jpg"]
    with pytest.raises(closed):
        run(both, one, to=to(both, kinds=LINES), talk=TALK)
    assert begun == ["a.jpg"]


def test_an_interrupt_ends_the_call_and_keeps_what_was_written(folder: Path) -> None:
    inputs = ["a.jpg", "b.jpg", "c.jpg"]
    found = to(inputs, output="out/", json_to="facts.json")
    assert run(inputs, work({"b.jpg": KeyboardInterrupt()}), to=found, talk=TALK) == 130
    assert [path.name for path in (folder / "out").iterdir()] == ["a.txt"]
    assert len((folder / "facts.json").read_text().splitlines()) == 1


def test_a_check_that_says_no_writes_its_answer_all_the_same(folder: Path, capsys) -> None:
    assert run(["a.jpg"], work({}, {"a.jpg": 1}), to=to(["a.jpg"], output="a.txt"), talk=TALK) == 1
    assert (folder / "a.txt").exists() and "a.jpg: it is wrong" in capsys.readouterr().err


def test_facts_are_an_object_a_line_each_or_a_file_each(folder: Path, capsys) -> None:
    assert run(["a.jpg"], work({}), to=to(["a.jpg"], json_to="one.json"), talk=TALK) == 0
    assert json.loads((folder / "one.json").read_text()) == {"n": 1}
    both = ["a.jpg", "b.jpg"]
    found = to(both, json_to="-")
    capsys.readouterr()
    assert run(both, work({"b.jpg": FileError("gone")}), to=found, talk=TALK) == 6
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines == [{"image": "a.jpg", "n": 1}, {"image": "b.jpg", "error": "gone", "code": 3}]
    assert run(both, work({}), to=to(both, output="out/", json_to="facts/"), talk=TALK) == 0
    assert sorted(path.name for path in (folder / "facts").iterdir()) == ["a.json", "b.json"]


def test_lines_of_text_follow_one_another(folder: Path, capsys) -> None:
    both = ["a.jpg", "b.jpg"]
    assert run(both, work({}), to=to(both, kinds=LINES), talk=TALK) == 0
    assert capsys.readouterr().out == "a.jpg\nb.jpg\n"
    assert run(both, work({}), to=to(both, kinds=LINES, output="all.txt"), talk=TALK) == 0
    assert (folder / "all.txt").read_text() == "a.jpg\nb.jpg\n"


def test_files_in_a_folder_are_called_as_their_inputs(folder: Path) -> None:
    found = to(["a.jpg", "x/a.png", "-"], output="out/")
    assert found.answers == ("out/a.jpg.txt", "out/a.png.txt", "out/stdin.txt")
    with pytest.raises(UsageError, match=r"both be written to a\.jpg\.txt"):
        to(["a.jpg", "x/a.jpg"], output="out/")


def test_an_input_is_never_written_over(folder: Path) -> None:
    (folder / "note.txt").write_text("mine")
    for output, json_to in (("note.txt", None), (".", None), (None, "note.txt")):
        with pytest.raises(UsageError, match="is read here"):
            to(["note.txt"], output=output, json_to=json_to, force=True)
    (folder / "link.txt").symlink_to("note.txt")
    with pytest.raises(UsageError, match="is read here"):
        to(["note.txt"], output="link.txt", force=True)


@pytest.mark.parametrize(
    ("given", "inputs", "said"),
    [
        ({}, 2, "need -o FOLDER/"),
        ({"output": "a.txt"}, 2, "need -o FOLDER/"),
        ({"output": "a.xls"}, 1, "cannot tell the kind"),
        ({"output": "a.txt", "json_to": "a.txt"}, 1, "both be written"),
        ({"output": "gone/a.txt"}, 1, "no folder"),
        ({"json_to": "facts/"}, 2, "need -o FOLDER/"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_work(given: dict, inputs: int, said: str) -> None:
    with pytest.raises((UsageError, FileError), match=said):
        to(["a.jpg", "b.jpg"][:inputs], **given)

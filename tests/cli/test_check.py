"""`p3i check`: findings on stdout, exit codes, inputs of every kind."""

import io
import json
import sys
from pathlib import Path

import pytest

from p3i.cli.main import run

GOOD = (
    "SetCameraPose(rx=0, ry=0)\nfor i in range(0, 3):\n    for j in range(0, 3):\n"
    "        Draw(x=10*i, y=10*j)\n"
)
ODD = "Draw(x=1, y=2)\n"
BAD = "for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (("good", GOOD), ("odd", ODD), ("bad", BAD)):
        (tmp_path / f"{name}.p3p").write_text(text)
    (tmp_path / "notes.txt").write_text("no program")
    return tmp_path


def feed(text: str | bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    data = text if isinstance(text, bytes) else text.encode()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))


def test_a_good_program_has_no_findings(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(files / "good.p3p")]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "nothing to report in 1 file\n"


def test_warnings_exit_0_and_stand_on_stdout(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(files / "odd.p3p")]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("warning[P202]: ")
    assert captured.err == "1 warning in 1 file\n"


def test_errors_exit_4_and_look_as_documented(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = files / "bad.p3p"
    assert run(["check", str(path)]) == 4
    assert capsys.readouterr().out == (
        "error[P104]: `i` is not bound here\n"
        f" --> {path}:2:15\n"
        "  |\n"
        "2 |     Draw(x=10*i, y=4*j)\n"
        "  |               ^ no enclosing `for i`\n"
        "  = help: put `for i in range(0, n):` around line 1, or write a number\n"
    )


def test_json_is_one_object_a_line_on_stdout(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "--error-format", "json", str(files)]) == 4
    captured = capsys.readouterr()
    found = [json.loads(line) for line in captured.out.splitlines()]
    assert [record["code"] for record in found] == ["P104", "P202"]
    assert found[0] == {
        "file": str(files / "bad.p3p"),
        "code": "P104",
        "severity": "error",
        "message": "`i` is not bound here",
        "label": "no enclosing `for i`",
        "help": "put `for i in range(0, n):` around line 1, or write a number",
        "start": {"line": 2, "column": 15, "offset": 36},
        "end": {"line": 2, "column": 16, "offset": 37},
    }
    assert captured.err == ""


def test_a_folder_means_its_programs_and_a_glob_its_matches(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["check", str(files)]) == 4
    assert "in 3 files" in capsys.readouterr().err
    assert run(["check", str(files / "*d.p3p")]) == 4
    assert "in 3 files" in capsys.readouterr().err


def test_stdin_is_a_dash(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    feed(BAD, monkeypatch)
    assert run(["check", "-"]) == 4
    assert " --> <stdin>:2:15\n" in capsys.readouterr().out


def test_strict_names_the_production(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "--strict", str(files / "good.p3p")]) == 4
    assert "For1Stmt -> For (i in range(Integer, Integer))" in capsys.readouterr().out


def test_a_file_that_cannot_be_read_is_3_and_the_others_are_checked(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["check", str(files / "none.p3p"), str(files / "odd.p3p")]) == 3
    captured = capsys.readouterr()
    assert "there is no file" in captured.err
    assert "P202" in captured.out


def test_bytes_that_are_no_text_are_a_finding(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    feed(b"\xff\xfe\x00", monkeypatch)
    assert run(["check", "-"]) == 4
    assert "error[P100]" in capsys.readouterr().out


def test_colour_is_for_terminals_alone(
    files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run(["check", str(files / "bad.p3p")])
    assert "\x1b" not in capsys.readouterr().out
    from p3i.cli import programs

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.delenv("NO_COLOR", raising=False)
    assert programs.coloured(Terminal())
    monkeypatch.setenv("NO_COLOR", "1")
    assert not programs.coloured(Terminal())
    assert not programs.coloured(io.StringIO())


def test_quiet_leaves_the_summary_out(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "-q", str(files / "odd.p3p")]) == 0
    assert capsys.readouterr().err == ""


def test_an_endless_device_is_refused_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "/dev/zero"]) == 3
    assert "/dev/zero is a device" in capsys.readouterr().err

"""The frame of the command line: the table of commands, errors as lines, exit codes."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import click
import pytest

from p3i import __version__, errors
from p3i.cli import main as frame
from p3i.cli.main import COMMANDS, Entry, run


def install(monkeypatch: pytest.MonkeyPatch, body) -> None:
    """Make `p3i boom` a command whose body is `body`."""
    module = ModuleType("p3i_test_boom")
    module.command = click.command("boom")(body)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "p3i_test_boom", module)
    monkeypatch.setitem(frame.COMMANDS, "boom", Entry("p3i_test_boom", "Fails as told."))


def raising(error: BaseException):
    def body() -> None:
        raise error

    return body


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_of_the_table_exists_under_its_name(name: str) -> None:
    command = importlib.import_module(COMMANDS[name].module).command
    assert isinstance(command, click.Command)
    assert command.name == name


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_error_format_and_documents_every_option(name: str) -> None:
    command = importlib.import_module(COMMANDS[name].module).command
    options = [parameter for parameter in command.params if isinstance(parameter, click.Option)]
    assert "--error-format" in {word for option in options for word in option.opts}
    assert [option.name for option in options if not option.help] == []


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    shown = capsys.readouterr().out
    for name, entry in COMMANDS.items():
        assert name in shown and entry.summary in shown


@pytest.mark.parametrize("word", ["--version", "-V"])
def test_version_is_printed(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([word]) == 0
    assert capsys.readouterr().out == f"p3i {__version__}\n"


def test_python_dash_m_is_the_command_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "p3i", "check", "missing.p3p"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 3 and done.stderr.startswith("error: ")
    assert "missing.p3p" in done.stderr


@pytest.mark.parametrize(
    ("typed", "offered"), [("p3i sy", {"synth"}), ("p3i synth --structure c", {"circular"})]
)
def test_the_shell_completes_commands_and_choices(typed: str, offered: set[str]) -> None:
    asked = {"_P3I_COMPLETE": "bash_complete", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    done = subprocess.run(
        [sys.executable, "-m", "p3i.cli.main"],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert {line.rpartition(",")[2] for line in done.stdout.split()} == offered


def test_no_words_print_the_help_and_count_as_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and "Commands:" in captured.err


def test_an_unknown_command_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sinth"]) == 2
    assert "did you mean `p3i synth`?" in capsys.readouterr().err


def test_an_unknown_option_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["synth", "a.jpg", "--wrong"]) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ") and "--wrong" in message and message.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.UsageError("two options quarrel"), 2),
        (errors.FileError("there is no file a.jpg"), 3),
        (errors.ProgramError("the program draws nothing"), 4),
        (errors.NoPatternError("no regular pattern"), 5),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else "",
)
def test_an_error_on_purpose_is_one_line_with_its_exit_code(
    error: errors.P3IError, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install(monkeypatch, raising(error))
    assert run(["boom"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"error: {error}\n"


def test_error_format_json_prints_one_object_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["synth", "--error-format", "json", "a.jpg", "--structure", "spiral"]) == 2
    found = json.loads(capsys.readouterr().err)
    assert found["code"] == 2 and "spiral" in found["error"]


def test_wrong_usage_is_json_too_where_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["synth", "--error-format=json", "--wrong"]) == 2
    assert json.loads(capsys.readouterr().err)["code"] == 2


def test_a_bug_is_one_line_and_70(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("P3I_DEBUG", raising=False)
    install(monkeypatch, raising(ZeroDivisionError("division by\nzero")))
    assert run(["boom"]) == 70
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "ZeroDivisionError: division by zero" in message and "P3I_DEBUG=1" in message


def test_p3i_debug_shows_the_traceback_of_a_bug(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("P3I_DEBUG", "1")
    install(monkeypatch, raising(ZeroDivisionError("division by zero")))
    assert run(["boom"]) == 70
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_an_interrupt_is_130(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    install(monkeypatch, raising(KeyboardInterrupt()))
    assert run(["boom"]) == 130
    assert capsys.readouterr().err == "error: interrupted\n"


@pytest.mark.parametrize(("returned", "code"), [(None, 0), (6, 6), (True, 0), ("text", 0)])
def test_what_a_command_returns_is_the_exit_code_if_it_is_a_number(
    returned: object, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, lambda: returned)
    assert run(["boom"]) == code


def test_ctx_exit_and_sys_exit_keep_their_code(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, lambda: click.get_current_context().exit(1))
    assert run(["boom"]) == 1
    install(monkeypatch, lambda: sys.exit(4))
    assert run(["boom"]) == 4


def test_a_closed_pipe_is_quiet() -> None:
    script = "import sys; from p3i.cli.main import run; sys.exit(run(['--help']))"
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-c", script], stdout=write, stderr=subprocess.PIPE, timeout=60)
    os.close(write)
    assert done.stderr == b""
    assert done.returncode == 141


def test_no_color_and_pipes_keep_colour_away(monkeypatch: pytest.MonkeyPatch) -> None:
    from p3i.cli import report

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert report.coloured()
    monkeypatch.setenv("NO_COLOR", "1")
    assert not report.coloured()

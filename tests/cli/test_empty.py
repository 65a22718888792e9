"""No argument and no option of any command may be empty: as a path it would mean the working folder."""

import importlib
import os
from pathlib import Path

import click
import pytest

from p3i.cli.main import COMMANDS, run

PROGRAM = "SetCameraPose(rx=0, ry=0)\nfor i in range(0, 3):\n    Draw(x = 9*i, y=9*i)\n"


def commands() -> dict[str, click.Command]:
    return {name: importlib.import_module(entry.module).command for name, entry in COMMANDS.items()}


def takes_text(param: click.Parameter) -> bool:
    """Whether a parameter takes a text that is not one of a few words or a number: a path, or the like."""
    if isinstance(param, click.Option) and (param.is_flag or param.count):
        return False
    return not isinstance(param.type, click.Choice | click.types.IntParamType | click.types.FloatParamType)


def calls() -> list[list[str]]:
    """For each text of each command, a call in which it is empty and all else is there."""
    found = []
    for name, command in commands().items():
        arguments = [param for param in command.params if isinstance(param, click.Argument)]
        for param in filter(takes_text, command.params):
            words = [name]
            if isinstance(param, click.Option):
                words += [max(param.opts, key=len), ""]
            words += ["" if one is param else f"{one.name}.x" for one in arguments]
            found.append(words)
    return found


def test_the_calls_cover_the_known_dangers() -> None:
    assert ["fmt", ""] in calls() and ["examples", ""] in calls()
    assert ["synth", "--mask", "", "images.x"] in calls() and ["synth", "--output", "", "images.x"] in calls()


@pytest.mark.parametrize("words", calls(), ids=lambda words: " ".join(word or "EMPTY" for word in words))
def test_an_empty_text_is_wrong_usage_that_names_its_place(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.p3p").write_text(PROGRAM)
    assert run(words) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: Invalid value for ") and said.count("\n") == 1
    assert "empty" in said or "''" in said
    if words[1].startswith("--"):
        assert words[1] in said
    assert Path("a.p3p").read_text() == PROGRAM and os.listdir() == ["a.p3p"]

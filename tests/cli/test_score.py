"""The shell of `p3i score`, around an evaluation with known numbers."""

import json
import sys
import types
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from p3i.cli.main import run
from p3i.search.config import SearchConfig

TEXT = """\
SetCameraPose(rx=0, ry=0)
for i in range(0, 3):
    for j in range(0, 3):
        Draw(x=9*i, y=9*j)
"""


@dataclass(frozen=True)
class Evaluation:
    equation2: float
    edges: int
    agreement: float
    objects: int = 9
    notes: tuple[str, ...] = ()


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple]:
    """A photo and a program in the working folder, and an evaluation that lists what it was asked."""
    calls: list[tuple] = []

    def evaluate(image, program, config) -> Evaluation:
        calls.append((image.size, program, config))
        return Evaluation(equation2=12.3456789, edges=12, agreement=0.654321)

    module = types.ModuleType("p3i.search.judge.evaluate")
    module.evaluate = evaluate  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "p3i.search.judge.evaluate", module)
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("a.png", np.zeros((48, 64, 3), np.uint8))
    Path("a.p3p").write_text(TEXT)
    return calls


def test_both_measures_are_printed_with_their_sense(asked, capsys) -> None:
    assert run(["score", "a.png", "a.p3p"]) == 0
    assert capsys.readouterr().out == (
        "agreement   0.6543   of the objects with each other; more is better\n"
        "equation 2  12.3457   over 12 edges, as printed; less is better\n"
    )


def test_json_holds_the_numbers_in_full(asked, capsys) -> None:
    assert run(["score", "a.png", "a.p3p", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "image": "a.png",
        "program": "a.p3p",
        "equation2": 12.3456789,
        "edges": 12,
        "agreement": 0.654321,
        "features": "oriented",
    }


def test_options_arrive_at_the_evaluation(asked) -> None:
    import p3i

    run(["score", "a.png", "a.p3p", "--features", "rgb", "--focal", "28"])
    size, program, config = asked[0]
    assert (size.width, size.height) == (64, 48)
    assert program == p3i.loads(TEXT)
    assert config == SearchConfig(features="rgb", focal_mm=28.0)


def test_a_program_with_errors_is_shown_with_its_places_and_4(asked, capsys) -> None:
    Path("b.p3p").write_text("Draw(x=10*k, y=0)\n")
    assert run(["score", "a.png", "b.p3p"]) == 4
    message = capsys.readouterr().err
    assert message.startswith("error[P") and "--> b.p3p:1:" in message


@pytest.mark.parametrize("words", [["gone.png", "a.p3p"], ["a.png", "gone.p3p"]], ids=" ".join)
def test_a_missing_file_is_3(words: list[str], asked, capsys) -> None:
    assert run(["score", *words]) == 3
    assert "gone" in capsys.readouterr().err

"""`p3i expand`: every draw, in three formats."""

import io
import json
import sys
from pathlib import Path

import pytest

from p3i.cli.main import run

RING = "for i in range(1, 3):\n    for j in range(0, 2):\n        Draw(x=10*i*Cos(180*j), y=i + 0.1)\n"


@pytest.fixture
def ring(tmp_path: Path) -> str:
    path = tmp_path / "ring.p3p"
    path.write_text(RING)
    return str(path)


def test_the_default_is_a_table(ring: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["expand", ring]) == 0
    assert capsys.readouterr().out == (
        "i  j    x    y\n1  0   10  1.1\n1  1  -10  1.1\n2  0   20  2.1\n2  1  -20  2.1\n"
    )


def test_csv_reads_back_exactly(ring: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["expand", "--format", "csv", ring]) == 0
    assert capsys.readouterr().out == "i,j,x,y\n1,0,10,1.1\n1,1,-10,1.1\n2,0,20,2.1\n2,1,-20,2.1\n"


def test_json_is_one_document(ring: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["expand", "--format", "json", ring]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found[1] == {"i": 1, "j": 1, "x": -10.0, "y": 1.1}
    assert len(found) == 4


def test_a_program_that_draws_nothing_gives_an_empty_list(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for form, text in (("text", "i  j  x  y\n"), ("csv", "i,j,x,y\n"), ("json", "[]\n")):
        source = b"for i in range(0, 0):\n    Draw(x=i, y=2)\n"
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(source)))
        assert run(["expand", "-", "--format", form]) == 0
        assert capsys.readouterr().out == text


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n", "P104"),
        ("for j in range(0, 1000000000):\n    Draw(x=1, y=4*j)\n", "P122"),
        ("for j in range(0, 3):\n    Draw(x=??, y=4*j)\n", "P116"),
    ],
)
def test_what_cannot_be_expanded_is_4_with_its_place(
    text: str, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.p3p"
    path.write_text(text)
    assert run(["expand", str(path)]) == 4
    message = capsys.readouterr().err
    assert f"error[{code}]" in message and f" --> {path}:" in message
    assert run(["expand", "--error-format", "json", str(path)]) == 4
    assert json.loads(capsys.readouterr().err)["code"] == code


def test_a_missing_file_is_3(tmp_path: Path) -> None:
    assert run(["expand", str(tmp_path / "none.p3p")]) == 3


def test_the_one_program_may_come_from_a_list_a_glob_or_a_folder(
    ring: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(ring).parent
    (folder / "list.txt").write_text(f"{ring}\n")
    assert run(["expand", ring]) == 0
    shown = capsys.readouterr().out
    for word in (f"@{folder}/list.txt", f"{folder}/r*.p3p", str(folder)):
        assert run(["expand", word]) == 0
        assert capsys.readouterr().out == shown
    (folder / "another.p3p").write_text(RING)
    assert run(["expand", str(folder)]) == 2
    assert "2 programs" in capsys.readouterr().err

"""`p3i fmt`: in place, whole or not at all, and never another meaning."""

import io
import os
import sys
from pathlib import Path

import pytest

from p3i import language
from p3i.cli.main import run

LOOSE = "for i in range(3):\n  For (j in range(0, 2)) { draw(y=10*j, x=i*10) }  # note\n"
CANONICAL = (
    "SetCameraPose(rx=0, ry=0)\nfor i in range(0, 3):\n    for j in range(0, 2):\n"
    "        # note\n        Draw(x=10*i, y=10*j)\n"
)
STRICT = (
    "SetCameraPose(rx=0, ry=0);\nFor (i in range(0, 3)) { For (j in range(0, 2)) "
    "{ Draw(x=10 * i + 0 * j, y=0 * i + 10 * j) } }\n"
)
BAD = "for i in range(3) Draw(x=i, y=j)\n"


@pytest.fixture
def loose(tmp_path: Path) -> Path:
    path = tmp_path / "loose.p3p"
    path.write_text(LOOSE)
    return path


def test_a_file_is_rewritten_in_place(loose: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fmt", str(loose)]) == 0
    assert loose.read_bytes() == CANONICAL.encode()
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "rewritten" in captured.err
    assert os.listdir(loose.parent) == ["loose.p3p"]


def test_a_canonical_file_is_not_touched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.p3p"
    path.write_bytes(CANONICAL.encode())
    os.utime(path, (1, 1))
    assert run(["fmt", str(path)]) == 0
    assert path.stat().st_mtime == 1
    assert capsys.readouterr().err == ""


def test_permissions_and_links_stay(loose: Path) -> None:
    loose.chmod(0o640)
    link = loose.with_name("link.p3p")
    link.symlink_to(loose)
    assert run(["fmt", str(link)]) == 0
    assert link.is_symlink()
    assert loose.read_text() == CANONICAL
    assert loose.stat().st_mode & 0o777 == 0o640


def test_check_writes_nothing_and_exits_1(loose: Path) -> None:
    assert run(["fmt", "--check", str(loose)]) == 1
    assert loose.read_text() == LOOSE
    run(["fmt", str(loose)])
    assert run(["fmt", "--check", str(loose)]) == 0


def test_diff_shows_what_would_change_and_writes_nothing(
    loose: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["fmt", "--diff", str(loose)]) == 0
    shown = capsys.readouterr().out
    assert "-for i in range(3):\n" in shown and "+for i in range(0, 3):\n" in shown
    assert loose.read_text() == LOOSE
    assert run(["fmt", "--diff", "--check", str(loose)]) == 1


def test_stdin_goes_to_stdout(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(LOOSE.encode())))
    assert run(["fmt", "-"]) == 0
    assert capsys.readouterr().out == CANONICAL


def test_layout_table1_and_back(loose: Path) -> None:
    loose.write_text(LOOSE.replace("  # note", ""))
    assert run(["fmt", "--layout", "table1", str(loose)]) == 0
    assert loose.read_text() == STRICT
    assert run(["fmt", "--strict", "--check", str(loose)]) == 0
    assert run(["fmt", "--layout", "python", str(loose)]) == 0
    assert loose.read_text() == CANONICAL.replace("        # note\n", "")


def test_strict_with_layout_python_is_wrong_usage(loose: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fmt", "--strict", "--layout", "python", str(loose)]) == 2
    assert "table1" in capsys.readouterr().err
    assert loose.read_text() == LOOSE


def test_strict_refuses_what_is_not_spelt_as_in_table_1(
    loose: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["fmt", "--strict", str(loose)]) == 4
    assert "error[P302]" in capsys.readouterr().err
    assert loose.read_text() == LOOSE


def test_layout_table1_names_every_place_outside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.p3p"
    path.write_text(CANONICAL.replace("10*i", "10*i + 1").replace("10*j", "10*j + 2"))
    assert run(["fmt", "--layout", "table1", str(path)]) == 4
    assert capsys.readouterr().err.count("error[P301]") == 2


def test_a_file_with_errors_stays_and_the_others_are_formatted(
    loose: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = loose.with_name("bad.p3p")
    bad.write_text(BAD)
    assert run(["fmt", str(bad), str(loose)]) == 4
    assert bad.read_text() == BAD
    assert loose.read_text() == CANONICAL
    assert f" --> {bad}:1:" in capsys.readouterr().err


def test_sketches_are_formatted_too(tmp_path: Path) -> None:
    path = tmp_path / "ring.p3p"
    path.write_text("for j in range(?n(4,24)): Draw(x=?r*Cos(360/?n*j), y=?r*Sin(360/?n*j))")
    assert run(["fmt", str(path)]) == 0
    assert path.read_text().splitlines()[1:] == [
        "for j in range(0, ?n(4, 24)):",
        "    Draw(x=?r*Cos(360/?n*j), y=?r*Sin(360/?n*j))",
    ]
    assert run(["fmt", "--layout", "table1", str(path)]) == 2


def test_a_file_that_may_not_be_written_is_3(loose: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write everything, so ask for no
    assert run(["fmt", str(loose)]) == 3
    assert loose.read_text() == LOOSE


def test_a_printer_that_changes_the_meaning_never_reaches_the_file(
    loose: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    honest = language.format_sketch
    monkeypatch.setattr(language, "format_sketch", lambda sketch: honest(sketch).replace("10*i", "11*i"))
    assert run(["fmt", str(loose)]) == 70
    assert "changed the meaning" in capsys.readouterr().err
    assert loose.read_text() == LOOSE


def test_a_printer_that_loses_a_comment_never_reaches_the_file(
    loose: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = language.format_sketch
    monkeypatch.setattr(
        language, "format_sketch", lambda sketch: honest(sketch).replace("        # note\n", "")
    )
    assert run(["fmt", str(loose)]) == 70
    assert loose.read_text() == LOOSE

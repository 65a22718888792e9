"""The golden files: a folder of cases each, where a new case is a new file.

programs/NAME.p3p   canonical text: it formats to itself and has no errors
formats/NAME.p3p    text in another spelling; NAME.out is what `fmt` makes of it
meaning/NAME.p3p    a program; NAME.csv lists what it draws: the settled meaning, line by line
errors/NAME.p3p     a faulty or odd program; NAME.txt is the report (NAME.strict.p3p: in strict mode)
"""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import p3i
from p3i.grammar.ast import Program
from p3i.grammar.diagnostics import CODES, Diagnostic
from p3i.grammar.layout import source_text
from p3i.grammar.parser import parse
from p3i.grammar.report import report_human

GOLDEN = Path(__file__).parent.parent / "golden"
Golden = Callable[[Path, str], None]


def has_errors(found: tuple[Diagnostic, ...]) -> bool:
    return "error" in {one.severity for one in found}


def cases(folder: str) -> list[Path]:
    found = sorted((GOLDEN / folder).glob("*.p3p"))
    assert found
    return found


def named(path: Path) -> str:
    return path.stem


@pytest.mark.parametrize("path", cases("programs"), ids=named)
def test_a_canonical_program_formats_to_itself(path: Path) -> None:
    text = path.read_bytes().decode()
    assert p3i.format(text) == text
    assert not has_errors(p3i.check(text))


@pytest.mark.parametrize("path", cases("formats"), ids=named)
def test_format_gives_the_canonical_text(path: Path, golden: Golden) -> None:
    source = path.read_bytes()
    text = p3i.format(source)
    golden(path.with_suffix(".out"), text)
    assert re.findall(r"# \w+", text) == re.findall(r"# \w+", source.decode()), "comments keep their order"
    assert p3i.format(text) == text


@pytest.mark.parametrize("ending", ["\r\n", "\r", "\n\n", "   \n"])
@pytest.mark.parametrize("path", cases("programs"), ids=named)
def test_other_line_ends_mean_the_same(path: Path, ending: str) -> None:
    text = path.read_bytes().decode()
    other = text.replace("\n", ending) if "///" not in text or ending != "\n\n" else text
    assert p3i.format(other) == text
    assert p3i.format(other.rstrip()) == text


@pytest.mark.parametrize("path", cases("errors"), ids=named)
def test_a_faulty_program_is_reported_so(path: Path, golden: Golden) -> None:
    source = path.read_bytes()
    found = p3i.check(source, strict=path.stem.endswith(".strict"))
    assert found
    golden(path.with_suffix(".txt"), report_human(found, source=source_text(source), path=path.name))


@pytest.mark.parametrize("path", cases("errors"), ids=named)
def test_check_and_parse_agree_on_what_is_an_error(path: Path) -> None:
    source = path.read_bytes()
    strict = path.stem.endswith(".strict")
    found = p3i.check(source, strict=strict)
    parsed = parse(source, strict=strict)
    if not isinstance(parsed, Program):
        assert has_errors(found)
    elif has_errors(found):
        assert {finding.code for finding in found if finding.severity == "error"} <= {"P122", "P123"}


def test_every_code_occurs_in_a_golden_report() -> None:
    reports = "".join(path.read_text(encoding="utf-8") for path in (GOLDEN / "errors").glob("*.txt"))
    missing = [code for code in CODES if f"[{code}]" not in reports]
    assert missing == ["P120"]  # the text that is too long is made in test_parser.py


@pytest.mark.parametrize("path", cases("meaning"), ids=named)
def test_a_program_draws_these_points(path: Path, golden: Golden) -> None:
    points = p3i.expand(path.read_bytes())
    lines = [f"{i},{j},{round(x, 9) + 0.0:.9g},{round(y, 9) + 0.0:.9g}" for x, y, i, j in points]
    golden(path.with_suffix(".csv"), "\n".join(["i,j,x,y", *lines]) + "\n")

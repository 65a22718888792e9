"""The examples in docs/language.md and docs/errors.md do what the text beside them says."""

import re
from pathlib import Path

import pytest

import p3i
from p3i.grammar import limits
from p3i.grammar.diagnostics import CODES, Diagnostic

DOCS = Path(__file__).parent.parent.parent / "docs"
LANGUAGE = (DOCS / "language.md").read_text(encoding="utf-8")
ERRORS = (DOCS / "errors.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```p3p\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SECTIONS = dict(re.findall(r"^### (P\d{3}): (.*?)(?=^##|\Z)", ERRORS, re.MULTILINE | re.DOTALL))
EXAMPLES = [(code, example) for code, text in SECTIONS.items() for example in BLOCK.findall(text)]
# Bytes that are no text, a sketch (of which `check` does not complain), and texts beyond a limit.
WITHOUT_EXAMPLE = ["P100", "P116", "P120", "P121"]


def has_errors(found: tuple[Diagnostic, ...]) -> bool:
    return "error" in {one.severity for one in found}


@pytest.mark.parametrize("example", BLOCK.findall(LANGUAGE))
def test_an_example_of_the_language_is_canonical_and_without_findings(example: str) -> None:
    assert p3i.check(example) == ()
    assert p3i.format(example) == example


def test_every_code_has_its_section_in_order_and_an_example() -> None:
    assert list(SECTIONS) == list(CODES)
    without = [code for code in CODES if code not in dict(EXAMPLES)]
    assert without == WITHOUT_EXAMPLE
    assert len(BLOCK.findall(LANGUAGE)) >= 5


@pytest.mark.parametrize(("code", "example"), EXAMPLES, ids=[code for code, _ in EXAMPLES])
def test_an_example_of_a_code_is_reported_under_it(code: str, example: str) -> None:
    found = [finding for finding in p3i.check(example, strict=code.startswith("P3")) if finding.code == code]
    assert found
    assert has_errors(found) == ("(warning)" not in SECTIONS[code])


def test_the_report_in_the_text_is_the_report(tmp_path: Path) -> None:
    found = p3i.check("for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n")
    from p3i.grammar.report import report_human

    source = "for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n"
    shown = report_human(found, source=source, path="row.p3p")
    assert "".join(f"    {line}\n" for line in shown.splitlines()) in ERRORS


def test_the_limits_in_the_text_are_the_limits() -> None:
    for limit in (limits.SOURCE, limits.NESTING, limits.DRAWS):
        assert re.search(rf"\| {limit.default:,} \| `{limit.variable}`", LANGUAGE)

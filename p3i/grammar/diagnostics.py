"""What p3i has to say about a program, as data. grammar/report.py turns it into prose or JSON."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from p3i.grammar.ast import Span

Severity = Literal["error", "warning"]

CODES: dict[str, str] = {
    # Text
    "P100": "the file is not UTF-8 text",
    "P101": "something is missing or out of place",
    "P102": "a character that has no place in a program",
    "P103": "indentation",
    "P104": "a variable that no loop binds",
    "P105": "an unbound `i` reads as 1",
    "P106": "a coordinate, guard or bound that is not affine",
    "P107": "a name that the language does not know",
    "P108": "an argument that is missing, unknown or given twice",
    "P109": "a number that cannot be used",
    "P110": "Cos or Sin where it cannot stand",
    "P111": "the order and number of statements",
    "P112": "loops that stand in the wrong order, or twice",
    "P113": "a bound of `for i` that is not a whole number",
    "P114": "an operator that the language does not have",
    "P115": "a picture path that cannot be read",
    "P116": "a hole in a program",
    "P117": "a hole that cannot be filled",
    "P118": "the header block",
    "P119": "an unknown key of the header",
    # Limits
    "P120": "a text that is too long",
    "P121": "nesting that is too deep",
    "P122": "loops that turn too often",
    "P123": "a coordinate that overflows",
    # Meaning
    "P201": "nothing is drawn",
    "P202": "all points lie on one line",
    "P203": "draws that coincide",
    "P204": "points at or behind the camera",
    "P205": "radii that differ between x and y",
    "P206": "angles that differ between x and y",
    # Strict mode
    "P301": "the program leaves Table 1",
    "P302": "the text is not spelt as in Table 1",
}
"""Every code with its subject; docs/errors.md explains each. A code is never reused."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding: a sentence that stands alone, the place, a label for the place, and help to paste."""

    code: str
    severity: Severity
    message: str
    span: Span | None = None
    help: str | None = None
    label: str | None = None

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise ValueError(f"{self.code} is not a documented code")


def error(
    code: str, message: str, span: Span | None, *, help: str | None = None, label: str | None = None
) -> Diagnostic:
    """A diagnostic of severity "error"."""
    return Diagnostic(code, "error", message, span, help, label)


def warning(
    code: str, message: str, span: Span | None, *, help: str | None = None, label: str | None = None
) -> Diagnostic:
    """A diagnostic of severity "warning"."""
    return Diagnostic(code, "warning", message, span, help, label)


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """The diagnostics in the order of the text, each once; those without a place come first."""
    unique = dict.fromkeys(diagnostics)
    return tuple(sorted(unique, key=lambda found: found.span.start if found.span else -1))

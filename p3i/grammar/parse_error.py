"""The error that a text with findings is refused by; it can show them, so it stands above report.py."""

from functools import partial
from typing import Any

from p3i.errors import ProgramError
from p3i.grammar.diagnostics import Diagnostic
from p3i.grammar.report import one_line, report_human, report_json


class ParseError(ProgramError):
    """A text is not a program, or its program cannot be walked.

    `diagnostics` hold all that was found, `source` and `path` what was read; `report` quotes the text.
    """

    def __init__(
        self, diagnostics: tuple[Diagnostic, ...], *, source: str = "", path: str = "<program>"
    ) -> None:
        self.diagnostics = diagnostics
        self.source = source
        self.path = path
        super().__init__(diagnostics, source, path)

    def __reduce__(self) -> tuple[Any, ...]:
        """How it goes to another process, where a photo was searched."""
        return partial(ParseError, source=self.source, path=self.path), (self.diagnostics,)

    def __str__(self) -> str:
        """The first error in one line, and how many more there are."""
        return one_line(self.diagnostics, source=self.source, path=self.path)

    def report(self, *, as_json: bool = False, color: bool = False) -> str:
        """All findings as `p3i check` prints them, lines included."""
        if as_json:
            return report_json(self.diagnostics, source=self.source, path=self.path)
        return report_human(self.diagnostics, source=self.source, path=self.path, color=color)

"""The one place where diagnostics become text: for people (with the line and a caret) and as JSON.

The layout for people is that of DESIGN.md section 6. Nothing that a program's text holds can disturb the
terminal: control characters are shown as U+FFFD, and wide characters count as two columns.
"""

import json
import unicodedata
from collections.abc import Iterable, Sequence

from p3i.grammar.ast import Span
from p3i.grammar.diagnostics import Diagnostic
from p3i.grammar.source import line_and_column, line_starts

_COLOURS = {
    "error": "\x1b[1;31m",
    "warning": "\x1b[1;33m",
    "quiet": "\x1b[1;34m",
    "bold": "\x1b[1m",
    "end": "\x1b[0m",
}
_LONGEST_LINE = 160


def report_human(
    diagnostics: Iterable[Diagnostic], *, source: str, path: str = "<program>", color: bool = False
) -> str:
    """All diagnostics for a reader, a blank line between two; ends with a newline unless there are none."""
    starts = line_starts(source)
    blocks = [_block(found, source=source, starts=starts, path=path, color=color) for found in diagnostics]
    return "\n".join(blocks)


def report_json(diagnostics: Iterable[Diagnostic], *, source: str, path: str = "<program>") -> str:
    """All diagnostics as JSON, one object a line: file, code, severity, message, label, help, start, end.

    `line` and `column` count from 1 in characters, `offset` from 0; all null where a finding has no place.
    """
    starts = line_starts(source)
    lines: list[str] = []
    for found in diagnostics:
        record = {
            "file": path,
            "code": found.code,
            "severity": found.severity,
            "message": found.message,
            "label": found.label,
            "help": found.help,
            "start": _place(found.span.start, starts) if found.span else None,
            "end": _place(found.span.end, starts) if found.span else None,
        }
        lines.append(json.dumps(record) + "\n")
    return "".join(lines)


def one_line(diagnostics: Sequence[Diagnostic], *, source: str, path: str) -> str:
    """The first error (or finding) in one line with its place, and how many more there are."""
    first = next((found for found in diagnostics if found.severity == "error"), None) or diagnostics[0]
    place = path
    if first.span is not None and source:
        line, column = line_and_column(first.span.start, line_starts(source))
        place = f"{path}:{line}:{column}"
    more = f" (and {len(diagnostics) - 1} more)" if len(diagnostics) > 1 else ""
    return printable(f"{place}: {first.code}: {first.message}{more}")


def _place(offset: int, starts: list[int]) -> dict[str, int]:
    line, column = line_and_column(offset, starts)
    return {"line": line, "column": column, "offset": offset}


def _block(found: Diagnostic, *, source: str, starts: list[int], path: str, color: bool) -> str:
    def paint(text: str, colour: str) -> str:
        return f"{_COLOURS[colour]}{text}{_COLOURS['end']}" if color else text

    head = paint(f"{found.severity}[{found.code}]", found.severity) + paint(
        f": {printable(found.message)}", "bold"
    )
    if found.span is None:
        lines = [head, paint(" --> ", "quiet") + printable(path)]
        gutter = " "
    else:
        number, column = line_and_column(found.span.start, starts)
        gutter = " " * len(str(number))
        bar = paint(f"{gutter} |", "quiet")
        shown, carets = _line_with_carets(found.span, source=source, starts=starts)
        label = f" {printable(found.label)}" if found.label else ""
        lines = [
            head,
            paint(f"{gutter}--> ", "quiet") + f"{printable(path)}:{number}:{column}",
            bar,
            (paint(f"{number} |", "quiet") + f" {shown}").rstrip(),
            bar + " " + carets.replace("^", paint("^", found.severity)) + paint(label, found.severity)
            if color
            else f"{bar} {carets}{label}",
        ]
    if found.help:
        lines.append(paint(f"{gutter} = ", "quiet") + f"help: {printable(found.help)}")
    return "\n".join(lines) + "\n"


def _line_with_carets(span: Span, *, source: str, starts: list[int]) -> tuple[str, str]:
    """The source line that holds the span's start, and the spaces and carets that underline the span."""
    line, _ = line_and_column(span.start, starts)
    begin = starts[line - 1]
    end = starts[line] if line < len(starts) else len(source)
    text = source[begin:end].rstrip("\r\n")
    first = span.start - begin
    last = max(first + 1, min(span.end - begin, len(text)))
    left = 0
    if len(text) > _LONGEST_LINE:
        left = max(0, first - _LONGEST_LINE // 2)
        text = text[left : left + _LONGEST_LINE]
        first, last = first - left, max(first - left + 1, min(last - left, len(text)))
    before = printable(text[:first])
    under = printable(text[first:last])
    return printable(text), " " * _columns(before) + "^" * max(1, _columns(under))


def printable(text: str) -> str:
    """`text` safe for a terminal: tabs as four spaces, other control and unencodable characters as U+FFFD."""
    return "".join(
        "    "
        if character == "\t"
        else "\N{REPLACEMENT CHARACTER}"
        if unicodedata.category(character) in {"Cc", "Cf", "Cs", "Zl", "Zp"}
        else character
        for character in text
    )


def _columns(text: str) -> int:
    """How many terminal columns the text takes."""
    return sum(
        0 if unicodedata.combining(character) else 2 if unicodedata.east_asian_width(character) in "WF" else 1
        for character in text
    )


def summary(*, errors: int, warnings: int, inputs: int) -> str:
    """How many findings in how many files, in one line."""
    parts = [_counted(errors, "error")] if errors else []
    parts += [_counted(warnings, "warning")] if warnings else []
    return f"{', '.join(parts) or 'nothing to report'} in {_counted(inputs, 'file')}"


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"

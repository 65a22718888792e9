"""What `check`, `fmt` and `expand` share: their inputs, and diagnostics on a stream."""

import os
import sys
from collections.abc import Iterable, Iterator
from typing import TextIO

import click

from p3i import language
from p3i.cli import report
from p3i.cli.inputs import listed
from p3i.errors import P3IError
from p3i.files import gather
from p3i.grammar.parse_error import ParseError

SUFFIXES = frozenset({".p3p"})
STDIN = "-"


def sources(words: Iterable[str], *, as_json: bool) -> Iterator[tuple[str, bytes] | P3IError]:
    """Each input as (name, bytes), `-` is stdin. What cannot be read is reported, and given as its error."""
    for word in words:
        try:
            paths = (
                [STDIN]
                if word == STDIN
                else [str(path) for path in gather(listed([word]), suffixes=SUFFIXES)]
            )
        except P3IError as error:
            report.p3i_error(error, as_json=as_json)
            yield error
            continue
        for path in paths:
            try:
                yield path, stdin() if path == STDIN else language.read(path)
            except P3IError as error:
                report.p3i_error(error, as_json=as_json)
                yield error


def read(word: str) -> bytes:
    """The bytes of one input, `-` being stdin. Raises FileError."""
    return stdin() if word == STDIN else language.read(word)


def stdin() -> bytes:
    """Standard input, as far as a program's text may reach."""
    return language.read(STDIN)


def shown(path: str) -> str:
    """An input's name in messages."""
    return "<stdin>" if path == STDIN else path


def write_out(text: str) -> None:
    """Write a result to stdout, in UTF-8 whatever the locale says."""
    click.echo(text.encode("utf-8", errors="replace"), nl=False)


def write_errors(error: ParseError, *, as_json: bool) -> int:
    """Report every finding of a text on stderr; returns the exit code."""
    text = error.report(as_json=as_json, color=coloured(sys.stderr))
    click.echo(text.encode("utf-8", errors="replace"), nl=False, err=True)
    return error.exit_code


def coloured(stream: TextIO) -> bool:
    """Whether `stream` may carry colour: a terminal, and NO_COLOR unset or empty (no-color.org)."""
    return stream.isatty() and not os.environ.get("NO_COLOR")

"""What `check`, `fmt` and `expand` share: their inputs, and diagnostics on a stream."""

import os
import sys
from collections.abc import Iterable, Iterator
from typing import TextIO

import click

from p3i.carried import read_source
from p3i.cli import report
from p3i.cli.inputs import PROGRAMS, files
from p3i.errors import FileError, P3IError, UsageError
from p3i.grammar.parse_error import ParseError

STDIN = "-"


def sources(
    words: Iterable[str], *, as_json: bool, in_place: bool = False
) -> Iterator[tuple[str, bytes] | P3IError]:
    """Each input as (name, its text), `-` is stdin. What cannot be read is reported, and given as its error.

    Of a drawing the text is the one that it carries; such a file is refused where texts change `in_place`.
    """
    for word in words:
        try:
            paths = (STDIN,) if word == STDIN else files([word], suffixes=PROGRAMS)
        except P3IError as error:
            report.p3i_error(error, as_json=as_json)
            yield error
            continue
        for path in paths:
            try:
                text, drawn = read_source(path)
                if drawn and in_place and path != STDIN:
                    how = f"`p3i fmt - < {path}` prints its program"
                    raise FileError(f"{path} is a picture, and no text is written over it: {how}")
                yield path, text
            except P3IError as error:
                report.p3i_error(error, as_json=as_json)
                yield error


def one(word: str) -> tuple[str, bytes]:
    """The one program that a word names, as (name, its text). Raises FileError, UsageError for several."""
    paths = (STDIN,) if word == STDIN else files([word], suffixes=PROGRAMS)
    if len(paths) != 1:
        raise UsageError(f"{word} names {len(paths)} programs: name one")
    (path,) = paths
    return path, read_source(path)[0]


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

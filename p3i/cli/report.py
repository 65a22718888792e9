"""What the command line says on stderr: errors as one line for people or one JSON object for programs."""

import json
import os
import sys
import traceback
from collections.abc import Sequence

import click

from p3i.errors import FileError, P3IError


def wants_json(words: Sequence[str]) -> bool:
    """Whether the command line asks for `--error-format json`.

    Read from the bare words, since an error of usage arises before click has parsed them.
    """
    for index, word in enumerate(words):
        if word == "--":
            return False
        if word == "--error-format=json":
            return True
        if word == "--error-format" and words[index + 1 : index + 2] == ["json"]:
            return True
    return False


def coloured() -> bool:
    """Whether stderr may carry colour: a terminal, and NO_COLOR unset or empty (no-color.org)."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR")


def line(
    message: str,
    *,
    as_json: bool = False,
    code: int | None = None,
    kind: str = "error",
    image: str | None = None,
) -> None:
    """Write one line on stderr: `error: message`, or a JSON object with `image`, `error` and `code`.

    `kind` stands in the place of `error` for what is none: "note", "info".
    """
    # A file may be called anything, also what no terminal can show.
    message = " ".join(message.split()).encode("utf-8", "backslashreplace").decode("utf-8")
    if as_json:
        record = {"image": image, kind: message, "code": code}
        record = {name: value for name, value in record.items() if value is not None}
        click.echo(json.dumps(record), err=True)
        return
    colour = "red" if kind == "error" else "yellow"
    prefix = click.style(f"{kind}:", fg=colour, bold=True) if coloured() else f"{kind}:"
    click.echo(f"{prefix} {message}", err=True, color=coloured())


def p3i_error(error: P3IError, *, as_json: bool = False) -> int:
    """Report an error that p3i raised on purpose; returns its exit code.

    It is one line, save for a program's text with errors, which is shown with all of them, as by `check`.
    """
    from p3i.grammar.parse_error import ParseError  # read here, so that `--help` does not

    if isinstance(error, ParseError):
        click.echo(error.report(as_json=as_json, color=coloured()), nl=False, err=True, color=coloured())
    else:
        line(str(error), as_json=as_json, code=error.exit_code)
    return error.exit_code


def click_error(error: click.ClickException, *, as_json: bool = False) -> int:
    """Report wrong usage (2), or a file that click could not open (3); returns the exit code."""
    code = 3 if isinstance(error, click.FileError) else 2
    context = getattr(error, "ctx", None)
    message = error.format_message()
    if context is not None and not as_json:
        message = f"{message.rstrip('.')} (`{context.command_path} --help` shows the usage)"
    line(message, as_json=as_json, code=code)
    return code


def system_error(error: OSError, *, as_json: bool = False) -> int:
    """Report what the system refused where nobody foresaw it; returns 3. P3I_DEBUG=1 adds the traceback."""
    if os.environ.get("P3I_DEBUG"):
        traceback.print_exception(error)
    line(_system_sentence(error), as_json=as_json, code=FileError.exit_code)
    return FileError.exit_code


def output_error(error: OSError, *, as_json: bool = False) -> int:
    """Report that standard output cannot be written to; returns 3."""
    line(str(error), as_json=as_json, code=FileError.exit_code)
    return FileError.exit_code


def _system_sentence(error: OSError) -> str:
    name = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
    return f"{name}{(error.strerror or str(error)).lower()}"


def refuse_lost_folder() -> None:
    """Raise FileError where the working folder has been deleted: libraries end the process over that."""
    try:
        os.getcwd()
    except OSError:
        raise FileError("the working folder is gone: change to one that exists") from None


def bug(error: BaseException, *, as_json: bool = False) -> int:
    """Report an exception that nobody foresaw, in one line; returns 70. P3I_DEBUG=1 adds the traceback."""
    if os.environ.get("P3I_DEBUG"):
        traceback.print_exception(error)
    line(bug_sentence(error), as_json=as_json, code=70)
    return 70


def bug_sentence(error: BaseException) -> str:
    """The sentence for an unforeseen exception: its name, and how to get the traceback."""
    what = f"{type(error).__name__}: {error}".rstrip(": ")
    return f"p3i has a bug, {what}; P3I_DEBUG=1 shows the traceback, which belongs in a report"

"""The three standard streams, made safe once at the start: closed ones, full ones, and those that vanish."""

import contextlib
import errno
import io
import os
import sys
from collections.abc import Callable
from typing import Any

from p3i.errors import FileError


class OutputError(BrokenPipeError):
    """Standard output cannot be written to: no later answer would fare better.

    A kind of broken pipe, so that whoever goes on after errors of one input stops for it as well.
    """


def secure() -> None:
    """Make the standard streams of this process safe to use, whatever the shell did to them.

    Reading a closed standard input raises FileError, writing to a standard output that is closed or full
    OutputError; what stderr does not take is lost without a word, since talk is never worth a result.
    """
    # A closed descriptor would be given to the next file that is opened, and talk would be written into it.
    for descriptor, mode in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_RDWR)):
        _fill(descriptor, mode)
    sys.stdin = _safe(sys.stdin, lambda: io.BufferedReader(_Input(0, "r", closefd=False)))
    sys.stdout = _safe(sys.stdout, lambda: io.BufferedWriter(_Output(1, "w", closefd=False)))
    sys.stderr = _safe(
        sys.stderr,
        lambda: io.BufferedWriter(_Talk(2, "w", closefd=False)),
        errors="backslashreplace",
        line_buffering=True,
    )


def silence_stdout() -> None:
    """Point stdout at nothing, so that the interpreter's last flush does not complain of it."""
    with contextlib.suppress(OSError, ValueError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)


class _Input(io.FileIO):
    """Standard input; `BufferedReader` calls these two."""

    def readinto(self, buffer: Any, /) -> int | None:
        try:
            return super().readinto(buffer)
        except OSError as error:
            raise FileError(f"cannot read standard input: {_reason(error)}") from error

    def readall(self) -> bytes:
        try:
            return super().readall()
        except OSError as error:
            raise FileError(f"cannot read standard input: {_reason(error)}") from error


class _Output(io.FileIO):
    """Standard output. A reader that went away stays a BrokenPipeError: it is no failure of ours."""

    def write(self, data: Any, /) -> int | None:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise OutputError(f"cannot write to standard output: {_reason(error)}") from error


class _Talk(io.FileIO):
    """Standard error."""

    def write(self, data: Any, /) -> int | None:
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def _fill(descriptor: int, mode: int) -> None:
    """Open a closed descriptor on nothing, in a mode that refuses its use; stderr takes all."""
    try:
        os.fstat(descriptor)
    except OSError:
        opened = os.open(os.devnull, mode)
        os.dup2(opened, descriptor)  # for child processes too
        if opened != descriptor:
            os.close(opened)


def _safe(stream: Any, opened: Callable[[], Any], **changes: Any) -> Any:
    """`stream`, or in its place a text stream over `opened`, in its encoding; a terminal stays as it is."""
    if stream is not None and stream.isatty():
        return stream
    how: dict[str, Any] = {"encoding": "utf-8", "errors": "surrogateescape"}
    if isinstance(stream, io.TextIOWrapper):
        how = {"encoding": stream.encoding, "errors": stream.errors, "write_through": stream.write_through}
        how["line_buffering"] = stream.line_buffering
    return io.TextIOWrapper(opened(), **(how | changes))


def _reason(error: OSError) -> str:
    return "it is closed" if error.errno == errno.EBADF else (error.strerror or str(error)).lower()

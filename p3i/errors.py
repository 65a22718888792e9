"""The errors that p3i raises on purpose, each with the exit code that the command line gives it."""

from functools import partial
from typing import Any


class P3IError(Exception):
    """Base of every error that p3i raises on purpose; its text is the sentence that a user reads.

    `exit_code` is what the command line returns for it (docs/errors.md lists all codes).
    """

    exit_code = 70


class UsageError(P3IError):
    """The call itself cannot be carried out: options that contradict each other, a value out of range."""

    exit_code = 2


class FileError(P3IError):
    """A file cannot be read, is not what it should be, or cannot be written."""

    exit_code = 3


class ProgramError(P3IError):
    """A program cannot be parsed, or cannot do what was asked of it."""

    exit_code = 4


class SketchError(ProgramError):
    """A sketch, or a program to start from, that cannot be fitted to a photo.

    `place` says where (a file, a path of the program), `reason` what is wrong, `mend` what to write instead.
    """

    def __init__(self, *, place: str, reason: str, mend: str) -> None:
        super().__init__(f"{place}: {reason}; {mend}")
        self.place, self.reason, self.mend = place, reason, mend

    def __reduce__(self) -> tuple[Any, ...]:
        """How it goes to another process, where a photo was searched."""
        return partial(SketchError, place=self.place, reason=self.reason, mend=self.mend), ()


class NoPatternError(P3IError):
    """A photo shows no regular pattern that p3i would vouch for."""

    exit_code = 5

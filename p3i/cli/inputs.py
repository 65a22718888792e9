"""What a command reads: words become files, and the files photos and their programs.

The rules, for every command:

- A word is a file, a glob in quotes, a folder (its files of the kinds that the command reads, by name), or
  `@LIST`, a text file with one such word a line. `-` is standard input, and serves one argument of a call.
- PROG comes last: it is the last word, if that names one file that is a program. A program at the front,
  where only photos follow, is taken too.
- What is a program is told by the name (.p3p), else by the content: text, SVG, and a PNG that carries a
  program. A pipe is a program where it stands in the place of one.
"""

import glob
import inspect
import os
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from p3i.carried import kind_of
from p3i.cli.photos import SUFFIXES
from p3i.errors import FileError
from p3i.files import gather, read_bytes

PROGRAMS = frozenset({".p3p"})
"""The files of a folder that are taken for programs; a file named by itself may be called anything."""

_READ = "p3i.standard_input"


class Input(click.Path):
    """A file to read; `-` is standard input, which can be read once, so that one argument of a call is it."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        if value == "-" and ctx is not None:
            if _READ in ctx.meta:
                self.fail("only one input can be standard input", param, ctx)
            ctx.meta[_READ] = True
        return super().convert(value, param, ctx)


INPUT = Input(readable=False)  # whether it may be read its reader says
"""The type of every argument and option that names a file to read."""


def words(metavar: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The arguments of a command that takes one input or many; they arrive as `words: tuple[str, ...]`.

    What they may be is added to the command's help.
    """
    first = metavar.partition("...")[0]
    place = "" if first == "PROG" else " Programs come last."

    def declare(function: Callable[..., Any]) -> Callable[..., Any]:
        rules = f"{first} is a file, a glob, a folder, @LIST (a text file of such names) or - (stdin).{place}"
        carried = "A program may be its text, or a PNG or SVG that carries it."
        function.__doc__ = f"{inspect.getdoc(function)}\n\n{rules} {carried}"
        return click.argument("words", metavar=metavar, type=INPUT, nargs=-1, required=True)(function)

    return declare


def mask() -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The option --mask, which says what of a photo is hidden; the file's name arrives as `mask`."""
    return click.option(
        "--mask", metavar="FILE", type=INPUT, help="A picture whose white pixels are hidden ground: filled."
    )


@dataclass(frozen=True, slots=True)
class Inputs:
    """The photos of a call, in order, and the programs that stood beside them."""

    photos: tuple[str, ...]
    programs: tuple[str, ...] = ()

    @property
    def program(self) -> str | None:
        """The one program, where there is one."""
        return self.programs[0] if self.programs else None


def photos_and_programs(
    given: Sequence[str], *, most: int = 1, suffixes: Collection[str] = SUFFIXES
) -> Inputs:
    """The photos among the words, and up to `most` programs after them, or before them where that is clear.

    Of folders the files of `suffixes` are taken. The first word is a photo if none else is. Raises FileError
    where a folder, a glob or a list has nothing.
    """
    kinds = [kind_of(word, pictures=SUFFIXES) if names_one(word) else "photo" for word in given]
    end = len(given)
    while end > 1 and len(given) - end < most and kinds[end - 1] != "photo":
        end -= 1
    start = 0
    if end == len(given):
        while start < min(most, len(given) - 1) and kinds[start] == "program":
            start += 1
    photos = files(given[start:end], suffixes=suffixes)
    return Inputs(photos, (*given[:start], *given[end:]))


def files(given: Iterable[str], *, suffixes: Collection[str]) -> tuple[str, ...]:
    """The files that words name, each once; raises FileError where a folder, a glob or a list has nothing."""
    return tuple(map(str, gather(listed(given), suffixes=suffixes)))


def listed(given: Iterable[str]) -> list[str]:
    """The words, those of lists in the place of `@LIST`; a file whose name begins with @ is that file.

    Names in a list are seen from the working folder; empty lines are none. Raises FileError for a list that
    cannot be read, or holds no name.
    """
    found: list[str] = []
    for word in given:
        if not word.startswith("@") or os.path.lexists(word):
            found.append(word)
            continue
        names = [os.fsdecode(line.rstrip(b"\r")) for line in read_bytes(word[1:]).split(b"\n")]
        names = [name for name in names if name.strip()]
        if not names:
            raise FileError(f"the list {word[1:]} holds no name")
        found += names
    return found


def names_one(word: str) -> bool:
    """Whether a word names one file, there or not: no folder, no glob, no list."""
    if os.path.lexists(word):
        return not Path(word).is_dir()
    return not (word.startswith("@") or glob.has_magic(word))

"""Naming and writing files: inputs from files, globs and folders; outputs whole or not at all."""

import glob
import os
import stat
import sys
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from p3i.errors import FileError


def gather(words: Iterable[str], *, suffixes: Collection[str]) -> list[Path]:
    """The files that `words` name: files as they are, globs expanded, folders listed by `suffixes`.

    Order is that of the words, by name within a glob or a folder; each file comes once. A word that names
    a file is never read as a glob. A name that does not exist is kept, so that its reader reports it.
    Raises FileError where a folder or a glob holds nothing.
    """
    found: dict[Path, None] = {}
    for word in words:
        path = Path(word)
        if path.is_dir():
            members = sorted(p for p in path.iterdir() if p.suffix.lower() in suffixes and p.is_file())
            if not members:
                raise FileError(f"the folder {word} holds no file of a known kind")
        elif not path.exists() and glob.has_magic(word):
            members = sorted(p for p in map(Path, glob.glob(word, recursive=True)) if p.is_file())
            if not members:
                raise FileError(f"no file matches {word}")
        else:
            members = [path]
        found.update(dict.fromkeys(members))
    return list(found)


def names_folder(text: str) -> bool:
    """Whether the output `text` means a folder: one that exists, or a name that ends with a slash."""
    return text.endswith(("/", os.sep)) or Path(text).is_dir()


def check_writable(path: Path, *, force: bool) -> None:
    """Raise FileError now for what `replacing` would refuse later, before minutes of work are spent."""
    if path.is_dir():
        raise FileError(f"cannot write {path}: it is a folder")
    if path.exists() and not force:
        raise FileError(f"{path} exists already; --force overwrites it")
    if not path.parent.is_dir():
        raise FileError(f"cannot write {path}: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK):
        raise FileError(f"cannot write {path}: the folder {path.parent} may not be written to")


@contextmanager
def replacing(path: Path, *, force: bool) -> Iterator[IO[str]]:
    """A text file (UTF-8, LF) that takes the place of `path` if the block ends well, and vanishes if not.

    It is written beside `path` and renamed, so `path` is never half
    written. Raises FileError for all that the system refuses, and where `path` exists without `force`.
    """
    check_writable(path, force=force)
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(beside, "w", encoding="utf-8", newline="\n") as stream:
            yield stream
        os.replace(beside, path)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            beside.unlink()


def make_folder(path: Path) -> None:
    """Make the folder `path` and those above it, where they do not exist; raises FileError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make the folder {path}: {error.strerror or error}") from error


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file, or of standard input for `-`; it is opened once, so that a pipe will do.

    Raises FileError with the reason where it cannot be read.
    """
    if os.fspath(path) == "-":
        return sys.stdin.buffer.read()
    try:
        mode = Path(path).stat().st_mode
        if stat.S_ISDIR(mode):
            raise FileError(f"{path} is a folder, not a file")
        if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
            raise FileError(f"{path} is a device, not a file")
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise FileError(f"there is no file {path}") from None
    except PermissionError:
        raise FileError(f"there is no permission to read {path}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FileError(f"{path} cannot be read: {reason}") from None

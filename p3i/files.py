"""The one reader and the one writer of files: inputs gathered and read, outputs whole or not at all.

A name may be anything that a command line can hold. What the system refuses (a link in a circle, a name that
is too long, a NUL in it, a working folder that is gone) becomes a FileError with its reason; an empty name,
which pathlib would take for the working folder, a UsageError.
"""

import errno
import glob
import io
import os
import signal
import stat
import sys
import threading
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, BinaryIO

from p3i.errors import FileError, UsageError

Name = str | os.PathLike[str]

MOST_BYTES = 4 * 2**30
"""No input that p3i reads is larger: a photo of 200 megapixels, 16 bits deep, has 1.6 GB."""

_PART = 2**20
_REASONS = {
    errno.ELOOP: "it is a symbolic link that leads in a circle",
    errno.ENAMETOOLONG: "the name is too long",
    errno.EACCES: "permission denied",
}


def named(path: Name) -> Path:
    """The path that a name means; raises UsageError where it is empty, which pathlib takes for `.`."""
    if not os.fspath(path):
        raise UsageError("a file name is empty: is a variable of the shell not set? (. is this folder)")
    return Path(path)


def gather(words: Iterable[str], *, suffixes: Collection[str]) -> list[Path]:
    """The files that `words` name: files as they are, globs expanded, folders listed by `suffixes`.

    Order is that of the words, by name within a glob or a folder; each file comes once. A word that names
    a file is never read as a glob. A name that does not exist is kept, so that its reader reports it.
    Raises UsageError for an empty word, FileError where a folder or a glob holds nothing.
    """
    found: dict[Path, None] = {}
    for word in words:
        path = named(word)
        if os.path.isdir(path):
            members = [one for one in _listed(path) if one.suffix.lower() in suffixes and os.path.isfile(one)]
            if not members:
                raise FileError(f"the folder {word} holds no file of a known kind")
        elif not os.path.lexists(path) and glob.has_magic(word):
            members = sorted(one for one in map(Path, glob.glob(word, recursive=True)) if os.path.isfile(one))
            if not members:
                raise FileError(f"no file matches {word}")
        else:
            members = [path]
        found.update(dict.fromkeys(members))
    return list(found)


def as_text(name: str) -> str:
    """A file's name as text that can be encoded: bytes of it that are not UTF-8 become U+FFFD."""
    return os.fsencode(name).decode("utf-8", errors="replace")


def spoken(name: Name) -> str:
    """A file's name in messages; `-` is standard input."""
    return "standard input" if os.fspath(name) == "-" else os.fspath(name)


def names_folder(text: str) -> bool:
    """Whether the output `text` means a folder: one that exists, or a name that ends with a slash.

    Raises UsageError where it is empty.
    """
    return text.endswith(("/", os.sep)) or os.path.isdir(named(text))


def is_stream(path: Name) -> bool:
    """Whether a name is that of a pipe, a device or a socket, whose name tells no kind; never raises."""
    with suppress(OSError, ValueError):
        return not (stat.S_ISREG(kind := os.stat(path).st_mode) or stat.S_ISDIR(kind))
    return False


def place_of(path: Name) -> tuple[int, int] | str:
    """Where a name leads, equal for all names of one file: links are followed, and hard links are one.

    It need not exist. Never raises: a name that leads nowhere stands for itself.
    """
    with suppress(OSError, ValueError):
        facts = os.stat(path)
        return facts.st_dev, facts.st_ino
    with suppress(OSError, ValueError):
        return os.path.realpath(path)
    return os.fspath(path)


def read_bytes(path: Name, *, most: int = MOST_BYTES, cut: bool = False) -> bytes:
    """The bytes of a file or a pipe, or of standard input for `-`.

    It is opened once, so that a pipe will do. More than `most` bytes are refused, or left unread with `cut`.
    Raises FileError with the reason where there is nothing to read, UsageError for an empty name.
    """
    if os.fspath(path) == "-":
        return _up_to(_standard_input(), most, name=spoken(path), cut=cut)
    try:
        kind = os.stat(named(path)).st_mode
        if stat.S_ISDIR(kind):
            raise FileError(f"{path} is a folder, not a file")
        if stat.S_ISCHR(kind) or stat.S_ISBLK(kind):
            raise FileError(f"{path} is a device, not a file")
        with open(path, "rb") as stream:
            return _up_to(stream, most, name=os.fspath(path), cut=cut)
    except (FileNotFoundError, NotADirectoryError):
        raise FileError(f"there is no file {path}") from None
    except PermissionError:
        raise FileError(f"there is no permission to read {path}") from None
    except (OSError, ValueError) as error:
        raise FileError(f"{path} cannot be read: {_reason(error)}") from None


def read_text(path: Name) -> str:
    """The text of a file in UTF-8; raises as `read_bytes`, and FileError for other bytes."""
    try:
        return read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileError(f"{path} is not UTF-8 text ({error.reason} at byte {error.start})") from None


def check_writable(path: Name, *, force: bool) -> None:
    """Raise now what the writers below would raise later, before minutes of work are spent.

    FileError for a folder, a place that cannot be written to and, without `force`, a file that exists.
    Devices and pipes are written to, so nothing of theirs is lost. UsageError for an empty name.
    """
    with _refusing(named(path)):
        _check_place(path, force=force)


def write_bytes(path: Name, data: bytes, *, force: bool = False) -> None:
    """Write bytes to a file, or to standard output for `-`: whole or not at all, over nothing unless `force`.

    Raises as `replacing`.
    """
    if os.fspath(path) == "-":
        _write_out(data)
        return
    with replacing_bytes(path, force=force) as stream:
        stream.write(data)


@contextmanager
def replacing(path: Name, *, force: bool) -> Iterator[IO[str]]:
    """A text file (UTF-8, LF) that takes the place of `path` if the block ends well, and vanishes if not.

    It is written beside `path` and renamed, so `path` is never half written. A link stays a link, a file
    keeps its permissions; devices and pipes are written to as they are. Raises FileError for all that the
    system refuses and where `path` exists without `force`, UsageError for an empty name.
    """
    with replacing_bytes(path, force=force) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="\n")
        try:
            yield text
            text.flush()
        finally:
            with suppress(OSError, ValueError):
                text.detach()


@contextmanager
def replacing_bytes(path: Name, *, force: bool) -> Iterator[BinaryIO]:
    """`replacing` for bytes."""
    with _refusing(named(path)):
        old = _check_place(path, force=force)
        if old is not None and not stat.S_ISREG(old.st_mode):
            # A rename would put a file in the place of the device. Opened as it is: neither made nor cut.
            with open(path, "wb", opener=lambda name, _: os.open(name, os.O_WRONLY)) as stream:
                yield stream
            return
        place = Path(os.path.realpath(path))
        beside = place.with_name(f".{place.name[:40]}.{os.urandom(8).hex()}.part")
        with _removed_at_the_end(beside):
            # Exclusive, so that no link laid there is followed; private until it is whole, where the old is.
            mode = 0o666 if old is None else 0o600
            with open(beside, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as stream:
                yield stream
            if old is not None:
                _dress_as(beside, old)
            _land(beside, place, path, force=force)


def make_folder(path: Name) -> None:
    """Make the folder `path` and those above it, where they do not exist.

    Raises FileError, UsageError for an empty name.
    """
    try:
        named(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot make the folder {path}: {_reason(error)}") from None


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be read: {_reason(error)}") from None


def _standard_input() -> BinaryIO:
    if sys.stdin is None:
        raise FileError("standard input is closed: there is nothing to read from -")
    return sys.stdin.buffer


def _up_to(stream: BinaryIO, most: int, *, name: str, cut: bool) -> bytes:
    try:
        room = most if cut else most + 1
        # A file is read in one go: no copy of a large photo is made. A pipe tells no size.
        parts = [stream.read(min(room, max(_size(stream) + 1, _PART)))]
        while parts[-1] and (left := room - sum(map(len, parts))):
            parts.append(stream.read(min(left, _PART)))
        data = b"".join(parts)
    except (OSError, ValueError) as error:
        raise FileError(f"{name} cannot be read: {_reason(error)}") from None
    if len(data) > most:
        raise FileError(f"{name} holds more than {most:,} bytes: p3i reads no such file")
    return data


def _size(stream: BinaryIO) -> int:
    with suppress(OSError, ValueError):
        return os.fstat(stream.fileno()).st_size
    return 0  # a stand-in for standard input


def _write_out(data: bytes) -> None:
    """Bytes to standard output. A closed pipe stays a BrokenPipeError, which ends a command silently."""
    if sys.stdout is None:
        raise FileError("standard output is closed: there is nowhere to write - to")
    try:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as error:  # ValueError: it is closed
        raise FileError(f"standard output cannot be written: {_reason(error)}") from None


def _check_place(path: Name, *, force: bool) -> os.stat_result | None:
    """What stands at `path`, None where nothing does. Raises FileError where it may not be written."""
    try:
        old = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        place = Path(os.path.realpath(path))  # of a link that leads to nothing yet
        if not place.parent.exists():
            raise FileError(f"there is no folder {_parent(path, place)} to write {place.name} into") from None
        if not place.parent.is_dir():
            raise FileError(f"{_parent(path, place)} is no folder that {place.name} could be in") from None
        old, target = None, place.parent
    else:
        if stat.S_ISDIR(old.st_mode):
            raise FileError(f"{path} is a folder: name a file in it")
        if not stat.S_ISREG(old.st_mode):
            return old
        if not force:
            raise _taken(path)
        target = Path(path)
        if not os.access(os.path.dirname(os.path.realpath(path)), os.W_OK):
            target = Path(os.path.dirname(os.path.realpath(path)))
    if not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, f"permission denied ({target} may not be written to)")
    return old


def _parent(path: Name, place: Path) -> Path:
    """The folder of `place` in the words of the user, unless a link leads elsewhere."""
    return place.parent if os.path.islink(path) else Path(path).parent


def _taken(path: Name) -> FileError:
    return FileError(f"{path} exists already: name another file, or say --force")


def _dress_as(beside: Path, old: os.stat_result) -> None:
    """Give the new file the owner, where that is allowed, and the permissions of the old."""
    new = os.stat(beside)
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        with suppress(OSError):
            os.chown(beside, old.st_uid, old.st_gid)
    os.chmod(beside, stat.S_IMODE(old.st_mode))


def _land(beside: Path, place: Path, path: Name, *, force: bool) -> None:
    """Put the finished file in its place; FileError where, without `force`, one has appeared there since."""
    if not force:
        # A link fails where there is a file; a rename would replace it.
        try:
            os.link(beside, place)
            return
        except FileExistsError:
            raise _taken(path) from None
        except OSError as error:  # file systems without hard links say so in several ways
            if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
                raise
    os.replace(beside, place)


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn what the system says of the output `path` into FileError; a closed pipe stays what it is."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"{path} cannot be written: {_reason(error)}") from None


def _reason(error: OSError | ValueError) -> str:
    if isinstance(error, OSError):
        return _REASONS.get(error.errno or 0) or error.strerror or str(error)
    return "there is a NUL in the name" if "null" in str(error) else str(error)


@contextmanager
def _removed_at_the_end(beside: Path) -> Iterator[None]:
    """Remove the file when the block ends, and when the process is told to end before that."""
    removers: list[_Remover] = []
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            before = signal.getsignal(number)
            # A program with a handler of its own decides itself what a signal ends.
            if before == signal.SIG_DFL or isinstance(before, _Remover):
                removers.append(_Remover(beside, number, before))
                signal.signal(number, removers[-1])
    try:
        yield
    finally:
        for remover in reversed(removers):
            signal.signal(remover.number, remover.before)
        with suppress(OSError):
            beside.unlink()


@dataclass(frozen=True, slots=True)
class _Remover:
    """A handler that removes a half-written file, then lets the signal do what it did before."""

    beside: Path
    number: int
    before: Any = field(repr=False)

    def __call__(self, number: int, frame: object) -> None:
        with suppress(OSError):
            self.beside.unlink()
        signal.signal(number, self.before)
        os.kill(os.getpid(), number)

"""Files are named as people expect, read with a reason for each failure, and written whole or not at all."""

import os
import resource
import signal
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import p3i
from p3i import language
from p3i.errors import FileError, UsageError
from p3i.files import (
    check_writable,
    gather,
    make_folder,
    names_folder,
    place_of,
    read_bytes,
    read_text,
    replacing,
    write_bytes,
)

KINDS = {".jpg", ".png"}
UMASK = 0o027


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("b.jpg", "a.PNG", "notes.txt", "x[1].jpg"):
        Path(name).touch()
    Path("sub").mkdir()
    Path("sub/c.jpg").touch()
    return tmp_path


def as_text(path: Path, text: str) -> None:
    with replacing(path, force=True) as stream:
        stream.write(text)


def as_bytes(path: Path, text: str) -> None:
    write_bytes(path, text.encode(), force=True)


WRITERS: list[Callable[[Path, str], None]] = [as_text, as_bytes, language.write]
every_writer = pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)


def test_a_folder_gives_its_files_of_known_kinds_by_name() -> None:
    assert gather(["."], suffixes=KINDS) == [Path("a.PNG"), Path("b.jpg"), Path("x[1].jpg")]


def test_words_keep_their_order_and_each_file_comes_once() -> None:
    found = gather(["sub/c.jpg", "*.jpg", "b.jpg", "gone.jpg"], suffixes=KINDS)
    assert found == [Path("sub/c.jpg"), Path("b.jpg"), Path("x[1].jpg"), Path("gone.jpg")]


def test_a_file_whose_name_looks_like_a_glob_is_a_file() -> None:
    assert gather(["x[1].jpg"], suffixes=KINDS) == [Path("x[1].jpg")]


def test_two_stars_go_into_folders() -> None:
    assert Path("sub/c.jpg") in gather(["**/*.jpg"], suffixes=KINDS)


def test_a_slash_or_a_folder_that_exists_means_a_folder() -> None:
    assert names_folder("sub") and names_folder("new/") and not names_folder("new")


@pytest.mark.parametrize(
    "use",
    [
        lambda: gather(["b.jpg", ""], suffixes=KINDS),
        lambda: names_folder(""),
        lambda: read_bytes(""),
        lambda: check_writable("", force=True),
        lambda: write_bytes("", b"", force=True),
        lambda: make_folder(""),
        lambda: language.load(""),
        lambda: language.write("", "text"),
        lambda: p3i.examples(""),
        lambda: p3i.eval_set(""),
        lambda: p3i.trace(""),
        lambda: p3i.read_image(""),
    ],
)
def test_an_empty_name_is_wrong_usage_and_never_the_working_folder(use: Callable[[], object]) -> None:
    with pytest.raises(UsageError, match="empty"):
        use()


def test_names_that_no_system_takes_are_kept_for_their_reader() -> None:
    Path("loop").symlink_to("loop")
    names = ["loop", "n" * 300 + ".jpg", "nul\0.jpg"]
    assert gather(names, suffixes=KINDS) == [Path(name) for name in names]
    assert not any(map(names_folder, names))


def test_bytes_are_read_and_text_is_utf_8() -> None:
    Path("a.txt").write_bytes("é\n".encode())
    assert read_bytes("a.txt") == b"\xc3\xa9\n"
    assert read_text("a.txt") == "é\n"
    Path("a.txt").write_bytes(b"\xff")
    with pytest.raises(FileError, match=r"a\.txt.*UTF-8"):
        read_text("a.txt")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gone", "there is no file gone"),
        ("notes.txt/x", "there is no file"),
        ("sub", "sub is a folder"),
        ("loop", "loop.*circle"),
        ("n" * 256, "too long"),
        ("nul\0", "NUL"),
    ],
)
def test_what_cannot_be_read_says_why(name: str, reason: str) -> None:
    Path("loop").symlink_to("loop")
    with pytest.raises(FileError, match=reason):
        read_bytes(name)


def test_a_device_is_no_file_to_read() -> None:
    with pytest.raises(FileError, match="device"):
        read_bytes("/dev/zero")


def test_no_more_is_read_than_allowed() -> None:
    Path("a").write_bytes(b"12345")
    assert read_bytes("a", most=5) == b"12345"
    assert read_bytes("a", most=4, cut=True) == b"1234"
    with pytest.raises(FileError, match="more than 4 bytes"):
        read_bytes("a", most=4)


def feed(pipe: str, data: bytes) -> threading.Thread:
    thread = threading.Thread(target=lambda: Path(pipe).write_bytes(data), daemon=True)
    thread.start()
    return thread


def test_a_pipe_is_read_up_to_the_limit() -> None:
    os.mkfifo("pipe")
    thread = feed("pipe", b"12345")
    assert read_bytes("pipe") == b"12345"
    thread.join(10)
    feed("pipe", b"12345")
    with pytest.raises(FileError, match="more than 4 bytes"):
        read_bytes("pipe", most=4)


def test_standard_input_that_is_closed_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(FileError, match="standard input is closed"):
        read_bytes("-")


def test_a_file_appears_whole_and_with_unix_line_ends() -> None:
    with replacing(Path("out.txt"), force=False) as stream:
        stream.write("one\ntwo\n")
        assert not Path("out.txt").exists()
    assert Path("out.txt").read_bytes() == b"one\ntwo\n"


def test_a_failure_half_way_leaves_the_old_file_and_nothing_else(folder: Path) -> None:
    Path("out.txt").write_text("old")
    before = sorted(os.listdir(folder))
    with pytest.raises(RuntimeError), replacing(Path("out.txt"), force=True) as stream:
        stream.write("half")
        raise RuntimeError
    assert Path("out.txt").read_text() == "old"
    assert sorted(os.listdir(folder)) == before


@every_writer
def test_a_link_stays_and_what_it_leads_to_is_written(write: Callable[[Path, str], None]) -> None:
    Path("real").write_text("old")
    Path("link").symlink_to("real")
    write(Path("link"), "new")
    assert Path("link").is_symlink()
    assert Path("real").read_text() == "new"


@every_writer
def test_old_files_keep_their_permissions_and_new_ones_get_the_usual(
    write: Callable[[Path, str], None],
) -> None:
    Path("private").touch(0o600)
    before = os.umask(UMASK)
    try:
        write(Path("private"), "new")
        write(Path("fresh"), "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE(os.stat("private").st_mode) == 0o600
    assert stat.S_IMODE(os.stat("fresh").st_mode) == 0o666 & ~UMASK


@every_writer
def test_a_pipe_is_written_to_and_stays_a_pipe(write: Callable[[Path, str], None]) -> None:
    os.mkfifo("pipe")
    heard: list[bytes] = []
    thread = threading.Thread(target=lambda: heard.append(Path("pipe").read_bytes()), daemon=True)
    thread.start()
    write(Path("pipe"), "new")
    assert stat.S_ISFIFO(os.stat("pipe").st_mode)
    thread.join(10)
    assert heard == [b"new"]


@every_writer
def test_a_name_as_long_as_the_system_takes_can_be_written(write: Callable[[Path, str], None]) -> None:
    write(Path("n" * 255), "new")
    write(Path("é" * 127), "new")
    assert Path("n" * 255).read_text() == Path("é" * 127).read_text() == "new"


@every_writer
def test_nobody_can_lay_a_link_where_the_temporary_file_will_be(
    write: Callable[[Path, str], None], monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    """Each temporary name is new, and whatever stands there is not followed."""
    seen: list[str] = []
    real = os.replace

    def watching(source: str | Path, target: str | Path) -> None:
        seen.append(os.fspath(source))
        real(source, target)

    monkeypatch.setattr(os, "replace", watching)
    for _ in range(2):
        write(Path("out"), "new")
    assert len(set(seen)) == 2
    assert all(os.path.dirname(os.path.realpath(name)) == os.path.realpath(folder) for name in seen)
    assert not any(str(os.getpid()) == part for name in seen for part in name.split("."))


@every_writer
def test_a_file_that_may_not_be_written_to_stays(write: Callable[[Path, str], None]) -> None:
    Path("kept").write_text("old")
    Path("kept").chmod(0o400)
    if os.access("kept", os.W_OK):
        pytest.skip("this user may write everything (root)")
    with pytest.raises(FileError, match="permission"):
        write(Path("kept"), "new")
    assert Path("kept").read_text() == "old"


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("b.jpg", "--force"),
        ("sub", "is a folder"),
        ("gone/x.txt", "no folder gone"),
        ("notes.txt/x", "notes.txt is no folder"),
        ("loop", "circle"),
        ("loop/x", "circle"),
        ("n" * 256, "too long"),
        ("nul\0", "NUL"),
        ("dangling", "no folder"),
    ],
)
@pytest.mark.parametrize("use", [check_writable, lambda path, force: write_bytes(path, b"", force=force)])
def test_what_cannot_be_written_is_said_beforehand(use: Callable[..., None], path: str, reason: str) -> None:
    Path("loop").symlink_to("loop")
    Path("dangling").symlink_to("gone/x")
    with pytest.raises(FileError, match=reason):
        use(Path(path), force=False)


def test_a_folder_in_the_place_of_a_file_is_refused() -> None:
    with pytest.raises(FileError, match=r"cannot make the folder b\.jpg"):
        make_folder(Path("b.jpg/sub"))
    with pytest.raises(FileError, match=r"cannot make the folder"):
        make_folder("nul\0")


def test_a_working_folder_that_is_gone_is_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("gone").mkdir()
    monkeypatch.chdir("gone")
    (tmp_path / "gone").rmdir()
    for use in (
        lambda: read_bytes("a"),
        lambda: check_writable("a", force=False),
        lambda: write_bytes("a", b"", force=True),
        lambda: make_folder("a"),
    ):
        with pytest.raises(FileError):
            use()
    assert place_of("a") != place_of("b")
    assert gather(["a"], suffixes=KINDS) == [Path("a")]


def test_two_names_of_one_file_are_the_same_place() -> None:
    Path("link").symlink_to("b.jpg")
    Path("loop").symlink_to("loop")
    os.link("b.jpg", "twin.jpg")
    one = place_of("b.jpg")
    assert place_of("link") == place_of("sub/../b.jpg") == place_of("twin.jpg") == one
    assert place_of("new") == place_of("./new") == place_of("sub/../new")
    assert len({one, place_of("a.PNG"), place_of("new"), place_of("nul\0"), place_of("loop")}) == 5


def test_a_file_that_appears_while_we_write_is_not_replaced(folder: Path) -> None:
    before = len(os.listdir(folder))
    with pytest.raises(FileError, match="exists already"), replacing("out", force=False) as stream:
        stream.write("ours")
        Path("out").write_text("theirs")
    assert Path("out").read_text() == "theirs"
    assert len(os.listdir(folder)) == before + 1


def test_file_systems_without_hard_links_are_written_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_links(source: object, target: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    write_bytes("out", b"1")
    assert Path("out").read_bytes() == b"1"
    assert not [name for name in os.listdir(".") if name.endswith(".part")]


@pytest.mark.parametrize("old", [None, "mine"])
def test_a_system_that_takes_no_more_leaves_neither_a_part_nor_a_loss(folder: Path, old: str | None) -> None:
    if old is not None:
        Path("out").write_text(old)
    before = sorted(os.listdir(folder))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(FileError, match="out cannot be written: File too large"):
            write_bytes("out", bytes(5000), force=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert sorted(os.listdir(folder)) == before
    assert old is None or Path("out").read_text() == old


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_standard_output_that_takes_no_more_is_a_failure_to_write() -> None:
    code = "from p3i.files import write_bytes; write_bytes('-', bytes(99))"
    with open("/dev/full", "wb") as full:
        done = subprocess.run([sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, timeout=60)
    assert b"FileError: standard output cannot be written: No space left" in done.stderr


def test_standard_output_that_is_closed_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(FileError, match="standard output is closed"):
        write_bytes("-", b"1")


KILLED = """
import os, signal, sys
from pathlib import Path
from p3i.files import replacing
with replacing(Path("one"), force=True) as one, replacing(Path("two"), force=True) as two:
    one.write("half")
    one.flush()
    assert len(os.listdir(".")) == before + 2
    os.kill(os.getpid(), signal.{name})
"""


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_process_that_is_told_to_end_leaves_nothing_and_ends_by_that_signal(
    name: str, folder: Path
) -> None:
    before = sorted(os.listdir(folder))
    code = f"before = {len(before)}\n" + KILLED.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60)
    assert done.returncode == -getattr(signal, name), done.stderr
    assert sorted(os.listdir(folder)) == before


def test_signal_handlers_are_given_back() -> None:
    def mine(number: int, frame: object) -> None: ...

    at_first = signal.getsignal(signal.SIGTERM)
    for before in (signal.SIG_DFL, signal.SIG_IGN, mine):
        signal.signal(signal.SIGTERM, before)
        try:
            write_bytes("out", b"1", force=True)
            assert signal.getsignal(signal.SIGTERM) is before
        finally:
            signal.signal(signal.SIGTERM, at_first)

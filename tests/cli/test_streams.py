"""Standard streams that are closed or full, a working folder that is gone, and signals: in real processes."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="shells and signals of POSIX")

PROGRAM = """SetCameraPose(rx=0, ry=0)
for i in range(0, 3):
    for j in range(0, 2):
        Draw(x=9*i, y=9*j)
"""
FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a system without /dev/full")
P3I = [sys.executable, "-m", "p3i.cli.main"]


def p3i(folder: Path, redirected: str, *words: str) -> subprocess.CompletedProcess[str]:
    """`p3i WORDS` with streams redirected as the shell says: ">&-" closes stdout."""
    (folder / "a.p3p").write_text(PROGRAM)
    shell = ["sh", "-c", f'exec "$@" {redirected}', "sh", *P3I, *words]
    environment = {**os.environ, "NO_COLOR": "1"}
    environment.pop("P3I_DEBUG", None)
    return subprocess.run(shell, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["expand", "a.p3p"]], ids=" ".join)
def test_a_closed_standard_output_is_one_line_and_3(words: list[str], tmp_path: Path) -> None:
    done = p3i(tmp_path, ">&-", *words)
    assert (done.returncode, done.stderr) == (3, "error: cannot write to standard output: it is closed\n")


@FULL
@pytest.mark.parametrize("words", [["--version"], ["expand", "a.p3p"], ["fmt", "-"]], ids=" ".join)
def test_a_full_standard_output_is_one_line_and_3(words: list[str], tmp_path: Path) -> None:
    done = p3i(tmp_path, "< a.p3p > /dev/full", *words)
    message = "error: cannot write to standard output: no space left on device\n"
    assert (done.returncode, done.stderr) == (3, message)


@pytest.mark.parametrize("redirected", [">&-", pytest.param("> /dev/full", marks=FULL)])
def test_what_writes_a_file_needs_no_standard_output(redirected: str, tmp_path: Path) -> None:
    (tmp_path / "b.p3p").write_text(PROGRAM.replace("9*i", "9 * i"))
    done = p3i(tmp_path, redirected, "fmt", "b.p3p")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "b.p3p").read_text() == PROGRAM


@pytest.mark.parametrize("redirected", ["2>&-", pytest.param("2> /dev/full", marks=FULL)])
@pytest.mark.parametrize(
    ("words", "code"), [(["check", "a.p3p"], 0), (["expand", "b.p3p"], 3), (["expand"], 2)], ids=str
)
def test_talk_that_cannot_be_written_changes_no_exit_code(
    redirected: str, words: list[str], code: int, tmp_path: Path
) -> None:
    assert p3i(tmp_path, redirected, *words).returncode == code


def test_no_talk_ends_in_a_file_that_took_the_place_of_a_closed_stderr(tmp_path: Path) -> None:
    (tmp_path / "b.p3p").write_text(PROGRAM.replace("9*i", "9 * i"))
    assert p3i(tmp_path, ">&- 2>&- <&-", "fmt", "b.p3p").returncode == 0
    assert (tmp_path / "b.p3p").read_text() == PROGRAM


@pytest.mark.parametrize("command", ["check", "fmt", "expand", "render"])
def test_a_closed_standard_input_is_one_line_and_3(command: str, tmp_path: Path) -> None:
    output = ["-o", "a.svg"] if command == "render" else []
    done = p3i(tmp_path, "<&-", command, "-", *output)
    assert (done.returncode, done.stderr) == (3, "error: cannot read standard input: it is closed\n")


def test_a_reader_that_goes_away_ends_the_command_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "many.p3p").write_text(PROGRAM.replace("range(0, 3)", "range(0, 9999)"))
    script = '("$@"; echo $? >code) | head -n 1'
    shell = ["sh", "-c", script, "sh", *P3I, "expand", "many.p3p"]
    done = subprocess.run(shell, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stderr == "" and done.stdout.split() == ["i", "j", "x", "y"]
    assert (tmp_path / "code").read_text() == "141\n"


@pytest.mark.parametrize("words", [["check", "."], ["score", "a.jpg", "a.p3p"]], ids=" ".join)
def test_a_working_folder_that_is_gone_is_one_line_and_3(words: list[str], tmp_path: Path) -> None:
    script = 'mkdir gone && cd gone && rmdir ../gone && exec "$@"'
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "NO_COLOR": "1"}
    shell = ["sh", "-c", script, "sh", *P3I, *words]
    done = subprocess.run(shell, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 3 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: the working folder is gone")


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_a_signal_ends_a_command_with_its_code_and_leaves_no_file(name: str, tmp_path: Path) -> None:
    """A writer that is in the middle of its file stands for every one."""
    script = (
        "import sys, time, types, click\n"
        "from pathlib import Path\n"
        "from p3i import files\n"
        "from p3i.cli import main\n"
        "@click.command('slow')\n"
        "def slow():\n"
        "    with files.replacing(Path('out.txt'), force=False) as stream:\n"
        "        stream.write('half')\n"
        "        print('begun', flush=True)\n"
        "        time.sleep(30)\n"
        "sys.modules['slow'] = types.SimpleNamespace(command=slow)\n"
        "main.COMMANDS['slow'] = main.Entry('slow', '')\n"
        "sys.argv = ['p3i', 'slow']\n"
        "main.main()\n"
    )
    number = getattr(signal, name)
    with subprocess.Popen(
        [sys.executable, "-c", script], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        begun = time.monotonic()
        process.send_signal(number)
        _, said = process.communicate(timeout=20)
    assert time.monotonic() - begun < 10
    assert process.returncode == 128 + number
    assert said == b"error: interrupted\n"
    assert list(tmp_path.iterdir()) == []

"""`p3i synth --jobs`: its processes around a stand-in for the search, and once the whole on real pictures."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import solvers

from p3i.cli import workers
from p3i.cli.main import run
from p3i.cli.solving import Outcome, Task
from p3i.search.config import SearchConfig

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


STAND_IN = {"solve": solvers.solve, "prepare": solvers.prepare}


def outcomes(*names: str, jobs: int = 2, traced: bool = False) -> Iterator[tuple[Outcome, list[str]] | None]:
    tasks = [Task(photo=Path(f"{name}.png"), config=SearchConfig()) for name in names]
    with workers.pool(tasks, jobs=jobs, traced=traced, told=False, **STAND_IN) as pool:
        for number in range(len(tasks)):
            yield pool.answer(number, lambda _stage, _fraction: None)


def signalled(number: int, *, after: Sequence[str], times: int = 1) -> None:
    """Send this process a signal once the files `after` are there; again, where asked, a moment later."""

    def send() -> None:
        while not all(Path(name).exists() for name in after):
            time.sleep(0.01)
        for _ in range(times):
            os.kill(os.getpid(), number)
            time.sleep(0.3)

    threading.Thread(target=send, daemon=True).start()


def test_answers_come_in_the_order_of_the_photos_from_several_processes() -> None:
    found = [one[0] for one in outcomes("a_slow", "b_quick", "c_quick", "d_slow") if one]
    assert [outcome.photo.stem for outcome in found] == ["a_slow", "b_quick", "c_quick", "d_slow"]
    processes = {outcome.seconds for outcome in found}
    assert len(processes) == 2 and os.getpid() not in processes


def test_a_process_that_the_system_ends_costs_its_own_photo_only() -> None:
    found = [one[0] for one in outcomes("a_slow", "b_killed", "c_leaves", "d_quick") if one]
    assert [outcome.code for outcome in found] == [0, 3, 70, 0]
    assert "memory" in found[1].error and "exit code 7" in found[2].error


def test_an_interrupt_asks_each_process_once_and_begins_nothing_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # c is begun once a has been answered.
    signalled(signal.SIGINT, after=["b_hangs.begun", "c_hangs.begun"])
    found = list(outcomes("a_quick", "b_hangs", "c_hangs", "d_quick"))
    assert found[-1] is None
    assert [(one[0].code, one[0].error) for one in found if one] == [(0, ""), *[(130, "best so far")] * 2]


def test_an_interrupt_waits_until_a_process_has_loaded_what_it_needs(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("prepare.slowly").touch()
    signalled(signal.SIGINT, after=["prepare.begun"])
    found = list(outcomes("a_quick"))
    assert [one and one[0].code for one in found] == [130]
    assert Path("prepare.ended").exists()


def test_ctrl_c_reaches_every_process_of_a_terminal_and_is_one_interrupt(tmp_path: Path) -> None:
    script = (
        "import solvers\n"
        "from pathlib import Path\n"
        "from p3i.cli import workers\n"
        "from p3i.cli.solving import Task\n"
        "from p3i.search.config import SearchConfig\n"
        "tasks = [Task(photo=Path(name), config=SearchConfig()) for name in ('a_hangs', 'b_hangs')]\n"
        "with workers.pool(tasks, jobs=2, traced=False, told=False, solve=solvers.solve,\n"
        "    prepare=solvers.prepare) as pool:\n"
        "    print([pool.answer(number, print)[0].error for number in (0, 1)])\n"
    )
    with started(script, tmp_path) as process:
        while not all((tmp_path / f"{name}_hangs.begun").exists() for name in "ab"):
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (out, err) == ("['best so far', 'best so far']\n", "")
    (tmp_path / "prepare.slowly").touch()
    with started(script, tmp_path) as process:
        while not (tmp_path / "prepare.begun").exists():
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert err == "" and out.count("interrupted before") == 2


def started(script: str, folder: Path) -> subprocess.Popen[str]:
    """A Python that runs a script in a process group of its own, as a shell starts it."""
    path = os.pathsep.join(map(str, (Path(__file__).parents[1], Path(__file__).parents[2])))
    return subprocess.Popen(
        [sys.executable, "-c", script],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_a_second_interrupt_ends_what_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    signalled(signal.SIGINT, after=["a_stubborn.begun", "c_stubborn.begun"], times=2)
    found = list(outcomes("a_stubborn", "b_quick", "c_stubborn"))
    assert [one and one[0].code for one in found] == [130, 0, 130]


def test_steps_of_each_search_come_with_its_answer() -> None:
    found = list(outcomes("a_slow", "b_quick", traced=True))
    assert [one and one[1] for one in found] == [["a_slow.png: begun\n"], ["b_quick.png: begun\n"]]


def test_no_process_outlives_the_pool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = outcomes("a_quick", "b_hangs")
    first = next(found)
    assert first is not None
    while not Path("b_hangs.begun").exists():
        time.sleep(0.01)
    found.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int(first[0].seconds), 0)


def test_the_script_that_was_started_is_not_run_again(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\n"
        "import solvers\n"
        "from p3i.cli import workers\n"
        "from p3i.cli.solving import Task\n"
        "from p3i.search.config import SearchConfig\n"
        "tasks = [Task(photo=Path(name), config=SearchConfig()) for name in ('a_quick', 'b_quick')]\n"
        "with workers.pool(tasks, jobs=2, traced=False, told=False, solve=solvers.solve,\n"
        "    prepare=solvers.prepare) as pool:\n"
        "    print([pool.answer(number, print)[0].code for number in (0, 1)])\n"
    )
    path = os.pathsep.join(map(str, (Path(__file__).parents[1], Path(__file__).parents[2])))
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.stdout, done.stderr) == ("[0, 0]\n", "")


def paint(path: Path, kind: str) -> None:
    """A small picture: tiles in perspective, or nothing but grey."""
    pixels = np.full((120, 160, 3), 128, np.uint8)
    if kind == "tiles":
        x, y = np.meshgrid(np.arange(160), np.arange(120))
        depth = 1 + 0.5 * y / 120
        board = (np.floor((x - 80) / 14 * depth) + np.floor(y / 11 * depth)) % 2
        pixels = np.repeat((60 + 130 * board)[:, :, None], 3, axis=2).astype(np.uint8)
    cv2.imwrite(str(path), pixels)


def test_two_jobs_print_what_one_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, kind in (("a.png", "tiles"), ("b.png", "grey"), ("c.png", "grey")):
        paint(Path(name), kind)
    printed = []
    for jobs in ("1", "2"):
        words = ["--structure", "lattice", "--jobs", jobs, "--format", "jsonl", "--trace", f"{jobs}.trace"]
        assert run(["synth", "a.png", "b.png", "missing.png", "c.png", *words]) == 6
        out, err = capsys.readouterr()
        printed.append(([{**json.loads(line), "seconds": 0} for line in out.splitlines()], err))
    assert printed[0] == printed[1]
    assert "SetCameraPose" in printed[0][0][0]["program"]
    assert [record["image"] for record in printed[0][0]] == ["a.png", "b.png", "missing.png", "c.png"]
    assert Path("1.trace").read_bytes() == Path("2.trace").read_bytes() != b""


@pytest.mark.parametrize(
    "words", [["--jobs", "0"], ["--jobs", "2", "--mask", "-"], ["--jobs", "2", "-"]], ids=" ".join
)
def test_jobs_that_cannot_be_are_wrong_usage(words: list[str], tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["synth", "a.png", "b.png", "-o", "out/", *words]) == 2

"""A stand-in for the search that the processes of `--jobs` import: a photo's name says what happens."""

import os
import signal
import time
from pathlib import Path

from p3i.cli.solving import Outcome, Task
from p3i.search.config import SearchConfig


def solve(task: Task, *, update, note=None) -> Outcome:
    """The last word of the photo's name is what happens; its seconds are the number of its process."""
    what = task.photo.stem.rpartition("_")[2]
    if note is not None:
        note(f"{task.photo}: begun\n")
    if what == "slow":
        time.sleep(0.4)
    if what == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "leaves":
        os._exit(7)
    if what in ("hangs", "stubborn"):
        try:
            Path(f"{task.photo.stem}.begun").touch()  # what waits for it may interrupt at once
            while True:
                time.sleep(0.01)
        except KeyboardInterrupt:
            if what == "hangs":
                return Outcome(photo=task.photo, error="best so far", code=130)
        while True:
            time.sleep(0.01)
    return Outcome(photo=task.photo, texts=(what,), seconds=os.getpid())


def measured(photo: Path, config: object) -> tuple[dict[str, object], float, float]:
    """A stand-in for the search of one photo of a set."""
    solve(Task(photo=photo, config=SearchConfig()), update=None)
    return {"image": photo.name, "program": None, "error": "answered"}, 0.0, 0.0


def prepare() -> None:
    """What the real one loads, this one does not need; slowly, where a file says so."""
    if Path("prepare.slowly").exists():
        Path("prepare.begun").touch()
        for _ in range(30):
            time.sleep(0.01)
        Path("prepare.ended").touch()

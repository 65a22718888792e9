"""Several photos at once: processes that solve tasks, whose answers are given out in the order of the tasks.

A process that the system ends costs its own photo and no other. An interrupt is passed on to those that work,
each of which answers with the best that it has.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
import types
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from p3i.cli import solving
from p3i.cli.solving import Outcome, Task
from p3i.search.result import StopReason

_TELL_S = 0.1
"""A worker tells how far it is no more often than this."""
_LEAVE_S = 2.0
"""How long a worker without work may take to leave."""

Solve = Callable[..., Outcome]
Steps = list[str]
Update = Callable[[str, float], None]


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    number: int | None = None
    """The task that it works on; None while it waits."""


class Pool:
    """Up to `jobs` processes for `tasks`; use `pool`, which ends them."""

    def __init__(self, tasks: Sequence[Task], *, jobs: int, how: tuple[Any, ...]) -> None:
        self._tasks, self._jobs, self._how = tasks, jobs, how
        self._waiting = deque(range(len(tasks)))
        self._workers: list[_Worker] = []
        self._answers: dict[int, tuple[Outcome, Steps]] = {}
        self._asked = 0
        self._heard, self._ring = os.pipe()

    def answer(self, number: int, update: Update) -> tuple[Outcome, Steps] | None:
        """The outcome of a task and the steps of its search, as soon as they are known.

        None for a task that an interrupt kept from being begun. `update` is told how far this task is.
        """
        while number not in self._answers:
            self._hand_out()
            if all(worker.number is None for worker in self._workers):
                return None
            self._listen(number, update)
        return self._answers.pop(number)

    def interrupt(self) -> None:
        """Ask those that work for the best that they have; the second time, end them. For signal handlers."""
        self._asked += 1
        os.write(self._ring, b"!")

    def close(self) -> None:
        """End all processes: at once those that work, the others by their closed pipe."""
        for worker in self._workers:
            worker.pipe.close()
            if worker.number is not None:
                worker.process.kill()
        for worker in self._workers:
            worker.process.join(_LEAVE_S)
            worker.process.kill()
            worker.process.join()
        os.close(self._heard)
        os.close(self._ring)

    def _hand_out(self) -> None:
        """Give waiting tasks to idle workers, new ones where there is room."""
        while self._waiting and not self._asked:
            idle = [worker for worker in self._workers if worker.number is None]
            if not idle and len(self._workers) == self._jobs:
                return
            worker = idle[0] if idle else self._hire()
            try:
                worker.pipe.send(self._tasks[self._waiting[0]])
            except OSError:  # it was ended while it waited, which costs no photo
                worker.pipe.close()
                self._workers.remove(worker)
                continue
            worker.number = self._waiting.popleft()

    def _hire(self) -> _Worker:
        # Spawned, since torch and OpenCV do not survive a fork with their threads.
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs, *self._how), daemon=True)
        resource_tracker.ensure_running()  # which would let go of the signals when `start` began it
        # Ctrl-C reaches all processes of a terminal; the workers are told by this one, and once.
        with held_back("SIGINT"), _no_script():
            process.start()
        theirs.close()  # so that the pipe ends with the worker
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _listen(self, number: int, update: Update) -> None:
        """Wait for a word of any worker, or for an interrupt, and take it in."""
        busy = {worker.pipe: worker for worker in self._workers if worker.number is not None}
        for heard in wait([*busy, self._heard]):
            if heard == self._heard:
                os.read(self._heard, 1)
                for worker in busy.values():
                    (worker.process.terminate if self._asked < 2 else worker.process.kill)()
                continue
            worker = busy[heard]  # pyright: ignore[reportArgumentType]
            assert worker.number is not None
            try:
                said = worker.pipe.recv()
            except (EOFError, OSError):
                self._answers[worker.number] = self._lost(worker), []
                self._workers.remove(worker)
                continue
            if isinstance(said[0], Outcome):
                self._answers[worker.number] = said
                worker.number = None
            elif worker.number == number:
                update(*said)

    def _lost(self, worker: _Worker) -> Outcome:
        """What came of the task of a worker that is gone."""
        assert worker.number is not None
        task = self._tasks[worker.number]
        worker.pipe.close()
        worker.process.join()
        ended = worker.process.exitcode or 0
        if self._asked:
            return solving.failure(task, StopReason.INTERRUPTED.value, code=130)
        if ended == -getattr(signal, "SIGKILL", 9):
            reason = "the system ended the process for this photo, perhaps for want of memory"
            return solving.failure(task, f"{reason}: say fewer --jobs, or scale the photo down", code=3)
        how = f"by signal {-ended}" if ended < 0 else f"with exit code {ended}"
        return solving.failure(task, f"the process for this photo ended {how}", code=70)


@contextlib.contextmanager
def pool(
    tasks: Sequence[Task],
    *,
    jobs: int,
    traced: bool,
    told: bool,
    solve: Solve = solving.solve,
    prepare: Callable[[], None] = solving.prepare,
) -> Iterator[Pool]:
    """A Pool for the tasks, that is told of interrupts, and whose processes end with the block.

    `traced` says whether the steps of the searches are wanted, `told` whether progress is. Each process calls
    `prepare` once, which no interrupt cuts short.
    """
    made = Pool(tasks, jobs=min(jobs, len(tasks)), how=(solve, prepare, traced, told))
    try:
        with _interrupting(made):
            yield made
    finally:
        made.close()


@contextlib.contextmanager
def _interrupting(made: Pool) -> Iterator[None]:
    """Pass interrupts to the pool: one that is raised inside it would tear its messages apart."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {}

    def handle(number: int, frame: object) -> None:
        try:
            before[number](number, frame)
        except KeyboardInterrupt:
            made.interrupt()

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    try:
        for number in (getattr(signal, name) for name in names):
            if callable(signal.getsignal(number)):
                before[number] = signal.getsignal(number)
                signal.signal(number, handle)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def held_back(*names: str) -> Iterator[None]:
    """Hold signals back meanwhile, such as "SIGINT", and for ever in a process that is started here."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    numbers = {getattr(signal, name) for name in names}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _no_script() -> Iterator[None]:
    """Let no process that is started here run the script of this one again: they need nothing of it."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _work(pipe: Connection, solve: Solve, prepare: Callable[[], None], traced: bool, told: bool) -> None:
    """The life of a worker: a task in, an outcome with its steps out, until the pipe is closed."""
    asked = solving_now = False

    def interrupt(_number: int, _frame: object) -> None:
        nonlocal asked, solving_now
        asked = True
        if solving_now:
            solving_now = False  # the second time the answer is being made: let it
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, interrupt)
    if not os.environ.get("P3I_DEBUG"):
        warnings.simplefilter("ignore")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    prepare()
    last = 0.0

    def update(stage: str, fraction: float) -> None:
        nonlocal last
        if told and time.monotonic() - last > _TELL_S:
            last = time.monotonic()
            pipe.send((stage, fraction))

    try:
        while True:
            task: Task = pipe.recv()
            steps: Steps = []
            outcome: Outcome | None = None
            try:
                solving_now = True
                if asked:
                    raise KeyboardInterrupt
                outcome = solve(task, update=update, note=steps.append if traced else None)
            except KeyboardInterrupt:
                outcome = outcome or solving.failure(task, StopReason.INTERRUPTED.value, code=130)
            solving_now = False
            pipe.send((outcome, steps))
    except (EOFError, OSError):  # nobody waits for an answer any more
        os._exit(0)

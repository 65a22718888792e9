"""The progress bar on stderr: only where a person watches."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Update = Callable[[str, float], None]


@contextmanager
def bar(*, wanted: bool, total: int) -> Iterator[Callable[[str, int], Update]]:
    """A bar over `total` photos; yields `start(label, number) -> update(stage, fraction)`.

    Draws nothing, and does not import rich, unless it is wanted and stderr is a terminal. It vanishes at
    the end, so that what stays on the screen is the result.
    """
    if not (wanted and sys.stderr.isatty()):
        yield lambda _label, _number: lambda _stage, _fraction: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("", total=float(total))

        def start(label: str, number: int) -> Update:
            def update(stage: str, fraction: float) -> None:
                done = number + min(max(fraction, 0.0), 1.0)
                shown.update(task, completed=done, description=f"{label}: {stage}")

            update("reading", 0.0)
            return update

        yield start

"""The progress bar on stderr: only where a person watches."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def bar(label: str, *, wanted: bool) -> Iterator[Callable[[str, float], None]]:
    """A bar for one photo; yields `update(stage, fraction)`.

    Draws nothing, and does not import rich, unless it is wanted and stderr is a terminal. It vanishes at
    the end, before the answer is printed.
    """
    if not (wanted and sys.stderr.isatty()):
        yield lambda _stage, _fraction: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    # rich would send what is printed meanwhile to its own console, which is stderr.
    shown = Progress(
        *columns,
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    with shown:
        task = shown.add_task(f"{label}: reading", total=1.0)

        def update(stage: str, fraction: float) -> None:
            shown.update(task, completed=min(max(fraction, 0.0), 1.0), description=f"{label}: {stage}")

        yield update

"""One search of one photo: what all its parts share, and what they find."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import torch

from p3i.search.config import SearchConfig
from p3i.search.look.evidence import Evidence
from p3i.search.result import StopReason, StructureFound

Progress = Callable[[str, float], None]
Trace = Callable[[Mapping[str, Any]], None]
T = TypeVar("T")
TRACE_VERSION = 1
"""Of what `record` writes: the number in a trace's first record (p3i/paint/draw/steps.py reads it)."""


@dataclass(slots=True)
class Session:
    """The photo's evidence, the options, the clock, and where progress and steps are told.

    `stopped` says why the search was cut short, if it was; who proposes and refines looks at `go_on()` in
    between, and then finishes what it has. `unwritable` are the structures of answers that Table 1 has no
    words for, where only its programs are asked for.
    """

    evidence: Evidence
    config: SearchConfig
    progress: Progress | None = None
    trace: Trace | None = None
    stopped: StopReason | None = None
    unwritable: set[StructureFound] = field(default_factory=set)
    _begun: float = field(default_factory=time.monotonic)
    _generator: torch.Generator | None = None
    _until: float | None = None

    @property
    def generator(self) -> torch.Generator:
        """The source of chance of sketches and of the paper's grid, seeded by the options.

        What draws at random in other libraries (spots of rings, in numpy) seeds its own by the same option.
        """
        if self._generator is None:
            self._generator = torch.Generator().manual_seed(self.config.seed)
        return self._generator

    def go_on(self) -> bool:
        """Whether there is time left; once not, `stopped` says so."""
        limit = self.config.time_s
        if self.stopped is None and limit is not None and time.monotonic() - self._begun > limit:
            self.stopped = StopReason.TIME_UP
        return self.stopped is None and (self._until is None or time.monotonic() < self._until)

    @contextmanager
    def within(self, seconds: float | None) -> Iterator[None]:
        """A stretch of the search that has so many seconds of its own; None for no limit."""
        self._until = None if seconds is None else time.monotonic() + seconds
        try:
            yield
        finally:
            self._until = None

    @contextmanager
    def until_interrupted(self) -> Iterator[None]:
        """A stretch of the search that a KeyboardInterrupt ends: `stopped` says so, and what it has counts.

        A second one, while the best so far is being finished, is raised: it ends the search at once.
        """
        try:
            yield
        except KeyboardInterrupt:
            if self.stopped is StopReason.INTERRUPTED:
                raise
            self.stopped = StopReason.INTERRUPTED

    def completed(self, step: Callable[[], T]) -> T:
        """What a short step returns that is worth the wait: an interrupt within it begins it anew."""
        with self.until_interrupted():
            return step()
        return step()

    @property
    def focal_is_free(self) -> bool:
        """Whether the pattern may tell the focal: nobody stated it, or the pattern was asked for it."""
        stated = self.config.focal_mm
        return stated == "auto" or (stated is None and self.evidence.image.focal_mm is None)

    def tell(self, doing: str, share: float) -> None:
        """Report progress: what is being done, and the share of the whole that is done, 0..1."""
        if self.progress is not None:
            self.progress(doing, share)

    def record(self, step: str, **facts: Any) -> None:
        """Write one step of the search into the trace."""
        if self.trace is not None:
            self.trace({"step": step, **facts})

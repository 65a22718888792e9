"""One search of one photo: what all its parts share, and what they find."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import torch

from p3i.search.config import SearchConfig
from p3i.search.evidence import Evidence
from p3i.search.result import StopReason

Progress = Callable[[str, float], None]
Trace = Callable[[Mapping[str, Any]], None]
TRACE_VERSION = 1
"""Of what `record` writes: the number in a trace's first record (p3i/paint/steps.py reads it)."""


@dataclass(slots=True)
class Session:
    """The photo's evidence, the options, the clock, and where progress and steps are told.

    `stopped` says why the search was cut short, if it was; who proposes and refines looks at `go_on()` in
    between, and then finishes what it has. `rings` keeps what rings.py found, for the families that share it.
    """

    evidence: Evidence
    config: SearchConfig
    progress: Progress | None = None
    trace: Trace | None = None
    stopped: StopReason | None = None
    rings: tuple[Any, ...] | None = None
    _begun: float = field(default_factory=time.monotonic)
    _generator: torch.Generator | None = None

    @property
    def generator(self) -> torch.Generator:
        """The one source of chance, seeded by the options."""
        if self._generator is None:
            self._generator = torch.Generator().manual_seed(self.config.seed)
        return self._generator

    def elapsed(self) -> float:
        """Seconds since the search of this photo began."""
        return time.monotonic() - self._begun

    def go_on(self) -> bool:
        """Whether there is time left; once not, `stopped` says so."""
        limit = self.config.time_s
        if self.stopped is None and limit is not None and time.monotonic() - self._begun > limit:
            self.stopped = StopReason.TIME_UP
        return self.stopped is None

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

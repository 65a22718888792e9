"""The one record of options that filling takes: the Python API and the command line both read it.

Imports neither torch nor numpy: `p3i inpaint --help` reads this file.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from p3i.errors import UsageError
from p3i.options.npn import STEPS
from p3i.records import PhotoFocal, Spelt, check_focal

Method = Literal["stack", "npn", "patchmatch"]
METHODS: tuple[Method, ...] = get_args(Method)
"""The ways to fill a hole."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FindOptions:
    """How to look for what is marred. Raises UsageError for a value out of range."""

    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        check_focal(self.focal_mm)


@dataclass(frozen=True, slots=True, kw_only=True)
class InpaintOptions:
    """How to fill a hole. Raises UsageError for a value out of range."""

    method: Annotated[
        Method,
        "stack: a mean of aligned cells, in seconds; npn: the paper's neural painting network, trained on "
        "this one photo, in seconds; patchmatch: PatchMatch guided by the program (extra `patchmatch`).",
    ] = "stack"
    steps: Annotated[int, "With npn: steps of training on the photo.", Spelt(metavar="N")] = STEPS
    time_s: Annotated[
        float | None,
        "With npn: stop training after this many seconds.",
        Spelt("--time", metavar="SECONDS"),
    ] = None
    checkpoint: Annotated[
        Path | None,
        "With npn: a file that the photo's training is kept in, for any hole; it goes on from it.",
    ] = None
    seed: Annotated[int, "With npn and patchmatch: the seed of what is random.", Spelt(metavar="N")] = 0
    device: Annotated[
        str, "With npn: where the network runs: auto, cpu, cuda, ...", Spelt(metavar="NAME")
    ] = "auto"
    threads: Annotated[int, "With npn: threads of the network.", Spelt(metavar="N")] = 1
    only_pattern: Annotated[
        bool,
        "Leave transparent what cannot come from the pattern: where it shows nothing alike, and where its "
        "objects differ so much from one another that any fill is a guess.",
        Spelt("--only-pattern"),
    ] = False
    focal_mm: PhotoFocal = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UsageError(f"a method is one of {', '.join(METHODS)}, not {self.method!r}")
        if self.steps < 1:
            raise UsageError(f"training takes at least one step, not {self.steps}")
        if self.time_s is not None and not (math.isfinite(self.time_s) and self.time_s > 0):
            raise UsageError(f"a time limit is above 0 seconds, not {self.time_s:g}")
        if self.threads < 1:
            raise UsageError(f"at least one thread is needed, not {self.threads}")
        check_focal(self.focal_mm)
        if self.method != "npn":
            for name, value in (("time", self.time_s), ("checkpoint", self.checkpoint)):
                if value is not None:
                    raise UsageError(f"--{name} belongs to the method npn, not to {self.method}")

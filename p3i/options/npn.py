"""The options of the neural painting network; read by the command line too, and free of heavy imports."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from p3i.errors import UsageError

STEPS = 60
"""Steps of training on a photo, after those that p3i ships with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkOptions:
    """How long and with what the network is trained. Raises UsageError for a value out of range."""

    steps: Annotated[int, "Steps of training on the photo; 0 takes the network as it ships with p3i."] = STEPS
    time_s: Annotated[
        float | None,
        "Stop training after so many seconds. Where the clock stops it, two runs need not agree.",
    ] = None
    seed: Annotated[int, "Of every choice made by chance: equal input, options and seed, equal picture."] = 0
    device: Annotated[
        str, "Where to train: cpu, auto (cuda where there is one), or a device of PyTorch's."
    ] = "cpu"
    threads: Annotated[int | None, "Threads of PyTorch's; None takes as many as it takes itself."] = 1
    checkpoint: Annotated[
        Path | None,
        "A file that keeps the photo's training; where it exists training goes on from it, for any hole.",
    ] = None

    def __post_init__(self) -> None:
        if self.steps < 0:
            raise UsageError(f"the steps of training cannot be fewer than 0, not {self.steps}")
        if self.time_s is not None and not (math.isfinite(self.time_s) and self.time_s > 0):
            raise UsageError(f"the time to train is more than 0 seconds, not {self.time_s:g}")
        if not 0 <= self.seed < 2**32:
            raise UsageError(f"a seed lies between 0 and 2**32 - 1, not {self.seed}")
        if self.threads is not None and self.threads < 1:
            raise UsageError(f"training needs at least one thread, not {self.threads}")

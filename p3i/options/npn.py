"""The options of the neural painting network; read by the command line too, and free of heavy imports."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from p3i.errors import UsageError


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkOptions:
    """How long and with what the network is trained. Raises UsageError for a value out of range."""

    steps: Annotated[
        int, "Steps of training; 0 takes the network as it starts, a weighted mean of cells."
    ] = 400
    time_s: Annotated[
        float | None,
        "Stop training after so many seconds. Where the clock stops it, two runs need not agree.",
    ] = 120.0
    seed: Annotated[int, "Of every choice made by chance: equal input, options and seed, equal picture."] = 0
    device: Annotated[
        str, "Where to train: cpu, auto (cuda where there is one), or a device of PyTorch's."
    ] = "cpu"
    threads: Annotated[int | None, "Threads of PyTorch's; by default as many as it takes itself."] = None
    checkpoint: Annotated[
        Path | None, "A file that keeps the state of the training; where it exists, training goes on from it."
    ] = None
    working_px: Annotated[
        int, "The network sees cells of at most so many pixels; larger photos are blended at their own size."
    ] = 48
    sources: Annotated[int, "Blend at most so many cells."] = 10
    examples: Annotated[int, "Cut so many holes into other cells of the photo to learn from."] = 96
    adversarial: Annotated[float, "Weight of the adversarial loss beside the mean difference (L1)."] = 0.002

    def __post_init__(self) -> None:
        if self.steps < 0:
            raise UsageError(f"the steps of training cannot be fewer than 0, not {self.steps}")
        if self.time_s is not None and not (math.isfinite(self.time_s) and self.time_s > 0):
            raise UsageError(f"the time to train is more than 0 seconds, not {self.time_s:g}")
        if not 0 <= self.seed < 2**32:
            raise UsageError(f"a seed lies between 0 and 2**32 - 1, not {self.seed}")
        if self.threads is not None and self.threads < 1:
            raise UsageError(f"training needs at least one thread, not {self.threads}")
        if not 8 <= self.working_px <= 256:
            raise UsageError(f"the network sees cells of 8 to 256 pixels, not {self.working_px}")
        if not 1 <= self.sources <= 64:
            raise UsageError(f"between 1 and 64 cells are blended, not {self.sources}")
        if not 1 <= self.examples <= 10_000:
            raise UsageError(f"between 1 and 10000 holes are learned from, not {self.examples}")
        if not (math.isfinite(self.adversarial) and 0 <= self.adversarial <= 10):
            raise UsageError(f"the adversarial loss weighs between 0 and 10, not {self.adversarial:g}")

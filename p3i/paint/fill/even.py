"""The light of a ground: its colours made smooth over many pixels, on a reduced picture where that is enough.

Convention: one channel float32 [H, W], masks bool [H, W].
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.fill import filled

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Light that is smooth over at least twice as many pixels is computed on a reduced picture.
_FINEST_SIGMA = 4.0
# The ground's light is told where this share of what is around is ground.
_LEAST_SPREAD = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Even:
    """How a ground [H, W] is made smooth over `sigma` pixels of a picture that is `reduce` times smaller.

    What is that smooth is known from a reduced picture as well. `spread` is how much of what is around a
    place of that is ground.
    """

    ground: Mask
    reduce: int
    sigma: float
    spread: Floats

    @classmethod
    def of(cls, ground: Mask, *, sigma: float) -> "Even":
        """For a ground [H, W] and so many pixels."""
        reduce = reduction(sigma)
        weight = _reduced(ground.astype(np.float32), reduce)
        sigma = sigma * weight.shape[1] / ground.shape[1]
        return cls(ground, reduce, sigma, np.asarray(cv2.GaussianBlur(weight, (0, 0), sigma), np.float32))

    def smooth(self, values: Floats) -> Floats:
        """The ground's values [H, W] made smooth, and those of the nearest where it is none."""
        return self.enlarged(self.reduced(values))

    def reduced(self, values: Floats) -> Floats:
        """The same on the reduced picture."""
        known = _reduced(np.where(self.ground, values, np.float32(0)), self.reduce)
        even = cv2.GaussianBlur(known, (0, 0), self.sigma) / np.maximum(self.spread, 1e-4)
        return filled(np.asarray(even, np.float32)[:, :, None], self.spread > _LEAST_SPREAD)[:, :, 0]

    def enlarged(self, even: Floats) -> Floats:
        """What is smooth on the reduced picture on the whole one [H, W]."""
        if self.reduce == 1:
            return even
        return np.asarray(
            cv2.resize(even, self.ground.shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32
        )


def reduction(sigma: float) -> int:
    """How many times smaller a picture may be on which what is smooth over so many pixels is computed."""
    return 2 ** max(0, int(np.log2(sigma / _FINEST_SIGMA)))


def _reduced(values: Floats, reduce: int) -> Floats:
    if reduce == 1:
        return values
    size = tuple(max(1, -(-side // reduce)) for side in values.shape[::-1])
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), np.float32)

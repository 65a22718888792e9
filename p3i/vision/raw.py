"""What an extractor gives before normalisation."""

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True, slots=True, eq=False)
class RawFeatures:
    """Features as an extractor computes them.

    values float32 [C, H, W]; valid bool [H, W]: False where an unknown pixel, or the world beyond the frame,
    contributes; `stride`: pixels of the given image per pixel of the map. Map pixel u has its centre at the
    image point (u + 0.5) * stride - 0.5.
    """

    values: Tensor
    valid: Tensor
    stride: float

"""From the contrast of cells or objects to a score: less where they are few, or beside their place."""

import math

import torch

FEW = 6
"""What so many cells explain, chance explains too; on a curve fewer, as there are fewer curves."""
_FEW_ON_CURVE = 3
# So much agreement is found on some curve of every photo.
_CHANCE_OF_CURVE = 0.1
# A misfit of the objects' places beyond this one counts like it.
_WORST_MISFIT = 3.0


def score_of(contrast: torch.Tensor) -> float:
    """The normalised score, 0 to 1, of cells with this contrast [N].

    Few cells agree by chance, and eight numbers are fitted to them.
    """
    return max(0.0, mean_contrast(contrast) * (1 - FEW / max(len(contrast), FEW)))


def score_of_curve(quality: float, count: int) -> float:
    """The normalised score, 0 to 1, of `count` objects on a curve; `quality` is at most their mean contrast.

    On any photo some ring can be found that agrees a little; that much is taken off, so that one limit serves
    all structures (docs/benchmarks.md says what it was calibrated on).
    """
    sure = quality * (1 - _FEW_ON_CURVE / max(count, _FEW_ON_CURVE))
    return max(0.0, (sure - _CHANCE_OF_CURVE) / (1 - _CHANCE_OF_CURVE))


def mean_contrast(contrast: torch.Tensor) -> float:
    """The mean of the contrast [N] of cells or objects, 0 where there are none.

    One that looks more like its half-way neighbour speaks against the pattern, but by half only, since
    something may lie on it.
    """
    if len(contrast) == 0:
        return 0.0
    return float((contrast.clamp(min=0) + 0.5 * contrast.clamp(max=0)).mean())


def placed_right(mean: float, misfit: float) -> float:
    """A mean contrast, less where the objects do not stand where the program draws (`patches.misfit`)."""
    return mean * math.exp(-min(misfit, _WORST_MISFIT))

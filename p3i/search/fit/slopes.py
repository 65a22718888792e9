"""How points move with the numbers that place them: central differences, all numbers in one batch.

The generator is differentiable, and torch.func.jacfwd goes through it; for ten numbers and a thousand points
that costs ten times as much as one call with all numbers nudged, which in double precision is as good.
"""

from collections.abc import Callable

import torch
from torch import Tensor

# The share of a limit by which a number is nudged.
_NUDGE = 1e-4


def with_slopes(
    points_of: Callable[[Tensor], Tensor], numbers: Tensor, limits: Tensor
) -> tuple[Tensor, Tensor]:
    """The points [N, 2] at `numbers` [V], and their slopes [N, 2, V] by a step of each number's limit [V].

    `points_of` takes numbers [..., V] to points [..., N, 2], in double precision.
    """
    nudges = torch.diag(_NUDGE * limits)
    nudges = torch.cat([torch.zeros_like(numbers)[None], nudges, -nudges])
    seen = points_of(numbers + nudges)
    points, (ahead, behind) = seen[0], seen[1:].chunk(2)
    # A number that is held has no slope, not the last bits in which equal points of a batch may differ.
    slopes = (ahead - behind) / (2 * _NUDGE) * (limits != 0)[:, None, None]
    return points, slopes.permute(1, 2, 0)

"""What is the picture's own grid, and no pattern on a plane: the blocks of its compression, enlarged pixels.

JPEG codes blocks of eight pixels and leaves edges between them; an enlarged picture has its extremes where
the small one's pixels were. Both come again exactly, in squares along the picture's sides, all over it. But
they do so in where edges are, not in what the colours are: each block shows something else.
"""

import math

import torch
from torch import Tensor

# Objects this near to the corners of such squares, in sides (root mean square), lie on them; by chance they
# are off by 0.4.
_NEAR = 0.15
# A step goes over so many squares at most, to the side and down.
_MOST_SQUARES = 3
# Squares are no larger than two blocks, which one value of halved colours covers. Larger ones along the sides
# are a board that faces the camera.
_MOST_SIDE_PX = 17.0


def on_own_grid(points_px: Tensor, index: Tensor) -> bool:
    """Whether draws `index` [N, 2] at pixels [N, 2] are corners of even squares along the picture's sides."""
    terms = torch.cat([torch.ones(len(index), 1, dtype=index.dtype), index], 1)
    steps = torch.linalg.lstsq(terms, points_px, driver="gelsd").solution[1:]  # of i and j, [2, 2]
    for part in range(1, _MOST_SQUARES + 1):
        squares = (part * steps / steps.abs().max()).round()
        side = float((steps * squares).sum() / squares.square().sum())
        if not 0 < side <= _MOST_SIDE_PX or math.gcd(*squares.int().flatten().tolist()) > 1:
            continue
        away = points_px - index @ (side * squares)
        if float((away - away.mean(0)).square().sum(1).mean().sqrt()) < _NEAR * side:
            return True
    return False

"""What is the picture's own grid, and no pattern on a plane: the blocks of its compression, enlarged pixels.

JPEG codes blocks of eight pixels and leaves edges between them; an enlarged picture has its extremes where
the small one's pixels were. Both come again exactly, in squares along the picture's sides, all over it. But
they do so in where edges are, not in what the colours are: each block shows something else.
"""

import torch
from torch import Tensor

# Objects this near to the corners of such squares, in sides (root mean square), lie on them; by chance they
# are off by 0.4.
_NEAR = 0.15
# A step goes over so many squares at most, to the side and down.
_MOST_SQUARES = 3


def on_own_grid(points_px: Tensor, index: Tensor) -> bool:
    """Whether draws `index` [N, 2] at pixels [N, 2] are corners of even squares along the picture's sides."""
    terms = torch.cat([torch.ones(len(index), 1, dtype=index.dtype), index], 1)
    steps = torch.linalg.lstsq(terms, points_px, driver="gelsd").solution[1:]  # of i and j, [2, 2]
    for part in range(1, _MOST_SQUARES + 1):
        squares = (part * steps / steps.abs().max()).round()
        side = float((steps * squares).sum() / squares.square().sum())
        away = points_px - index @ (side * squares)
        if side > 0 and float((away - away.mean(0)).square().sum(1).mean().sqrt()) < _NEAR * side:
            return True
    return False

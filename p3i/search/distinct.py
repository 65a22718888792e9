"""Which answers say the same in other words: programs compared by where their objects lie on the photo."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.size import Size
from p3i.vision.warp import in_frame

# Objects are the same where they lie within this share of the step to the next object; two programs are,
# where more than this share of the objects of each is an object of the other.
_SAME_PLACE = 0.25
_SAME_SET = 0.9
# Of more objects so many are compared.
_MOST_COMPARED = 2000


def distinct_answers(answers: Sequence[Answer], *, size: Size, focal_mm: float) -> list[Answer]:
    """The answers in order, without those that mean the same as an earlier one.

    `focal_mm` is the focal that was assumed, for answers without one of their own. Answers that draw nothing
    on the photo all mean the same.
    """
    kept: list[tuple[Answer, Tensor]] = []
    for answer in answers:
        places = _places(answer, size=size, focal_mm=answer.focal_mm or focal_mm)
        if not any(same_meaning(places, others) for _, others in kept):
            kept.append((answer, places))
    return [answer for answer, _ in kept]


def same_meaning(first: Tensor, second: Tensor) -> bool:
    """Whether two sets of points, [N, 2] and [M, 2] in pixels, are the same objects."""
    if len(first) == 0 or len(second) == 0:
        return len(first) == len(second)
    apart = torch.cdist(first, second)
    return _covered(first, apart.amin(1)) > _SAME_SET and _covered(second, apart.amin(0)) > _SAME_SET


def _covered(points: Tensor, distance: Tensor) -> float:
    """The share of points [N, 2] whose `distance` [N] is small beside their own spacing."""
    if len(points) < 2:
        return float((distance < 1).double().mean())
    own = torch.cdist(points, points)
    own.fill_diagonal_(torch.inf)
    return float((distance < _SAME_PLACE * own.amin(1)).double().mean())


def _places(answer: Answer, *, size: Size, focal_mm: float) -> Tensor:
    """The objects of an answer on the photo [N, 2] in pixels, each once."""
    points, in_front = compile(answer.program).centers_px(size=size, focal_mm=focal_mm)
    seen = points[in_front & in_frame(points, size)]
    _, first = np.unique(np.round(seen.numpy(), 3), axis=0, return_index=True)
    seen = seen[torch.from_numpy(np.sort(first))]
    return seen[:: len(seen) // _MOST_COMPARED + 1]

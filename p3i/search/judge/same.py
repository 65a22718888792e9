"""Which answers say the same in other words: programs compared by where their objects lie on the photo."""

from collections.abc import Sequence

import torch
from torch import Tensor

from p3i.search.answer import Answer
from p3i.search.judge.region import objects_px
from p3i.search.look.thinned import thinned
from p3i.vision.image import Image

# Objects are the same where they lie within this share of the step to the next object; two programs are,
# where more than this share of the objects of each is an object of the other.
_SAME_PLACE = 0.25
_SAME_SET = 0.9
# So many distances are looked at: of many objects a part is compared, each with all of the other answer.
_MOST_DISTANCES = 4_000_000


def distinct_answers(answers: Sequence[Answer], *, image: Image, focal_mm: float) -> list[Answer]:
    """The answers in order, without those that mean the same as an earlier one.

    `focal_mm` is the focal that was assumed, for answers without one of their own. Answers that draw nothing
    on the photo all mean the same.
    """
    kept: list[tuple[Answer, Tensor]] = []
    for answer in answers:
        objects = torch.from_numpy(objects_px(answer, image, focal_mm))
        if not any(_same_meaning(objects, others) for _, others in kept):
            kept.append((answer, objects))
    return [answer for answer, _ in kept]


def _same_meaning(first: Tensor, second: Tensor) -> bool:
    """Whether two sets of objects (x, y, i, j) [N, 4] are the same."""
    if len(first) == 0 or len(second) == 0:
        return len(first) == len(second)
    return _covered(first, second) > _SAME_SET and _covered(second, first) > _SAME_SET


def _covered(objects: Tensor, others: Tensor) -> float:
    """The share of objects at which others lie: so near, beside their own spacing, as to be the same."""
    points = objects[:, :2]
    some = thinned(objects[:, 2:], max(1, _MOST_DISTANCES // max(len(objects), len(others))))
    distance = torch.cdist(points[some], others[:, :2]).amin(1)
    if len(points) < 2:
        return float((distance < 1).double().mean())
    own = torch.cdist(points[some], points)
    own[torch.arange(len(some)), some] = torch.inf
    return float((distance < _SAME_PLACE * own.amin(1)).double().mean())

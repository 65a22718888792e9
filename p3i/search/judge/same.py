"""Which answers say the same in other words: programs compared by where their objects lie on the photo."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.judge.region import photo_points
from p3i.search.look.thinned import thinned
from p3i.size import Size
from p3i.vision.warp import in_frame

# Objects are the same where they lie within this share of the step to the next object; two programs are,
# where more than this share of the objects of each is an object of the other.
_SAME_PLACE = 0.25
_SAME_SET = 0.9
# Of more objects so many are compared.
_MOST_COMPARED = 2000
# ... each with all of the other answer, so many distances at most.
_MOST_DISTANCES = 4_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Objects on a photo: `points` [N, 2] in pixels, `index` [N, 2] their loop indices."""

    points: Tensor
    index: Tensor


def distinct_answers(answers: Sequence[Answer], *, size: Size, focal_mm: float) -> list[Answer]:
    """The answers in order, without those that mean the same as an earlier one.

    `focal_mm` is the focal that was assumed, for answers without one of their own. Answers that draw nothing
    on the photo all mean the same.
    """
    kept: list[tuple[Answer, Places]] = []
    for answer in answers:
        places = places_of(answer, size=size, focal_mm=answer.focal_mm or focal_mm)
        if not any(same_meaning(places, others) for _, others in kept):
            kept.append((answer, places))
    return [answer for answer, _ in kept]


def same_meaning(first: Places, second: Places) -> bool:
    """Whether two sets of places are the same objects."""
    if len(first.points) == 0 or len(second.points) == 0:
        return len(first.points) == len(second.points)
    return _covered(first, second) > _SAME_SET and _covered(second, first) > _SAME_SET


def _covered(places: Places, others: Places) -> float:
    """The share of places at which others lie: so near, beside the places' own spacing, as to be the same."""
    most = min(_MOST_COMPARED, max(1, _MOST_DISTANCES // max(len(places.points), len(others.points))))
    some = thinned(places.index, most)
    distance = torch.cdist(places.points[some], others.points).amin(1)
    if len(places.points) < 2:
        return float((distance < 1).double().mean())
    own = torch.cdist(places.points[some], places.points)
    own[torch.arange(len(some)), some] = torch.inf
    return float((distance < _SAME_PLACE * own.amin(1)).double().mean())


def places_of(answer: Answer, *, size: Size, focal_mm: float) -> Places:
    """The objects of an answer on the photo, each once."""
    pattern = compile(answer.program)
    points, shown = photo_points(answer.program, pattern.centers(), size, focal_mm, lens_k1=answer.lens_k1)
    seen = shown & in_frame(points, size)
    points, index = points[seen], pattern.index[seen]
    _, first = np.unique(np.round(points.numpy(), 3), axis=0, return_index=True)
    once = torch.from_numpy(np.sort(first))
    return Places(points[once], index[once])

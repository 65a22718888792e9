"""Numbers as they are printed: as few digits, and terms, as leave every object where it is.

The numbers are rounded one after the other, and the rest makes up for it as well as it can: a tilt and a step
may stand in for each other, so each alone needs few digits. Objects move by less than a tenth of what the
places of single objects are known to.

Convention: V numbers z [V] of a program (`forms/whole.py`), points in photo pixels.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from p3i.grammar.leaves import with_leaves
from p3i.interp.camera import project
from p3i.search.answer import Answer
from p3i.search.fit.robust import inverse
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.whole import whole_filling
from p3i.search.look.evidence import Evidence

MOST_PX = 0.05
"""No object moves by more than so many pixels when numbers are rounded."""


def briefly(evidence: Evidence, answer: Answer) -> Answer:
    """The answer with its numbers written as precisely as a photo can tell; what is 0 stays 0."""
    filling, numbers = whole_filling(answer.program)
    pattern, size, focal_mm = filling.pattern, evidence.image.size, answer.focal_mm or evidence.focal_mm
    index = pattern.index[evidence.in_sight(pattern, filling.theta(numbers), focal_mm=focal_mm)].double()
    if len(index) == 0:
        return answer

    def points_of(z: Tensor) -> Tensor:
        theta = filling.theta(z)
        matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
        return project(matrix, pattern.points_at(index, theta))[0]

    _, slopes = with_slopes(points_of, numbers, (numbers != 0).double())
    digits = [ANGLE_DIGITS if one.name.startswith("camera.") else LENGTH_DIGITS for one in filling.moving]
    values = rounded(numbers, slopes, digits=digits).tolist()
    written = {path: value for one, value in zip(filling.moving, values, strict=True) for path in one.paths}
    return replace(answer, program=with_leaves(answer.program, written))


def rounded(numbers: Tensor, slopes: Tensor, *, digits: list[int]) -> Tensor:
    """The numbers z [V] with as few decimals as MOST_PX allows, at most `digits` [V] of them.

    `slopes` [N, 2, V] say how the points that must stay move with the numbers, 0 for one that is kept.
    """
    found, spread = numbers, inverse(torch.einsum("nip,niq->pq", slopes, slopes))
    moving = [k for k in range(len(numbers)) if bool(slopes[..., k].any())]
    for k in sorted(moving, key=lambda k: abs(float(numbers[k])) / max(float(spread[k, k]), 1e-30) ** 0.5):
        # How the others move as this one does, so that points move least.
        pull = spread[:, k] / spread[k, k].clamp(min=1e-30)
        moves_px = float((slopes @ pull).norm(dim=1).max())
        most = MOST_PX / len(moving) / max(moves_px, 1e-12)
        decimals = min(max(0, math.ceil(-math.log10(2 * most))), digits[k])
        value = float(found[k])
        change = (0.0 if abs(value) <= most else round(value, decimals)) - value
        found, spread = found + pull * change, spread - torch.outer(pull, spread[k])
        found[k] = value + change
    return found

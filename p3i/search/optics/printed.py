"""Numbers as they are printed: as few digits as the fit has, and no term that is only noise.

What an answer's numbers are known to is the covariance of `optics/tilt.py`. Alone each is known badly, since
a tilt and a step can make up for each other; so they are rounded one after the other, and the rest moves to
where it is likeliest given what was fixed. A number that is off by d has moved the whole by d / sigma, with
sigma its standard deviation given those before it; and by Cauchy and Schwarz no object moves by more than the
root of the sum of these squares, in its own standard deviations.

Convention: V free numbers z [V] of a program (`forms/whole.py`), covariance [V, V], points in photo pixels.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from p3i.grammar.leaves import with_leaves
from p3i.interp.camera import project
from p3i.search.answer import Answer
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.whole import whole_filling
from p3i.search.judge.evaluate import without_lens
from p3i.search.look.evidence import Evidence
from p3i.search.optics.tilt import covariance_of_program

MOST_SIGMAS = 0.1
"""No object moves by more than this share of its standard deviation when numbers are rounded, ..."""
MOST_PX = 0.05
"""... nor by more than so many pixels; terms below their own deviation are left out within that."""


def as_precise_as_fitted(evidence: Evidence, answer: Answer) -> Answer:
    """The answer with its numbers written as precisely as the photo tells them, and no more.

    `evidence` is of the photo as it was taken. What is 0 stays 0. The answer itself where the photo shows too
    few objects to say.
    """
    evidence = evidence.under(answer.focal_mm or evidence.focal_mm)
    free, program = without_lens(evidence, answer.program, answer.lens_k1)
    known = covariance_of_program(free, program)
    if known is None:
        return answer
    filling, numbers = whole_filling(answer.program)
    size, focal_mm = evidence.image.size, evidence.focal_mm
    # The lens straightens the photo on a larger canvas: what is a length there is shorter in the program.
    lengths = torch.tensor([0.0 if _is_angle(one.name) else 1.0 for one in filling.moving]).double()
    share = free.image.size.unit_px / size.unit_px
    covariance = known * torch.outer(share**lengths, share**lengths)
    moving = [k for k, value in enumerate(numbers.tolist()) if value != 0]
    pattern = filling.pattern
    index = pattern.index[evidence.in_sight(pattern, filling.theta(numbers), focal_mm=focal_mm)].double()
    if len(index) == 0:
        return answer

    def spread_over(part: Tensor) -> Tensor:
        full = numbers.expand(*part.shape[:-1], -1).clone()
        full[..., moving] = part
        return full

    def points_of(part: Tensor) -> Tensor:
        theta = filling.theta(spread_over(part))
        matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
        return project(matrix, pattern.points_at(index, theta))[0]

    names = [filling.moving[k].name for k in moving]
    found = rounded(
        numbers[moving],
        _among(covariance, moving),
        digits=[ANGLE_DIGITS if name.startswith("camera.") else LENGTH_DIGITS for name in names],
        droppable=[name.startswith("draw.") and ".angle." not in name for name in names],
        points_of=points_of,
    )
    values = spread_over(found).tolist()
    written = {path: value for one, value in zip(filling.moving, values, strict=True) for path in one.paths}
    return replace(answer, program=with_leaves(answer.program, written))


def rounded(
    numbers: Tensor,
    covariance: Tensor,
    *,
    digits: list[int],
    droppable: list[bool],
    points_of: Callable[[Tensor], Tensor],
) -> Tensor:
    """The numbers z [V] with as few decimals as MOST_SIGMAS and MOST_PX allow, at most `digits` [V] of them.

    `droppable` [V]: which are terms that go where they are below their own deviation; `points_of` takes z
    [..., V] to the points [..., N, 2] that must stay.
    """
    start = points_of(numbers)
    found, spread = numbers, covariance
    fixed: set[int] = set()
    for k in sorted(range(len(numbers)), key=lambda k: abs(float(numbers[k])) / _sigma(covariance, k)):
        if droppable[k] and abs(float(found[k])) < _sigma(spread, k):
            tried, left = _moved(found, spread, k, 0.0)
            if float((points_of(tried) - start).norm(dim=1).max()) <= MOST_PX / 2:
                found, spread = tried, left
                fixed.add(k)
    rest = [k for k in range(len(numbers)) if k not in fixed]
    _, slopes = with_slopes(points_of, found, torch.ones_like(found))
    for k in rest:
        sigma = _sigma(spread, k)
        moves_px = float((slopes @ (spread[:, k] / sigma**2)).norm(dim=1).max())
        most = min(MOST_SIGMAS * sigma / len(rest) ** 0.5, MOST_PX / 2 / max(moves_px, 1e-12) / len(rest))
        decimals = min(max(0, math.ceil(-math.log10(2 * most))), digits[k])
        found, spread = _moved(found, spread, k, round(float(found[k]), decimals))
    return found


def _moved(numbers: Tensor, spread: Tensor, k: int, value: float) -> tuple[Tensor, Tensor]:
    """The likeliest numbers [V] and their covariance [V, V] once number k is fixed at `value`."""
    pull = spread[:, k] / spread[k, k].clamp(min=1e-30)
    moved = numbers + pull * (value - numbers[k])
    moved[k] = value
    return moved, spread - torch.outer(pull, spread[k])


def _sigma(spread: Tensor, k: int) -> float:
    return math.sqrt(max(float(spread[k, k]), 1e-30))


def _among(covariance: Tensor, which: list[int]) -> Tensor:
    """The covariance of some numbers while the others stay."""
    return torch.linalg.inv(torch.linalg.inv(covariance)[which][:, which])


def _is_angle(name: str) -> bool:
    return name.startswith("camera.") or ".angle." in name

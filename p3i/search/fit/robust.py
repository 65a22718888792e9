"""Numbers fitted to places: Gauss-Newton, whatever they place, under a noise whose scale the places show.

    length = sum over the places of ln s^2 + 3 ln(1 + r^2 / 4 s^2)

with r a residual in units of noise, and s the scale that the residuals themselves show: a Student t of 4
degrees of freedom in the picture's two directions (Lange, Little and Taylor 1989), under which what stands
off its plane has little to say. Neighbours that stray alike are no independent witnesses: a lens, or a page
that is not flat, makes many places say no more than a few.

Convention: N places in pixels, V numbers; a step moves each number by its limit [V] at most, 0 holds it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import Filling

MOST_TURN_DEG = 4.0
"""One step moves the camera by at most so many degrees, ..."""
# ... and any other number by at most this share of the pattern's step.
_MOST_CHANGE = 0.08
# Degrees of freedom of the noise. Of its scale it says (4 + 2) / (4 + 4) of what a Gaussian would.
_TAIL = 4.0
# The scale of residuals in units of noise: where to begin, and the least that is believed, which is a
# fiftieth of a pixel; interpolation between pixels is no better.
_VARIANCE, _LEAST_VARIANCE = 0.25, 0.0044
_MOST_STEPS, _SCALINGS = 20, 5
SETTLED = 3e-3
"""A fit ends with a step this small against the most that one may be."""
_MOST_ALIKE = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Numbers [V] fitted to places, and what is left of the residuals.

    `information` [V, V]: what the places say of the numbers, the inverse of a covariance, if they are
    independent; as many residuals as there are numbers are fitted by any. `length` is their code length in
    nats, but for what all fits share; `alike` how much of a residual is its neighbour's.
    """

    numbers: Tensor
    information: Tensor
    length: float
    alike: float

    def share(self, *, each: float, directions: int) -> float:
        """How many independent witnesses an object is that stands for `each`, of a pattern in `directions`.

        As in a chain of which each link remembers a share of the one before.
        """
        alike = self.alike ** (each ** (-1 / directions))
        return each * ((1 - alike) / (1 + alike)) ** directions

    def covariance(self, share: float, known: Tensor) -> Tensor:
        """The numbers' covariance [V, V]; `known` [V] is what else is known of each, as 1 / variance."""
        return inverse(share * self.information + torch.diag(known))


def fitted(
    points_of: Callable[[Tensor], Tensor],
    start: Tensor,
    *,
    places: Tensor,
    whiten: Tensor,
    weights: Tensor,
    limits: Tensor,
    mean: Tensor | None = None,
    known: Tensor | None = None,
) -> Fitted:
    """Numbers moved from `start` [V] until points fall on their places [N, 2].

    `points_of` takes numbers [..., V] to points [..., N, 2]; `whiten` [N, 2, 2] takes a difference of points
    to one in units of its noise; of `weights` [N] only the proportions matter; `mean` and `known` [V] are
    what is known of the numbers beforehand, and as 1 / variance.
    """
    weights = weights / weights.mean()
    mean, known = (torch.zeros_like(start) if one is None else one for one in (mean, known))
    numbers, variance, steps = start, _VARIANCE, 0
    while True:
        points, slopes = with_slopes(points_of, numbers, limits)
        residual = (whiten @ (points - places)[..., None])[..., 0]
        rows = whiten @ slopes
        robust, variance = _weighed(residual, weights, variance)
        weighed = (rows * (robust / variance)[:, None, None]).flatten(0, 1).mT
        information, slope = weighed @ rows.flatten(0, 1), weighed @ residual.flatten()
        slope = slope + known * (numbers - mean) * limits
        # A direction in which even the longest step moves places by less than their noise is hardly followed.
        step = -inverse(information + torch.diag(known * limits**2 + 1)) @ slope
        worst = float(step.abs().max())
        if steps == _MOST_STEPS or not math.isfinite(worst) or worst < SETTLED:
            break
        numbers = numbers + step * limits / max(1.0, worst)
        steps += 1
    squared = residual.square().sum(1)
    each = math.log(variance) + (_TAIL + 2) / 2 * (1 + squared / (_TAIL * variance)).log()
    spare = max(1 - len(numbers) / (2 * len(places)), 0.0)
    units = torch.where(limits > 0, limits, 1.0)
    return Fitted(
        numbers,
        spare * (_TAIL + 2) / (_TAIL + 4) * information / torch.outer(units, units),
        float((weights * each).sum()),
        _alike(points, residual * robust.sqrt()[:, None]),
    )


def step_limits(pattern: Pattern, theta: Tensor, *, fixed: frozenset[str] = frozenset()) -> Tensor:
    """The most that one step may move each number of theta [P]: [P], 0 for the fixed ones.

    Zeros that scale a loop variable may move too: the limit comes from the largest number of their kind.
    """
    values = dict(zip(pattern.paths, theta.tolist(), strict=True))

    def limit(path: str) -> float:
        if path in fixed:
            return 0.0
        if path.startswith("camera."):
            return MOST_TURN_DEG
        variable = path.rsplit(".", 1)[1]
        # A constant may move as far as the loops' own steps.
        alike = ("i", "j") if variable == "1" else (variable,)
        steps = [abs(value) for name, value in values.items() if name.rsplit(".", 1)[1] in alike]
        return _MOST_CHANGE * max(*steps, 1e-3)

    return torch.tensor([limit(path) for path in pattern.paths], dtype=torch.float64)


def moving_limits(filling: Filling, z: Tensor) -> Tensor:
    """The most that one step may move each number of a filling, z [F]: [F], as `step_limits`."""
    limits = step_limits(filling.pattern, filling.theta(z)).tolist()
    named = dict(zip(filling.pattern.paths, limits, strict=True))
    return torch.tensor([named[unknown.name] for unknown in filling.moving], dtype=torch.float64)


def inverse(matrix: Tensor) -> Tensor:
    """The inverse of information [V, V], whose empty directions stay as good as unknown."""
    scale = matrix.diagonal().clamp(min=1e-12).rsqrt()
    even = matrix * scale[:, None] * scale + 1e-9 * torch.eye(len(matrix), dtype=matrix.dtype)
    return torch.linalg.inv(even) * scale[:, None] * scale


def _weighed(residual: Tensor, certainty: Tensor, variance: float) -> tuple[Tensor, float]:
    """What places [N] count whose residuals are [N, 2], and the variance of these: a few steps of EM."""
    squared = residual.square().sum(1)
    weights = certainty
    for _ in range(_SCALINGS):
        weights = certainty * (_TAIL + 2) / (_TAIL + squared / variance)
        variance = max(float((weights * squared).sum()) / (2 * len(squared)), _LEAST_VARIANCE)
    return weights, variance


def _alike(points: Tensor, left: Tensor) -> float:
    """How much residuals `left` [N, 2] are those of their neighbours, 0 to _MOST_ALIKE."""
    apart = torch.cdist(points, points).fill_diagonal_(torch.inf)
    shared = float((left * left[apart.argmin(1)]).sum() / left.square().sum().clamp(min=1e-12))
    # By chance they share 0, give or take the root of 1 / N; less than that is nothing.
    chance = 1 / math.sqrt(len(points))
    return 0.0 if shared <= chance else min(shared * (1 - (chance / shared) ** 2), _MOST_ALIKE)

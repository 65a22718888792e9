"""Refinement: Gauss-Newton on the difference of all cells from their mean.

Equation 2 compares neighbours only. Here every cell is compared with the mean of all, which is the same as
comparing all pairs: the pairs that lie far apart are what makes the pose precise. How each sample moves with
the numbers comes from the compiled generator, so any sketch refines the same way.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import Filling
from p3i.search.look.cells import sample_grid, sample_points
from p3i.search.look.evidence import Level
from p3i.vision.warp import sample, sample_valid

MOST_TURN_DEG = 4.0
"""One step moves the camera by at most so many degrees, ..."""
# ... and any other number by at most this share of the pattern's step.
_MOST_CHANGE = 0.08
# A step this small against those limits ends the refinement.
_CONVERGED = 2e-3
# Levenberg damping, relative to the diagonal.
_DAMPING = 1e-3
# Residuals beyond twice their median count less and less (a Cauchy weight).
_ROBUST_SCALE = 2.0


@dataclass(frozen=True, slots=True)
class FreeNumbers:
    """Which numbers of theta a refinement may move: their places, and the scale of each one's step."""

    places: tuple[int, ...]
    limits: tuple[float, ...]

    def of(self, theta: Tensor) -> Tensor:
        """The free numbers of theta [P]: [V]."""
        return theta[list(self.places)]

    def into(self, theta: Tensor, moving: Tensor) -> Tensor:
        """theta [P] with these numbers [..., V] in the free places: [..., P]."""
        selector = torch.eye(len(theta), dtype=theta.dtype)[list(self.places)]
        return theta + (moving - self.of(theta)) @ selector


def free_numbers(pattern: Pattern, theta: Tensor, *, fixed: frozenset[str] = frozenset()) -> FreeNumbers:
    """All numbers of theta [P] but the fixed ones, each with the most that one step may move it.

    Zeros that scale a loop variable are free too: the limit comes from the largest number of their kind.
    """
    places, limits = [], []
    values = dict(zip(pattern.paths, theta.tolist(), strict=True))
    for place, path in enumerate(pattern.paths):
        if path in fixed:
            continue
        if path.startswith("camera."):
            limit = MOST_TURN_DEG
        else:
            variable = path.rsplit(".", 1)[1]
            # A constant may move as far as the loops' own steps.
            alike = ("i", "j") if variable == "1" else (variable,)
            steps = [abs(value) for name, value in values.items() if name.rsplit(".", 1)[1] in alike]
            limit = _MOST_CHANGE * max(*steps, 1e-3)
        places.append(place)
        limits.append(limit)
    return FreeNumbers(tuple(places), tuple(limits))


def step_limits(filling: Filling, theta: Tensor) -> list[float]:
    """The most that one step may move each moving number of a filling, [F]: `free_numbers` at theta [P]."""
    limits = dict(zip(filling.pattern.paths, free_numbers(filling.pattern, theta).limits, strict=True))
    return [limits[unknown.name] for unknown in filling.moving]


def refine(
    level: Level,
    pattern: Pattern,
    theta: Tensor,
    *,
    index: Tensor,
    weights: Tensor,
    fixed: frozenset[str],
    iterations: int = 4,
) -> Tensor:
    """Move theta [P] so that the cells around `index` [N, 2] look alike; returns the new theta.

    `weights` [N] say how much each cell counts. `fixed` names the numbers that stay: those that shift all
    cells alike (the phase) must, since looking alike does not fix them.
    """
    grid = sample_grid()
    at = (index[:, None, :] + grid[None]).reshape(-1, 2)
    free = free_numbers(pattern, theta, fixed=fixed)
    limits = torch.tensor(free.limits, dtype=torch.float64)
    shape = (len(index), len(grid))

    def points_of(moving: Tensor) -> Tensor:
        return sample_points(level, pattern, free.into(theta, moving), at)[0]

    for _ in range(iterations):
        points, slopes = with_slopes(points_of, free.of(theta), limits)
        in_front = sample_points(level, pattern, theta, at)[1]
        points = points.float()
        known = (sample_valid(level.valid, points) & in_front).reshape(shape)
        read = sample(level.stack, points).reshape(*shape, 3, level.channels)
        step = _step(
            read[:, :, 0],
            read[:, :, 1:],
            slopes.float().reshape(*shape, 2, len(limits)),
            known * weights[:, None].float(),
        ).double()
        if not bool(torch.isfinite(step).all()):
            break
        worst = float(step.abs().max())
        theta = free.into(theta, free.of(theta) + step * limits / max(1.0, worst))
        if worst < _CONVERGED:
            break
    return theta


def _step(values: Tensor, slopes: Tensor, jacobian: Tensor, weights: Tensor) -> Tensor:
    """One damped Gauss-Newton step [P], in units of those that the jacobian is by.

    values [N, K, C]; slopes [N, K, 2, C] per map pixel; jacobian [N, K, 2, P] in map pixels; weights [N, K].
    """
    residual = values - _mean(values, weights)
    squared = residual.square().sum(-1)
    typical = squared[weights > 0].median() if bool((weights > 0).any()) else squared.new_ones(())
    weights = weights / (1 + squared / (_ROBUST_SCALE**2 * typical + 1e-6))
    residual = values - _mean(values, weights)
    rows = torch.einsum("nkdc,nkdp->nkcp", slopes, jacobian)
    rows = rows - _mean(rows, weights)  # the mean cell moves along
    root = weights.sqrt()[..., None]
    rows = (rows * root[..., None]).reshape(-1, jacobian.shape[-1]).double()
    normal = rows.T @ rows
    right = rows.T @ (residual * root).reshape(-1).double()
    damped = normal + torch.diag(_DAMPING * normal.diagonal() + 1e-9 * normal.diagonal().max() + 1e-12)
    return -torch.linalg.solve(damped, right)


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    """The weighted mean over the cells: values [N, K, ...], weights [N, K] -> [K, ...]."""
    total = weights.sum(0).clamp(min=1e-6)
    flat = values.reshape(*weights.shape, -1)
    mean = torch.einsum("nk,nkf->kf", weights, flat) / total[:, None]
    return mean.reshape(values.shape[1:])

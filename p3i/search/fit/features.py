"""Refinement: Gauss-Newton on the difference of all cells from their mean.

Equation 2 compares neighbours only. Here every cell is compared with the mean of all, which is the same as
comparing all pairs: the pairs that lie far apart are what makes the pose precise. How each sample moves with
the numbers comes from the compiled generator, so any sketch refines the same way.
"""

import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.fit.robust import SETTLED, step_limits
from p3i.search.fit.slopes import with_slopes
from p3i.search.look.cells import sample_grid, sample_points
from p3i.search.look.evidence import Level
from p3i.vision.warp import sample, sample_valid

# Levenberg damping, relative to the diagonal.
_DAMPING = 1e-3
# Residuals beyond so many times what is typical of them count less and less (a Cauchy weight).
_ROBUST_SCALE = 2.0


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
    limits = step_limits(pattern, theta, fixed=fixed)
    shape = (len(index), len(grid))

    def points_of(numbers: Tensor) -> Tensor:
        return sample_points(level, pattern, numbers, at)[0]

    for _ in range(iterations):
        points, slopes = with_slopes(points_of, theta, limits)
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
        theta = theta + step * limits / max(1.0, worst)
        if worst < SETTLED:
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

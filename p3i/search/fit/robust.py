"""The fit of a program to the places of its instances: a small robust least-squares problem.

The compiled generator says how each point moves with the program's numbers, so any sketch is fitted alike.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.fit.features import ROBUST_SCALE, step_limits
from p3i.search.fit.slopes import with_slopes
from p3i.search.look.cells import sample_points
from p3i.search.look.correlate import Instances
from p3i.search.look.evidence import Level

# An offset is known to about this share of a cell, and no better than this many map pixels.
_SHARE_NOISE = 0.02
_PIXEL_NOISE = 0.25


def fit_instances(
    level: Level,
    pattern: Pattern,
    theta: Tensor,
    found: Instances,
    *,
    weights: Tensor,
    iterations: int = 6,
) -> Tensor:
    """Move theta [P] so that the program's points fall on the instances; robust against strays.

    Offsets are compared in index units, so that near and far objects count alike.
    """
    targets, _ = sample_points(level, pattern, theta, found.index + found.offsets)
    inverse, cell = _index_from_map(level, pattern, theta, found.index)
    noise = (_SHARE_NOISE**2 + (_PIXEL_NOISE / cell.clamp(min=1)) ** 2).sqrt()

    return robust_fit(
        lambda numbers: sample_points(level, pattern, numbers, found.index)[0],
        theta,
        targets=targets,
        whiten=inverse / noise[:, None, None],
        weights=weights,
        limits=step_limits(pattern, theta),
        iterations=iterations,
    )


def robust_fit(
    points_of: Callable[[Tensor], Tensor],
    start: Tensor,
    *,
    targets: Tensor,
    whiten: Tensor,
    weights: Tensor,
    limits: Tensor,
    prior: Tensor | None = None,
    iterations: int = 6,
) -> Tensor:
    """Move numbers so that points fall on their targets: Gauss-Newton, strays counting less (`ROBUST_SCALE`).

    `points_of` takes numbers [..., V] to points [..., N, 2], `start` [V] is where to begin, `targets` [N, 2],
    `whiten` [N, 2, 2] takes a difference of points to one in units of its noise, `weights` [N], `limits` [V]
    is the most that a step may move each number, 0 where it is held. `prior` [V, 2], if given, holds a mean
    and a weight (1 / variance) for each number.
    """
    moving = start
    for _ in range(iterations):
        points, slopes = with_slopes(points_of, moving, limits)
        residual = torch.einsum("nij,nj->ni", whiten, points - targets)
        rows = torch.einsum("nij,njp->nip", whiten, slopes)
        distance = residual.square().sum(1)
        weight = (weights / (1 + distance / ROBUST_SCALE**2)).sqrt()
        a = (rows * weight[:, None, None]).reshape(-1, len(start))
        b = (residual * weight[:, None]).reshape(-1)
        normal, slope = a.T @ a, a.T @ b
        if prior is not None:
            mean, certainty = prior[:, 0], prior[:, 1]
            normal = normal + torch.diag(certainty * limits**2)
            slope = slope + certainty * (moving - mean) * limits
        step = -torch.linalg.solve(normal + 1e-6 * torch.diag(normal.diagonal() + 1e-9), slope)
        if not bool(torch.isfinite(step).all()):
            break
        worst = float(step.abs().max())
        moving = moving + step * limits / max(1.0, worst)
        if worst < 1e-3:
            break
    return moving


def _index_from_map(level: Level, pattern: Pattern, theta: Tensor, index: Tensor) -> tuple[Tensor, Tensor]:
    """How index moves with map pixels at each cell [N, 2, 2], and the cell's side in map pixels [N]."""
    half = 0.25
    columns = []
    for step in torch.eye(2, dtype=torch.float64) * half:
        ahead, _ = sample_points(level, pattern, theta, index + step)
        behind, _ = sample_points(level, pattern, theta, index - step)
        columns.append((ahead - behind) / (2 * half))
    matrix = torch.stack(columns, dim=2)
    return torch.linalg.inv(matrix), torch.linalg.det(matrix).abs().sqrt()

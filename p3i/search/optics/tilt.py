"""How well an answer's tilt is known: its standard deviation, from where the objects lie on the photo.

The objects are looked for around the places where the program puts them. How these places move with all of
the program's free numbers, and how far the objects found stray from them, give the numbers' covariance; of
that the plane's normal has its part. A ring seen head-on, or a few small objects, move little under a tilt,
and then the answer's angles say little.

Convention: N objects, V numbers: the free ones of the program (`forms/whole.py`) and, where the pattern was
to tell it, the logarithm of the focal. Points are photo pixels; whitened differences are in units of the
noise that places have (`look/patches.whitening`), of which the residuals then say the true size.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.camera import project
from p3i.search.answer import Answer
from p3i.search.fit.features import step_limits
from p3i.search.fit.places import FOCAL_SPREAD, MOST_ZOOM
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import Filling
from p3i.search.forms.whole import whole_filling
from p3i.search.judge.evaluate import without_lens
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import find_objects, frames, half_steps, spacing, whitening
from p3i.search.look.thinned import thinned

TOLD_DEG = 3.0
"""A tilt that is known no better than this is told of in words."""
# Of more objects so many are looked for; the others are taken to be as these.
_MOST_FOUND = 100
# What is known before anything is seen: tilts are within this (and the focal as in fit/places.py).
_TILT_SPREAD_DEG = 30.0
# Before any residual is seen, places stray half as far as `whitening` says; that counts as so many residuals.
_NOISE_VARIANCE, _NOISE_COUNTS = 0.25, 4.0
_ROUNDS = 3
_MOST_ALIKE = 0.6
# Residuals beyond so many of their own scale count less and less; of plain noise this is the mean weight.
_ROBUST_SCALE, _PLAIN_WEIGHT = 2.0, 0.723


def pose_sigma_deg(evidence: Evidence, answer: Answer) -> float | None:
    """The standard deviation of the angle of the plane's normal, in degrees, for a finished answer.

    `evidence` is of the photo as it was taken. The lens is taken as told, and so is the focal, but for curves
    that were to tell it themselves. At about 42 degrees nothing is known beyond what is taken for granted:
    that people more or less face what they photograph. None where the photo shows fewer than two objects of
    the program.
    """
    evidence = evidence.under(answer.focal_mm or evidence.focal_mm)
    evidence, program = without_lens(evidence, answer.program, answer.lens_k1)
    # A lattice's own focal is that of its cell, taken as a square or another; its places do not tell it.
    free_focal = answer.focal_mm is not None and answer.structure != "lattice"
    known = covariance_of_program(evidence, program, free_focal=free_focal)
    if known is None:
        return None
    # The camera's angles are the first of a program's numbers.
    sigma_deg = sigma_of_normal_deg(known[:2, :2], rx_deg=program.camera.rx_deg)
    return sigma_deg if math.isfinite(sigma_deg) else None


def covariance_of_program(evidence: Evidence, program: Program, *, free_focal: bool = False) -> Tensor | None:
    """The covariance [V, V] of a program's free numbers, as `whole_filling` has them, under evidence's focal.

    With `free_focal` the logarithm of the focal is one more, the last. None where the photo shows fewer than
    two objects.
    """
    whole = whole_filling(program)
    if whole is None:
        return None
    filling, numbers = whole
    theta = filling.theta(numbers)
    pattern, focal_mm = filling.pattern, evidence.focal_mm
    index = pattern.index[evidence.in_sight(pattern, theta, focal_mm=focal_mm)].double()
    if len(index) < 2:
        return None
    return _covariance(evidence, filling, numbers, index, focal_mm=focal_mm, free_focal=free_focal)


def sigma_of_normal_deg(covariance: Tensor, *, rx_deg: float) -> float:
    """The standard deviation of the normal's angle, in degrees, from the covariance [2, 2] of (rx, ry).

    Along ry the normal (`Camera.normal`) moves by cos(rx) of the angle, across that by all of rx.
    """
    rx_variance, ry_variance = covariance.diagonal().clamp(min=0).tolist()
    return math.sqrt(rx_variance + math.cos(math.radians(rx_deg)) ** 2 * ry_variance)


def doubt_note(sigma_deg: float, *, two_tilts: bool) -> str | None:
    """What to say of a tilt that is known so well, None where that is well enough.

    `two_tilts`: the mirrored tilt is as good, and is told of already.
    """
    if sigma_deg < TOLD_DEG:
        return None
    which = "either tilt" if two_tilts else "the tilt"
    return f"{which} is known to about {sigma_deg:.0f} degrees only"


def _covariance(
    evidence: Evidence,
    filling: Filling,
    numbers: Tensor,
    index: Tensor,
    *,
    focal_mm: float,
    free_focal: bool,
) -> Tensor:
    """The covariance [V, V] of the free numbers [F] of a program of which the objects `index` [N, 2] show."""
    pattern, theta, size = filling.pattern, filling.theta(numbers), evidence.image.size
    shown, index = len(index), index[thinned(index, _MOST_FOUND)]
    side = spacing(pattern, theta)
    where = frames(pattern, theta, index, side=side)
    matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
    found = find_objects(
        evidence, pattern, theta, index, torch.ones(len(index)), side=side, focal_mm=focal_mm
    )
    targets, _ = project(matrix, where.points(found.offsets[:, None])[:, 0])
    certainty = found.certainty.double()

    def points_of(moving: Tensor) -> Tensor:
        moved = filling.theta(moving[..., : len(numbers)])
        focal = moving[..., -1].exp() if free_focal else focal_mm
        seen = pattern.image_from_plane(moved, size=size, focal_mm=focal)
        return project(seen, pattern.points_at(index, moved))[0]

    steps = [*step_limits(filling, theta), *([MOST_ZOOM] if free_focal else [])]
    start = torch.cat([numbers, torch.tensor([math.log(focal_mm)] if free_focal else []).double()])
    known = torch.tensor(
        [1 / _TILT_SPREAD_DEG if one.name.startswith("camera.") else 0.0 for one in filling.moving]
        + ([1 / FOCAL_SPREAD] if free_focal else [])
    ).double()
    return covariance_of(
        points_of,
        start,
        limits=torch.tensor(steps).double(),
        targets=targets,
        whiten=whitening(matrix, where),
        weights=certainty,
        known=known.square(),
        each=shown / len(index),
        directions=len(half_steps(pattern)),
    )


def covariance_of(
    points_of: Callable[[Tensor], Tensor],
    numbers: Tensor,
    *,
    limits: Tensor,
    targets: Tensor,
    whiten: Tensor,
    weights: Tensor,
    known: Tensor,
    each: float = 1.0,
    directions: int = 2,
) -> Tensor:
    """The covariance [V, V] of numbers [V] fitted to points, by what a step of least squares leaves.

    Shapes as in `fit/robust.robust_fit`. `known` [V] is what is known of each number beforehand, as 1 /
    variance; each point stands for `each` points alike, of a pattern that runs in so many `directions`.
    The step itself, by which the numbers and the places disagree, counts as an error too.
    """
    points, slopes = with_slopes(points_of, numbers, limits)
    rows = torch.einsum("nij,njp->nip", whiten, slopes)
    residual = torch.einsum("nij,nj->ni", whiten, points - targets)
    prior = torch.diag(known * limits**2)
    seen = weights > 0
    if int(seen.sum()) < 2:  # nothing tells how far objects stray: as `whitening` says
        normal = torch.einsum("nip,niq->pq", rows, rows) * each
        return _inverse(normal + prior) * limits * limits[:, None]
    rows, residual, weights = rows[seen], residual[seen], weights[seen]
    fit = _fitted(rows, residual, weights=weights / weights.mean(), prior=prior)
    normal = torch.einsum("nip,n,niq->pq", rows, fit.weights, rows) * each / _PLAIN_WEIGHT
    alike = _alike(points[seen], fit.left * fit.weights.sqrt()[:, None]) ** (each ** (-1 / directions))
    variance = fit.variance * ((1 + alike) / (1 - alike)) ** directions
    covariance = _inverse(normal / variance + prior) + fit.step[:, None] * fit.step
    return covariance * limits * limits[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """One step of robust least squares.

    `step` [V]; `left` [N, 2], what it leaves of the residuals; the weights [N] of points, strays counting
    less; and the variance of what is left of the others.
    """

    step: Tensor
    left: Tensor
    weights: Tensor
    variance: float


def _fitted(rows: Tensor, residual: Tensor, *, weights: Tensor, prior: Tensor) -> _Fit:
    """The step that fits numbers to points: rows [N, 2, V], residual [N, 2], weights [N], prior [V, V]."""
    degrees = max(2 * len(rows) - len(prior), 0)

    def stepped(robust: Tensor, variance: float) -> _Fit:
        normal = torch.einsum("nip,n,niq->pq", rows, robust, rows)
        slope = torch.einsum("nip,n,ni->p", rows, robust, residual)
        step = -_inverse(normal + variance * prior) @ slope
        left = residual + rows @ step
        squared = left.square().sum(1)
        # Half the median of a chi-square of two degrees is ln 2: strays do not widen it. What the fit takes
        # away of the residuals is given back, and few residuals say little of their size.
        told = float(squared.median()) / (2 * math.log(2)) * 2 * len(rows) / max(degrees, 1)
        variance = (degrees * told + _NOISE_COUNTS * _NOISE_VARIANCE) / (degrees + _NOISE_COUNTS)
        return _Fit(step, left, weights / (1 + squared / (variance * _ROBUST_SCALE**2)), variance)

    fit = stepped(weights, _NOISE_VARIANCE)
    for _ in range(_ROUNDS - 1):
        fit = stepped(fit.weights, fit.variance)
    return fit


def _alike(points: Tensor, left: Tensor) -> float:
    """How much residuals `left` [N, 2] are those of their neighbours, 0 to _MOST_ALIKE.

    A lens, or a plane that is not quite flat, moves neighbours alike: then many objects say no more than a
    few. As in a chain of which each link remembers this share of the one before, n of them count as
    n (1 - share) / (1 + share), in each direction of the pattern.
    """
    apart = torch.cdist(points, points).fill_diagonal_(torch.inf)
    shared = float((left * left[apart.argmin(1)]).sum() / left.square().sum().clamp(min=1e-12))
    # By chance they share 0, give or take the root of 1 / N; less than that is nothing.
    chance = 1 / math.sqrt(len(points))
    return 0.0 if shared <= chance else min(shared * (1 - (chance / shared) ** 2), _MOST_ALIKE)


def _inverse(normal: Tensor) -> Tensor:
    """The inverse of a matrix of normal equations, whose empty directions stay as good as unknown."""
    return torch.linalg.inv(normal + torch.diag(1e-9 * normal.diagonal() + 1e-9))

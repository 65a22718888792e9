"""Fitting programs that draw on curves (rings, rings in rings, any sketch) to the objects on a photo.

Each object is searched for around its place by correlation with the mean patch (patches.py), and the
program's free numbers, the focal among them where it is free, are fitted to the places found.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.search.evidence import Evidence
from p3i.search.fill import Filling
from p3i.search.patches import Frames, find_objects, frames, patch_contrast, spacing
from p3i.search.robust import robust_fit
from p3i.search.score import mean_contrast, score_of_curve

FOCALS_MM = (20.0, 80.0)
"""Within these a focal that nobody stated may go, 35 mm-equivalent."""
# An object's place is known to this share of a patch's side, and no better than this many pixels.
_SHARE_NOISE = 0.03
_PIXEL_NOISE = 0.3
# Spread of the prior on the logarithm of the focal: a phone or a lens from 24 to 50 mm is no surprise.
_FOCAL_SPREAD = 0.35
# One step moves angles by at most so many degrees, lengths by this share of a patch, the focal's logarithm
# by this.
_MOST_TURN_DEG = 4.0
_MOST_SHIFT = 0.4
_MOST_ZOOM = 0.15
_FEWEST = 3
# A misfit of the objects' places beyond this one counts like it.
_WORST = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class CurveFit:
    """A filled sketch on a photo: its free numbers `z` [F], the focal (mm), and how its objects agree.

    `index` [N, 2] are the objects in sight, `contrast` [N] how well each is predicted by the others beyond
    half a step, `side` the patches' side in program units; `cost` the robust misfit of the objects' places.
    """

    filling: Filling
    z: Tensor
    focal_mm: float
    side: float
    index: Tensor
    contrast: Tensor
    cost: float = math.inf

    @property
    def theta(self) -> Tensor:
        """The numbers of the generator, [P]."""
        return self.filling.theta(self.z)

    @property
    def mean(self) -> float:
        """The mean contrast: `mean_contrast`."""
        return mean_contrast(self.contrast)

    @property
    def quality(self) -> float:
        """The mean contrast, less where the objects do not stand where the program draws."""
        return self.mean * math.exp(-min(self.cost, _WORST))


def measured(
    evidence: Evidence, filling: Filling, z: Tensor, *, focal_mm: float, side: float | None = None
) -> CurveFit | None:
    """How well the objects of a filled sketch predict each other; None for fewer than three in sight."""
    theta = filling.theta(z)
    pattern = filling.pattern
    if side is None:
        side = spacing(pattern, theta)
    index = pattern.index[evidence.in_sight(pattern, theta, focal_mm=focal_mm)].double()
    if len(index) < _FEWEST:
        return None
    found = patch_contrast(evidence, pattern, theta, index, side=side, focal_mm=focal_mm)
    return CurveFit(filling, z, focal_mm, side, index, found.contrast)


def registered(
    evidence: Evidence, fit: CurveFit, *, free_focal: bool = False, keep_side: bool = False
) -> CurveFit | None:
    """One round: find the objects around their places, fit the numbers to where they are; None if too few.

    `keep_side`: the patches stay as wide as they are, whatever becomes of the distance of the draws.
    """
    filling, pattern = fit.filling, fit.filling.pattern
    weights = fit.contrast.clamp(min=0.02)
    found = find_objects(
        evidence, pattern, fit.theta, fit.index, weights, side=fit.side, focal_mm=fit.focal_mm
    )
    certainty = found.certainty.double()
    if int((certainty > 0).sum()) < _FEWEST:
        return None
    size = evidence.image.size
    where = frames(pattern, fit.theta, fit.index, side=fit.side)
    matrix = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm)
    targets, _ = project(matrix, where.points(found.offsets[:, None])[:, 0])
    whiten = _whitening(matrix, where)

    def points_of(numbers: Tensor) -> Tensor:
        theta = filling.theta(numbers[..., :-1])
        seen = pattern.image_from_plane(theta, size=size, focal_mm=numbers[..., -1].exp())
        return project(seen, pattern.points_at(fit.index, theta))[0]

    start = torch.cat([fit.z, torch.tensor([math.log(fit.focal_mm)], dtype=torch.float64)])
    free = torch.zeros(len(start), 2, dtype=torch.float64)
    free[:, 0] = start
    free[-1, 0] = math.log(evidence.focal_mm)
    free[-1, 1] = 1 / _FOCAL_SPREAD**2 if free_focal else 1e12
    numbers = robust_fit(
        points_of,
        start,
        targets=targets,
        whiten=whiten,
        weights=certainty,
        limits=_limits(fit),
        prior=free,
        iterations=8,
    )
    if not bool(torch.isfinite(numbers).all()):
        return None
    focal_mm = (
        min(max(math.exp(float(numbers[-1])), FOCALS_MM[0]), FOCALS_MM[1]) if free_focal else fit.focal_mm
    )
    residual = torch.einsum("nij,nj->ni", whiten, points_of(numbers) - targets)
    cost = float((certainty * (1 + residual.square().sum(1) / 4).log()).sum() / certainty.sum())
    side = fit.side if keep_side else None
    moved = measured(evidence, filling, numbers[:-1], focal_mm=focal_mm, side=side)
    return None if moved is None else replace(moved, cost=cost)


def follow(
    evidence: Evidence, fit: CurveFit, *, rounds: int, free_focal: bool = False, keep_side: bool = False
) -> CurveFit:
    """The best of some rounds of registration; the options are those of `registered`."""
    best = now = fit
    for _ in range(rounds):
        moved = registered(evidence, now, free_focal=free_focal, keep_side=keep_side)
        if moved is None:
            break
        settled = abs(moved.mean - now.mean) < 0.003 and moved.cost > 0.98 * now.cost
        now = moved
        if now.quality > best.quality:
            best = now
        if settled:
            break
    return best


def curve_score(fit: CurveFit) -> float:
    """The score, 0 to 1, of a program that was fitted: `score_of_curve` of its quality."""
    return score_of_curve(fit.quality, len(fit.contrast))


def _whitening(matrix: Tensor, where: Frames) -> Tensor:
    """[N, 2, 2]: differences in pixels to differences in units of their noise, along and across."""
    columns = []
    for axis in (where.along, where.across):
        ahead, _ = project(matrix, where.origin + 0.1 * axis)
        behind, _ = project(matrix, where.origin - 0.1 * axis)
        columns.append((ahead - behind) / 0.2)
    px_from_side = torch.stack(columns, 2)
    side_px = torch.linalg.det(px_from_side).abs().sqrt().clamp(min=1.0)
    noise = (_SHARE_NOISE**2 + (_PIXEL_NOISE / side_px) ** 2).sqrt()
    return torch.linalg.pinv(px_from_side) / noise[:, None, None]


def _limits(fit: CurveFit) -> Tensor:
    """The most that one step may move each free number and the logarithm of the focal, [F + 1]."""
    radius = max(float(fit.filling.pattern.centers(fit.theta).std(0).norm()), fit.side)
    limits = []
    for unknown in fit.filling.moving:
        name = unknown.name
        if name.startswith("camera."):
            limits.append(_MOST_TURN_DEG)
        elif ".angle." in name:
            limits.append(math.degrees(_MOST_SHIFT * fit.side / radius))
        else:
            limits.append(_MOST_SHIFT * fit.side)
    return torch.tensor([*limits, _MOST_ZOOM], dtype=torch.float64)

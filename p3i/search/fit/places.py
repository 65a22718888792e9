"""Fitting programs that draw on curves (rings, rings in rings, any sketch) to the objects on a photo.

Each object is searched for around its place by correlation with the mean patch (look/patches.py), and the
program's free numbers, the focal among them where it is free, are fitted to the places found.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.search.fit.features import MOST_TURN_DEG
from p3i.search.fit.fitted import FEWEST_SEEN, Fit
from p3i.search.fit.robust import robust_fit
from p3i.search.forms.filling import Filling
from p3i.search.look.contrast import score_of_curve
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import areas_px, find_objects, frames, misfit, patch_contrast, spacing, whitening
from p3i.search.look.session import Session

FOCALS_MM = (20.0, 300.0)
"""Within these a focal that nobody stated may go, 35 mm-equivalent."""
FOCAL_SPREAD = 0.7
"""Spread of the prior on the logarithm of the focal: a phone or a lens from 24 to 50 mm is no surprise."""
# One step moves lengths by at most this share of a patch.
_MOST_SHIFT = 0.4
MOST_ZOOM = 0.15
"""One step moves the focal's logarithm by at most this."""


def measured(
    evidence: Evidence, filling: Filling, z: Tensor, *, focal_mm: float, side: float | None = None
) -> Fit | None:
    """How well the objects of a filled sketch, z [F], predict each other; None for fewer than three."""
    theta = filling.theta(z)
    pattern = filling.pattern
    if side is None:
        side = spacing(pattern, theta)
    index = pattern.index[evidence.in_sight(pattern, theta, focal_mm=focal_mm)].double()
    if len(index) < FEWEST_SEEN:
        return None
    found = patch_contrast(evidence, pattern, theta, index, side=side, focal_mm=focal_mm)
    size = evidence.image.size
    matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
    areas = areas_px(matrix, frames(pattern, theta, index, side=side))
    return Fit(
        filling, z, focal_mm, side, index, found, covered=float(areas.sum()) / (size.width * size.height)
    )


def registered(
    evidence: Evidence, fit: Fit, *, free_focal: bool = False, keep_side: bool = False
) -> Fit | None:
    """One round: find the objects around their places, fit the numbers to where they are; None if too few.

    `keep_side`: the patches stay as wide as they are, whatever becomes of the distance of the draws.
    """
    filling, pattern = fit.filling, fit.filling.pattern
    weights = fit.contrast.clamp(min=0.02)
    found = find_objects(
        evidence, pattern, fit.theta, fit.index, weights, side=fit.side, focal_mm=fit.focal_mm
    )
    certainty = found.certainty.double()
    if int((certainty > 0).sum()) < FEWEST_SEEN:
        return None
    size = evidence.image.size
    where = frames(pattern, fit.theta, fit.index, side=fit.side)
    matrix = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm)
    targets, _ = project(matrix, where.points(found.offsets[:, None])[:, 0])
    whiten = whitening(matrix, where)

    def points_of(numbers: Tensor) -> Tensor:
        theta = filling.theta(numbers[..., :-1])
        seen = pattern.image_from_plane(theta, size=size, focal_mm=numbers[..., -1].exp())
        return project(seen, pattern.points_at(fit.index, theta))[0]

    def fitted(focal_mm: float, *, free: bool) -> Tensor:
        start = torch.cat([fit.z, torch.tensor([math.log(focal_mm)], dtype=torch.float64)])
        prior = torch.zeros(len(start), 2, dtype=torch.float64)
        prior[-1, 0], prior[-1, 1] = math.log(evidence.focal_mm), FOCAL_SPREAD**-2
        return robust_fit(
            points_of,
            start,
            targets=targets,
            whiten=whiten,
            weights=certainty,
            limits=_limits(fit, MOST_ZOOM if free else 0.0),
            prior=prior,
            iterations=8,
        )

    focal_mm = fit.focal_mm
    numbers = fitted(focal_mm, free=free_focal)
    if free_focal:
        told = float(numbers[-1].exp())
        focal_mm = min(max(told, FOCALS_MM[0]), FOCALS_MM[1])
        if focal_mm != told and math.isfinite(told):  # the others are to belong to the focal that stays
            numbers = fitted(focal_mm, free=False)
    if not bool(torch.isfinite(numbers).all()):
        return None
    cost = misfit(points_of(numbers) - targets, whiten=whiten, certainty=certainty)
    side = fit.side if keep_side else None
    moved = measured(evidence, filling, numbers[:-1], focal_mm=focal_mm, side=side)
    return None if moved is None else replace(moved, cost=cost)


def follow(
    evidence: Evidence, fit: Fit, *, rounds: int, free_focal: bool = False, keep_side: bool = False
) -> Fit:
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


def fitted(
    look: Session, filling: Filling, values: dict[str, float], *, focal_mm: float, rounds: int
) -> Fit | None:
    """A filling fitted from the numbers of these names; None where too few of its objects are in sight."""
    start = measured(look.evidence, filling, numbers_of(filling, values), focal_mm=focal_mm)
    return None if start is None else settled(look, start, rounds=rounds)


def settled(look: Session, fit: Fit, *, rounds: int) -> Fit:
    """Some rounds of registration, with the focal free where nobody stated it."""
    if not look.focal_is_free:
        return follow(look.evidence, fit, rounds=rounds)
    if fit.focal_mm == look.evidence.focal_mm:
        fit = follow(look.evidence, fit, rounds=rounds)
    return follow(look.evidence, fit, rounds=3, free_focal=True)


def curve_score(fit: Fit) -> float:
    """The score, 0 to 1, of a program that was fitted: `score_of_curve` of its quality."""
    return score_of_curve(fit.quality, len(fit.contrast))


def values_of(fit: Fit) -> dict[str, float]:
    """The numbers of a fit by the names of their unknowns, such as draw.x.radius.1."""
    return fit.filling.named(fit.z)


def numbers_of(filling: Filling, values: dict[str, float]) -> Tensor:
    """The numbers of a filling [F] in its order."""
    return torch.tensor([values[unknown.name] for unknown in filling.moving], dtype=torch.float64)


def _limits(fit: Fit, zoom: float) -> Tensor:
    """The most that one step may move each free number, and `zoom` for the focal's logarithm: [F + 1]."""
    radius = max(float(fit.filling.pattern.centers(fit.theta).std(0).norm()), fit.side)
    limits = []
    for unknown in fit.filling.moving:
        name = unknown.name
        if name.startswith("camera."):
            limits.append(MOST_TURN_DEG)
        elif ".angle." in name:
            limits.append(math.degrees(_MOST_SHIFT * fit.side / radius))
        else:
            limits.append(_MOST_SHIFT * fit.side)
    return torch.tensor([*limits, zoom], dtype=torch.float64)

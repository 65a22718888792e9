"""Fitting programs that draw on curves (rings, rings in rings, any sketch) to the objects on a photo.

Each object is searched for around its place by correlation with the mean patch (look/patches.py), and the
program's free numbers, the focal among them where it is free, are fitted to the places found.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.fit.fitted import FEWEST_SEEN, Fit
from p3i.search.fit.robust import fitted as fitted_to
from p3i.search.fit.robust import moving_limits
from p3i.search.forms.filling import Filling
from p3i.search.look.contrast import score_of_curve
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import (
    Frames,
    areas_px,
    find_about,
    frames,
    misfit,
    patch_contrast,
    spacing,
    whitening,
)
from p3i.search.look.session import Session

FOCALS_MM = (20.0, 300.0)
"""Within these a focal that nobody stated may go, 35 mm-equivalent."""
FOCAL_SPREAD = 0.7
"""Spread of the prior on the logarithm of the focal: a phone or a lens from 24 to 50 mm is no surprise."""
# An object counts at least so much in what all are like.
_LEAST_WEIGHT = 0.02
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


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where a photo shows the objects about draws: `px` [N, 2], how sure each is [N], 0 where none is found.

    `whiten` [N, 2, 2] takes differences of places to units of their noise, and `frames` are the patches moved
    onto the objects.
    """

    px: Tensor
    certainty: Tensor
    whiten: Tensor
    frames: Frames


def objects_about(
    evidence: Evidence,
    pattern: Pattern,
    theta: Tensor,
    index: Tensor,
    weights: Tensor,
    *,
    side: float,
    focal_mm: float,
) -> Places:
    """Where the objects about the draws `index` [N, 2] are, `weights` [N] making what all are like."""
    where = frames(pattern, theta, index, side=side)
    matrix = pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm)
    found = find_about(evidence, matrix, where, index, weights.clamp(min=_LEAST_WEIGHT))
    there = replace(where, origin=where.points(found.offsets[:, None])[:, 0])
    px, _ = project(matrix, there.origin)
    return Places(px, found.certainty.double(), whitening(matrix, where), there)


def registered(
    evidence: Evidence, fit: Fit, *, free_focal: bool = False, keep_side: bool = False
) -> Fit | None:
    """One round: find the objects around their places, fit the numbers to where they are; None if too few.

    `keep_side`: the patches stay as wide as they are, whatever becomes of the distance of the draws.
    """
    filling, pattern, size = fit.filling, fit.pattern, evidence.image.size
    there = objects_about(
        evidence, pattern, fit.theta, fit.index, fit.contrast, side=fit.side, focal_mm=fit.focal_mm
    )
    if int((there.certainty > 0).sum()) < FEWEST_SEEN:
        return None

    def points_of(numbers: Tensor) -> Tensor:
        theta = filling.theta(numbers[..., :-1])
        seen = pattern.image_from_plane(theta, size=size, focal_mm=numbers[..., -1].exp())
        return project(seen, pattern.points_at(fit.index, theta))[0]

    def at_places(focal_mm: float, *, free: bool) -> Tensor:
        start = torch.cat([fit.z, torch.tensor([math.log(focal_mm)], dtype=torch.float64)])
        mean, known = torch.zeros_like(start), torch.zeros_like(start)
        mean[-1], known[-1] = math.log(evidence.focal_mm), FOCAL_SPREAD**-2
        zoom = torch.tensor([MOST_ZOOM if free else 0.0], dtype=torch.float64)
        return fitted_to(
            points_of,
            start,
            places=there.px,
            whiten=there.whiten,
            weights=there.certainty,
            limits=torch.cat([moving_limits(filling, fit.z), zoom]),
            mean=mean,
            known=known,
        ).numbers

    focal_mm = fit.focal_mm
    numbers = at_places(focal_mm, free=free_focal)
    if free_focal:
        told = float(numbers[-1].exp())
        focal_mm = min(max(told, FOCALS_MM[0]), FOCALS_MM[1])
        if focal_mm != told and math.isfinite(told):  # the others are to belong to the focal that stays
            numbers = at_places(focal_mm, free=False)
    if not bool(torch.isfinite(numbers).all()):
        return None
    cost = misfit(points_of(numbers) - there.px, whiten=there.whiten, certainty=there.certainty)
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

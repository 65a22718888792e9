"""From a ring that was fitted to a program: where on it the objects are."""

import math
from dataclasses import replace

import numpy as np

from p3i.search.extent.centring import centred, standing_out
from p3i.search.extent.sector import Place, Ring, places
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.places import curve_score, follow, measured, numbers_of, values_of
from p3i.search.fit.saved import saved_bits
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import offsets_grid
from p3i.search.look.session import Session

# So many radii are tried for the objects.
_MOST_PLACES = 2


def drawn_ring(look: Session, fit: Fit) -> Drawn:
    """The ring with its draws put where the objects sit: at the radius that explains most."""
    if fit.pattern.upright:
        fit = _upright(look.evidence, fit)
        return Drawn(fit.program(), fit, curve_score(fit))
    found, most = fit, -math.inf
    for place in places(look.evidence, _ring_of(look, fit))[:_MOST_PLACES]:
        moved = _moved(look, fit, place)
        if moved is not None and (told := saved_bits(look.evidence, moved) * moved.quality) > most:
            found, most = moved, told
    return Drawn(found.program(), found, curve_score(found))


def _upright(evidence: Evidence, fit: Fit) -> Fit:
    """The fit of upright objects with its draws on their middles.

    Such objects are alike at every point that they share, so that the whole ring may lie beside their
    middles: it is moved to where they stand out most.
    """
    values, found = values_of(fit), [fit]
    for right, down in offsets_grid(3, samples_a_side=4).reshape(-1, 2).tolist():  # a quarter step each way
        x, y = values["draw.x.offset.1"] + right * fit.side, values["draw.y.offset.1"] + down * fit.side
        z = numbers_of(fit.filling, values | {"draw.x.offset.1": x, "draw.y.offset.1": y})
        moved = measured(evidence, fit.filling, z, focal_mm=fit.focal_mm, side=fit.side)
        found += [] if moved is None else [moved]
    moved = centred(evidence, max(found, key=lambda one: standing_out(evidence, one)))
    return replace(moved, cost=fit.cost, bits=fit.bits)  # all objects moved alike


def _moved(look: Session, fit: Fit, place: Place) -> Fit | None:
    """The fit with its draws on the objects, fitted once more."""
    values = values_of(fit)
    values["draw.x.radius.1"] = place.radius
    values["draw.x.angle.1"] += place.turn_deg
    moved = measured(look.evidence, fit.filling, numbers_of(fit.filling, values), focal_mm=fit.focal_mm)
    if moved is None:
        return None
    free = fit.focal_mm != look.evidence.focal_mm
    return follow(look.evidence, moved, rounds=3, free_focal=free)


def _ring_of(look: Session, fit: Fit) -> Ring:
    values = values_of(fit)
    seen = fit.pattern.image_from_plane(fit.theta, size=look.evidence.image.size, focal_mm=fit.focal_mm)
    return Ring(
        center=np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]]),
        radius=values["draw.x.radius.1"],
        first_deg=values["draw.x.angle.1"],
        step_deg=values.get("draw.x.angle.j", 360 / len(fit.pattern.index)),
        index=fit.index[:, 1].numpy(),
        weights=fit.contrast.numpy().astype(float),
        image_from_plane=seen.numpy(),
    )

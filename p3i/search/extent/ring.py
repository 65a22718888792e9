"""From a ring that was fitted to a program: where on it the objects are."""

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
from p3i.search.result import Reading

# So many radii are tried for the objects.
_MOST_PLACES = 2


def drawn_ring(look: Session, fit: Fit) -> Drawn:
    """The ring with its draws where the objects sit: where most comes again, and stands out.

    The circles that speak for themselves are its readings.
    """
    evidence = look.evidence
    if fit.pattern.upright:
        fit = _upright(evidence, fit)
        return Drawn(fit.program(), fit, curve_score(fit))
    moved = [_moved(look, fit, place) for place in places(evidence, _ring_of(look, fit))[:_MOST_PLACES]]
    told = [
        (saved_bits(evidence, one) * standing_out(evidence, one), one) for one in moved if one is not None
    ]
    if not told:
        return Drawn(fit.program(), fit, curve_score(fit))
    told.sort(key=lambda one: -one[0])
    drawn = told[0][1]
    return Drawn(drawn.program(), drawn, curve_score(drawn), readings=_readings(told, drawn))


def _readings(told: list[tuple[float, Fit]], drawn: Fit) -> tuple[Reading, ...]:
    """The circles of a ring as readings, by how much speaks for each; none where there is no choice."""
    speaking = [(max(much, 0.0), values_of(one)) for much, one in told]
    total, ours = sum(much for much, _ in speaking), values_of(drawn)
    if len(speaking) < 2 or total <= 0:
        return ()
    step = _step_deg(drawn)
    return tuple(
        Reading(
            str(rank),
            much / total,
            (0.0, (values["draw.x.angle.1"] - ours["draw.x.angle.1"]) / step),
            values["draw.x.radius.1"] / ours["draw.x.radius.1"],
        )
        for rank, (much, values) in enumerate(speaking, 1)
    )


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
        step_deg=_step_deg(fit),
        index=fit.index[:, 1].numpy(),
        weights=fit.contrast.numpy().astype(float),
        image_from_plane=seen.numpy(),
    )


def _step_deg(fit: Fit) -> float:
    """From one object to the next; a closed ring's is no number of its own."""
    return values_of(fit).get("draw.x.angle.j", 360 / len(fit.pattern.index))

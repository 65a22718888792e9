"""Hybrids on a photo: rings around one centre, arcs that grow from ring to ring, a ring along a line.

Each starts from a ring that was found by itself: with its pose, the other rings lie open on the straightened
plane (propose/hybrid.py). Then all numbers are fitted together, as with a single ring.
"""

import numpy as np

from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.curves import CurveFit, curve_score, follow, measured
from p3i.search.fill import Filling, fillings, unknowns_of
from p3i.search.propose.hybrid import BaseRing, HybridProposal, ring_repeated, rings_around
from p3i.search.rings import answer_of, found_rings, numbers_of, values_of
from p3i.search.session import Answer, Session

# A ring that is less sure than this starts nothing.
_LEAST_QUALITY = 0.15
_FEWEST = 4
# More rings are believed where their objects agree at least so well, compared with the ring's own.
_KEPT_QUALITY = 0.6
# Every ring of a hybrid has at least this share of the contrast of the plainest.
_LEAST_RING = 0.4
_MOST_TOLD = 2


def find_hybrids(session: Session) -> list[Answer]:
    """The hybrids of a photo as finished programs, the most worth first; none where no ring convinces."""
    found: list[tuple[float, float, CurveFit]] = []
    for ring in found_rings(session):
        if ring.fit.quality < _LEAST_QUALITY or len(ring.fit.contrast) < _FEWEST or not session.go_on():
            continue
        session.tell("more rings", 0.95)
        base = _base_of(ring.fit)
        proposals = rings_around(session.evidence, base)
        if len(base.fit.filling.pattern.index) * abs(base.step_deg) > 300:
            proposals += ring_repeated(session.evidence, base)
        for proposal in proposals:
            fit = _fitted(session, ring.fit, proposal)
            if fit is None:
                continue
            session.record("hybrid", program=fit.filling.program(fit.z, ()), score=fit.quality)
            if _holds(fit, ring.fit):
                # As with rings, how surely it repeats may be told at another radius than that of the objects.
                score = max(curve_score(fit), ring.score * min(1.0, fit.quality / ring.fit.quality))
                found.append((fit.mean * len(fit.contrast), score, fit))
    found.sort(key=lambda triple: -triple[0])
    return [answer_of(session, fit, "hybrid", score) for _, score, fit in found[:_MOST_TOLD]]


def hybrid_filling(proposal: HybridProposal) -> Filling:
    """The sketch of a proposal's kind, its counts written, all else to be found."""
    p = proposal
    radius = "(?b*i + ?r)" if p.growth else "?r"
    angle = "?s*j + ?a" if p.counted_by_ring else f"360/{p.count}*j + ?a"
    x, y = ("?d*i + ?x", "?e*i + ?y") if any(p.along) else ("?x", "?y")
    stop = f"{p.count}*i" if p.counted_by_ring else str(p.count)
    text = (
        "SetCameraPose(rx=??, ry=??)\n"
        f"for i in range({p.first}, {p.last + 1}):\n"
        f"    for j in range(0, {stop}):\n"
        f"        Draw(x={radius}*Cos({angle}) + {x}, y={radius}*Sin({angle}) + {y})\n"
    )
    sketch = parse_sketch(text)
    assert isinstance(sketch, Sketch), sketch
    return next(fillings(sketch, unknowns_of(sketch), most_indices=1000, most_settings=1))


def _base_of(fit: CurveFit) -> BaseRing:
    values = values_of(fit)
    return BaseRing(
        fit,
        np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]]),
        values["draw.x.radius.1"],
        values["draw.x.angle.1"],
        values.get("draw.x.angle.j", 360 / len(fit.filling.pattern.index)),
    )


def _fitted(session: Session, ring: CurveFit, proposal: HybridProposal) -> CurveFit | None:
    """All numbers of a proposal fitted together, from the ring's pose and focal."""
    filling = hybrid_filling(proposal)
    own = values_of(ring)
    values = {
        "camera.rx": own["camera.rx"],
        "camera.ry": own["camera.ry"],
        "draw.x.radius.1": proposal.radius,
        "draw.x.radius.i": proposal.growth,
        "draw.x.angle.1": proposal.phase_deg,
        "draw.x.angle.j": proposal.step_deg,
        "draw.x.offset.1": proposal.center[0],
        "draw.y.offset.1": proposal.center[1],
        "draw.x.offset.i": proposal.along[0],
        "draw.y.offset.i": proposal.along[1],
    }
    start = measured(session.evidence, filling, numbers_of(filling, values), focal_mm=ring.focal_mm)
    if start is None or start.mean < 0.5 * _KEPT_QUALITY * ring.mean:
        return None
    return follow(session.evidence, start, rounds=4, free_focal=session.focal_is_free)


def _holds(fit: CurveFit, ring: CurveFit) -> bool:
    """Whether a fit says more than the ring alone: more objects, nearly as sure, on each of its rings."""
    if len(fit.contrast) <= len(ring.contrast) + 1 or fit.quality < _KEPT_QUALITY * ring.quality:
        return False
    rings = fit.index[:, 0]
    means = [float(fit.contrast[rings == i].mean()) for i in rings.unique()]
    return len(means) > 1 and min(means) >= _LEAST_RING * max(means)

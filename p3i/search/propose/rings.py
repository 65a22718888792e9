"""Where rings may be, and what may lie around a ring that was found: guesses for all sketches of curves."""

from collections.abc import Iterator, Sequence

import numpy as np

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.places import numbers_of, values_of
from p3i.search.forms.guess import Base, Guess
from p3i.search.forms.spelled import ring_filling, rings_filling
from p3i.search.look.session import Session
from p3i.search.propose.repeats import BaseRing, HybridProposal, ring_repeated, rings_around
from p3i.search.propose.votes import ring_proposals

# A ring that goes round this far is taken for a whole one.
_CLOSED_DEG = 300.0
# A ring that is less sure than this, or has fewer objects, starts nothing.
_LEAST_QUALITY = 0.15


def ring_guesses(look: Session) -> Iterator[Guess]:
    """Whole rings, the most promising first."""
    look.tell("turning", 0.82)
    proposals = ring_proposals(look.evidence, seed=look.config.seed)
    for proposal in proposals:
        filling = ring_filling(proposal.count)
        values = {
            "camera.rx": proposal.rx_deg,
            "camera.ry": proposal.ry_deg,
            "draw.x.radius.1": proposal.radius,
            "draw.x.angle.1": 0.0,
            "draw.x.offset.1": float(proposal.center[0]),
            "draw.y.offset.1": float(proposal.center[1]),
        }
        promise = proposal.worth / max(proposals[0].worth, 1e-9)
        yield Guess(filling, numbers_of(filling, values), promise, focal_mm=proposal.focal_mm)


def guesses_around(look: Session, rings: Sequence[Drawn]) -> Iterator[Guess]:
    """More rings around each of some, or a ring again along a line: the most objects of each ring first."""
    done: list[BaseRing] = []
    for ring in rings:
        fit = ring.fit
        if min(fit.quality, 1.5 * ring.sure) < _LEAST_QUALITY or len(fit.contrast) < FEWEST_OBJECTS:
            continue
        base = _base_of(fit)
        if any(_same(base, other) for other in done):
            continue
        look.tell("more rings", 0.95)
        done.append(base)
        closed = base.count * abs(base.step_deg) > _CLOSED_DEG
        for propose in (rings_around, ring_repeated) if closed else (rings_around,):
            for proposal in sorted(propose(look.evidence, base), key=lambda proposal: -proposal.objects):
                yield _guess(ring, proposal)


def _guess(ring: Drawn, proposal: HybridProposal) -> Guess:
    """A proposal with the pose and the focal of the ring that it begins with."""
    filling = rings_filling(
        proposal.first,
        proposal.last + 1,
        proposal.count,
        fan=proposal.counted_by_ring,
        grows=bool(proposal.growth),
        moves=any(proposal.along),
    )
    own = values_of(ring.fit)
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
    fit = ring.fit
    base = Base(len(fit.contrast), fit.mean, fit.quality, fit.side, ring.sure)
    return Guess(filling, numbers_of(filling, values), proposal.objects, fit.focal_mm, base=base)


def _base_of(fit: Fit) -> BaseRing:
    values, drawn = values_of(fit), len(fit.pattern.index)
    center = np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]])
    step_deg = values.get("draw.x.angle.j", 360 / drawn)
    return BaseRing(fit, center, values["draw.x.radius.1"], values["draw.x.angle.1"], step_deg, drawn)


def _same(first: BaseRing, second: BaseRing) -> bool:
    """Whether two rings lie about one centre and turn by the same step."""
    apart = float(np.hypot(*(first.center - second.center)))
    return apart < 0.1 * first.radius and abs(first.step_deg - second.step_deg) < 0.05 * abs(first.step_deg)

"""Hybrids on a photo: rings around one centre, arcs that grow from ring to ring, a ring along a line.

Each starts from a ring that was found by itself: with its pose, the other rings lie open on the straightened
plane (propose/repeats.py). Then all numbers are fitted together, as with a single ring.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch

from p3i.grammar.leaves import leaves, with_leaves
from p3i.search.answer import Answer
from p3i.search.fit.places import CurveFit, curve_score, follow, measured, numbers_of, values_of
from p3i.search.forms.filling import Filling, filling_of
from p3i.search.judge.bits import explained_bits
from p3i.search.look.patches import spacing
from p3i.search.look.session import Session
from p3i.search.propose.repeats import BaseRing, HybridProposal, ring_repeated, rings_around
from p3i.search.rings import FoundRing, answer_of, found_rings
from p3i.search.table1 import hybrid_in_table1

# A ring that is less sure than this starts nothing.
_LEAST_QUALITY = 0.15
_FEWEST = 4
# More rings are believed where their objects agree at least so well, compared with the ring's own.
_KEPT_QUALITY = 0.6
# Every ring of a hybrid has at least this share of the contrast of the plainest, and so many objects in
# sight: through two points there are circles anywhere.
_LEAST_RING = 0.25
_FEWEST_SEEN = 3
# Draws of two rings closer than this share of a patch are one object; so large a part may be drawn twice,
# where rings cross.
_SAME_OBJECT = 0.4
_MOST_TWICE = 0.25
# A ring that goes round this far is taken for a whole one.
_CLOSED_DEG = 300.0
_MOST_GROWTHS = 4
# Whether a further ring is there is looked at in patches of this share of the fit's: the outermost ring may
# lie close to a rim.
_CLOSE_LOOK = 0.6
_MOST_TOLD = 2
_FEWEST_RINGS = 2


def find_hybrids(session: Session) -> list[Answer]:
    """The hybrids of a photo as finished programs, the most worth first; none where no ring convinces."""
    found: list[tuple[float, float, CurveFit]] = []
    with session.until_interrupted():
        _find_all(session, found_rings(session), found)
    found.sort(key=lambda triple: -triple[0])
    answers: list[Answer] = []
    for _, score, fit in found:
        if len(answers) >= _MOST_TOLD:
            break
        free = answer_of(session, fit, "hybrid", score)
        answer = session.completed(partial(_without_empty_middle, session, free))
        if session.config.strict:
            answers += session.completed(partial(hybrid_in_table1, session, fit, answer))
        else:
            answers.append(answer)
    return answers


def _find_all(
    session: Session, rings: Sequence[FoundRing], found: list[tuple[float, float, CurveFit]]
) -> None:
    """Start from each ring that convinces; what is found goes into `found`: its rank, its score, the fit."""
    done: list[BaseRing] = []
    for ring in rings:
        if min(ring.fit.quality, 1.5 * ring.score) < _LEAST_QUALITY or len(ring.fit.contrast) < _FEWEST:
            continue
        if not session.go_on():
            break
        session.tell("more rings", 0.95)
        base = _base_of(ring.fit)
        if found and any(_same(base, other) for other in done):
            continue
        done.append(base)
        closed = base.count * abs(base.step_deg) > _CLOSED_DEG
        for propose in (rings_around, ring_repeated) if closed else (rings_around,):
            for fit in _fits(session, ring.fit, propose(session.evidence, base)):
                # As with rings, how surely it repeats may be told at another radius than the objects'.
                score = max(curve_score(fit), ring.score * min(1.0, fit.quality / ring.fit.quality))
                found.append((fit.mean * len(fit.contrast), score, fit))


def _without_empty_middle(session: Session, answer: Answer) -> Answer:
    """The answer without its first rings as long as it explains more of the photo so.

    A first ring close to the centre has room for tiny patches only: where nothing is there, all lose by it.
    """
    bits = explained_bits(session.evidence, answer)
    while True:
        numbers = leaves(answer.program)
        first, stop = numbers["for_i.start.1"], numbers["for_i.stop.1"]
        if stop - first <= _FEWEST_RINGS:
            return answer
        later = replace(answer, program=with_leaves(answer.program, {"for_i.start.1": first + 1}))
        more = explained_bits(session.evidence, later)
        if more <= bits:
            return answer
        bits, answer = more, later


def _fits(session: Session, ring: CurveFit, proposals: list[HybridProposal]) -> Iterator[CurveFit]:
    """The proposals that hold, fitted, with all the rings that they go on to, each as soon as it is."""
    kept: list[HybridProposal] = []
    for proposal in sorted(proposals, key=lambda proposal: -proposal.objects):
        if kept and not session.go_on():
            return
        if any(_alike(proposal, other) for other in kept):
            continue
        fit = _fitted(session, ring, proposal)
        if fit is None or not _holds(fit, ring):
            continue
        kept.append(proposal)
        grown = [fit]
        with session.until_interrupted():
            _grow(session, grown, proposal)
        fit = grown[-1]
        yield fit
        session.record("hybrid", program=fit.filling.program(fit.z, ()), score=fit.quality)


def _same(first: BaseRing, second: BaseRing) -> bool:
    """Whether two rings lie about one centre and turn by the same step."""
    apart = float(np.hypot(*(first.center - second.center)))
    return apart < 0.1 * first.radius and abs(first.step_deg - second.step_deg) < 0.05 * abs(first.step_deg)


def _alike(first: HybridProposal, second: HybridProposal) -> bool:
    """Whether two proposals are the same but for small differences that a fit takes away."""
    names = ("first", "last", "count", "counted_by_ring")
    if any(getattr(first, name) != getattr(second, name) for name in names):
        return False
    return abs(first.growth - second.growth) + abs(first.radius - second.radius) < 0.1 * second.growth


def _grow(session: Session, grown: list[CurveFit], proposal: HybridProposal) -> None:
    """Add to `grown`, which holds a hybrid, the same with further rings at either end that hold as well."""
    side = _CLOSE_LOOK * grown[0].side
    for _ in range(_MOST_GROWTHS):
        fit = grown[-1]
        values = values_of(fit)
        for change in ({"last": proposal.last + 1}, {"first": proposal.first - 1}):
            wider = replace(proposal, **change)
            if wider.counted_by_ring and (
                wider.first < 1 or wider.count * wider.last * abs(values["draw.x.angle.j"]) > 360.5
            ):
                continue
            if values["draw.x.radius.1"] + wider.first * values.get("draw.x.radius.i", 0.0) <= 0:
                continue
            filling = hybrid_filling(wider)
            numbers = numbers_of(filling, values)
            more = measured(session.evidence, filling, numbers, focal_mm=fit.focal_mm, side=side)
            now = measured(session.evidence, fit.filling, fit.z, focal_mm=fit.focal_mm, side=side)
            if more is None or now is None or len(more.contrast) < len(fit.contrast) + 3:
                continue
            if _evenly_sure(more) and more.mean > _KEPT_QUALITY * now.mean:
                moved = follow(session.evidence, more, rounds=2, free_focal=session.focal_is_free)
                whole = measured(session.evidence, filling, moved.z, focal_mm=moved.focal_mm, side=fit.side)
                if whole is not None:
                    grown.append(replace(whole, cost=moved.cost))
                    proposal = wider
                    break
        else:
            return


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
    return filling_of(text)


def _base_of(fit: CurveFit) -> BaseRing:
    values = values_of(fit)
    return BaseRing(
        fit,
        np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]]),
        values["draw.x.radius.1"],
        values["draw.x.angle.1"],
        values.get("draw.x.angle.j", 360 / len(fit.filling.pattern.index)),
        len(fit.filling.pattern.index),
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
    numbers = numbers_of(filling, values)
    # Where the rings of a fan lie far apart, patches as wide as its draws do are too wide for its inner ring.
    side = min(spacing(filling.pattern, filling.theta(numbers)), ring.side)
    start = measured(session.evidence, filling, numbers, focal_mm=ring.focal_mm, side=side)
    if start is None or start.mean < 0.5 * _KEPT_QUALITY * ring.mean:
        return None
    return follow(session.evidence, start, rounds=3, free_focal=session.focal_is_free, keep_side=True)


def _holds(fit: CurveFit, ring: CurveFit) -> bool:
    """Whether a fit says more than the ring alone: more objects, nearly as sure, on each of its rings."""
    if len(fit.contrast) <= len(ring.contrast) + 1 or fit.quality < _KEPT_QUALITY * ring.quality:
        return False
    return _drawn_once(fit) and _evenly_sure(fit)


def _drawn_once(fit: CurveFit) -> bool:
    """Whether rings have objects of their own; laid over itself a step further, one finds its own again."""
    at = fit.filling.pattern.points_at(fit.index, fit.theta)
    other_ring = fit.index[:, None, 0] != fit.index[None, :, 0]
    twice = (other_ring & (torch.cdist(at, at) < _SAME_OBJECT * fit.side)).any(1)
    return float(twice.double().mean()) < _MOST_TWICE


def _evenly_sure(fit: CurveFit) -> bool:
    """Whether there are several rings, with enough of each in sight to tell, and most objects of each there.

    The median, not the mean: a ring that crosses another one has a few of that one's objects for its own.
    """
    rings, drawn = fit.index[:, 0], fit.filling.pattern.index[:, 0]
    typical: list[float] = []
    for i in rings.unique():
        own = fit.contrast[rings == i]
        if len(own) < min(_FEWEST_SEEN, int((drawn == i).sum())):
            return False
        typical.append(float(own.quantile(0.5)))
    return len(typical) > 1 and min(typical) >= _LEAST_RING * max(typical)

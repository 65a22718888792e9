"""Rings on a photo: proposals, fits, where on the ring the objects sit, which are there, and the program."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from p3i.search.answer import Answer
from p3i.search.extent.sector import Place, Ring, places
from p3i.search.fit.places import CurveFit, curve_score, follow, measured, numbers_of, values_of
from p3i.search.forms.filling import Filling, filling_of
from p3i.search.look.session import Session
from p3i.search.optics.curve_focal import with_paid_focal
from p3i.search.propose.votes import RingProposal, ring_proposals
from p3i.search.result import StructureFound
from p3i.search.table1 import ring_in_table1

# So many proposals are fitted, and so many fits are finished.
_MOST_FITTED = 8
_MOST_FINISHED = 2
# So many radii are tried for the objects; a later one is taken where its contrast is this many times as high.
_MOST_PLACES = 2
_MUCH_BETTER = 4.0
# Objects with less than this share of the plain ones' contrast are not there.
_PRESENT = 0.4
# A ring is closed where at most this share of it lacks in one piece.
_MOST_LACKING = 0.2
_FEWEST = 4
# Growth looks this many places beyond an arc's ends, and goes on for so many rounds.
_REACH = 3
_MOST_GROWTHS = 8


@dataclass(frozen=True, slots=True, eq=False)
class FoundRing:
    """A ring with its draws on its objects, and the score of its program."""

    fit: CurveFit
    score: float


def find_rings(session: Session) -> list[Answer]:
    """The rings of a photo as finished programs, the most worth first."""
    answers: list[Answer] = []
    for ring in found_rings(session):
        answer = answer_of(session, ring.fit, "circular", ring.score)
        if session.config.strict:
            answers += session.completed(partial(ring_in_table1, session, ring.fit, answer))
        else:
            answers.append(answer)
    return answers


def found_rings(session: Session) -> tuple[FoundRing, ...]:
    """The rings of a photo, the best first; computed once in a search, for all that start from rings."""
    if session.rings is None:
        session.tell("turning", 0.82)
        fits: list[CurveFit] = []
        with session.until_interrupted():
            for proposal in ring_proposals(session.evidence, seed=session.config.seed)[:_MOST_FITTED]:
                if not session.go_on():
                    break
                fit = ring_fit(session, proposal)
                if fit is None:
                    continue
                fits.append(fit)
                session.record("ring", program=fit.filling.program(fit.z, ()), score=fit.quality)
        fits.sort(key=lambda fit: -curve_score(fit))  # a third of a ring agrees as well as all of it
        session.rings = tuple(sorted(_all_finished(session, fits), key=lambda ring: -ring.score))
    return session.rings


def _all_finished(session: Session, fits: list[CurveFit]) -> list[FoundRing]:
    """The best fits finished; the very best of them even where the search is over."""
    rings: list[FoundRing] = []
    with session.until_interrupted():
        for fit in fits[:_MOST_FINISHED]:
            if rings and not session.go_on():
                break
            rings.append(_finished(session, fit))
    return rings if rings or not fits else [_finished(session, fits[0])]


def answer_of(session: Session, fit: CurveFit, structure: StructureFound, score: float) -> Answer:
    """A fitted program as an answer, with its own focal where that is not the one stated."""
    stated = fit.focal_mm == session.evidence.focal_mm
    return Answer(
        fit.filling.program(fit.z, ()),
        structure,
        score,
        score,
        focal_mm=None if stated else round(fit.focal_mm, 2),
        focal_reason="" if stated else "estimated from the pattern, its ring taken as a circle",
    )


def ring_filling(count: int, *, drawn: int | None = None) -> Filling:
    """The sketch of a ring of `count` objects; of `drawn` objects side by side where it is not closed."""
    angle = f"360/{count}*j + ?a" if drawn is None else "?s*j + ?a"
    text = (
        "SetCameraPose(rx=??, ry=??)\n"
        f"for j in range(0, {count if drawn is None else drawn}):\n"
        f"    Draw(x=?r*Cos({angle}) + ?x, y=?r*Sin({angle}) + ?y)\n"
    )
    return filling_of(text)


def ring_fit(session: Session, proposal: RingProposal) -> CurveFit | None:
    """The proposal refined by its objects' places."""
    filling = ring_filling(proposal.count)
    values = {
        "camera.rx": proposal.rx_deg,
        "camera.ry": proposal.ry_deg,
        "draw.x.radius.1": proposal.radius,
        "draw.x.angle.1": 0.0,
        "draw.x.offset.1": float(proposal.center[0]),
        "draw.y.offset.1": float(proposal.center[1]),
    }
    return _fitted(session, filling, values, focal_mm=proposal.focal_mm, rounds=4)


def _fitted(
    session: Session, filling: Filling, values: dict[str, float], *, focal_mm: float, rounds: int
) -> CurveFit | None:
    """A filling fitted from these numbers; None where too few of its objects are in sight."""
    start = measured(session.evidence, filling, numbers_of(filling, values), focal_mm=focal_mm)
    return None if start is None else _followed(session, start, rounds=rounds)


def _followed(session: Session, fit: CurveFit, *, rounds: int) -> CurveFit:
    """Some rounds of registration, with the focal free where nobody stated it."""
    if not session.focal_is_free:
        return follow(session.evidence, fit, rounds=rounds)
    if fit.focal_mm == session.evidence.focal_mm:
        fit = follow(session.evidence, fit, rounds=rounds)
    return follow(session.evidence, fit, rounds=3, free_focal=True)


def _finished(session: Session, fit: CurveFit) -> FoundRing:
    """The ring as far as it goes, its draws put where the objects sit."""
    fit = with_paid_focal(session.evidence, _extended(session, fit))
    # Where most of the drawing repeats is where the objects are; how surely it repeats, any radius may tell.
    found, score = fit, curve_score(fit)
    for rank, place in enumerate(places(session.evidence, _ring_of(session, fit))[:_MOST_PLACES]):
        moved = _moved(session, fit, place)
        if moved is None:
            continue
        score = max(score, curve_score(moved))
        if rank == 0 or moved.mean > _MUCH_BETTER * found.mean:
            found = moved
    return FoundRing(found, score)


def _moved(session: Session, fit: CurveFit, place: Place) -> CurveFit | None:
    """The fit with its draws on the objects, fitted once more."""
    values = values_of(fit)
    values["draw.x.radius.1"] = place.radius
    values["draw.x.angle.1"] += place.turn_deg
    moved = measured(session.evidence, fit.filling, numbers_of(fit.filling, values), focal_mm=fit.focal_mm)
    if moved is None:
        return None
    free = fit.focal_mm != session.evidence.focal_mm
    return follow(session.evidence, moved, rounds=3, free_focal=free)


def _extended(session: Session, fit: CurveFit) -> CurveFit:
    """The ring as far as its objects go: closed, or an arc that grew from where the objects are plain.

    A ring that was fitted under a pose or count a little off holds on a part of the circle only; that part,
    fitted by itself, says where the next objects are.
    """
    count = len(fit.filling.pattern.index)
    first, length = _best_run(fit)
    if length >= (1 - _MOST_LACKING) * count:
        return fit
    values = values_of(fit)
    step = 360 / count
    values |= {"draw.x.angle.j": step, "draw.x.angle.1": values["draw.x.angle.1"] + first * step}
    filling = ring_filling(0, drawn=max(length, _FEWEST))
    arc = _fitted(session, filling, values, focal_mm=fit.focal_mm, rounds=2)
    if arc is None:
        return fit
    for _ in range(_MOST_GROWTHS):
        values, drawn = values_of(arc), len(arc.filling.pattern.index)
        step = values["draw.x.angle.j"]
        slots = round(360 / abs(step))
        if drawn >= slots - 1 or slots > 60:
            closed = _fitted(session, ring_filling(slots), values, focal_mm=arc.focal_mm, rounds=3)
            return closed if closed is not None and closed.quality > 0.7 * arc.quality else arc
        values["draw.x.angle.1"] -= _REACH * step
        filling = ring_filling(0, drawn=drawn + 2 * _REACH)
        wider = measured(
            session.evidence, filling, numbers_of(filling, values), focal_mm=arc.focal_mm, side=arc.side
        )
        if wider is None:
            return arc
        first, length = _best_run(wider, closed=False)
        if length <= drawn:
            return arc
        values["draw.x.angle.1"] += first * step
        filling = ring_filling(0, drawn=length)
        grown = _fitted(session, filling, values, focal_mm=arc.focal_mm, rounds=2)
        if grown is None or grown.quality < 0.5 * arc.quality:
            return arc
        arc = grown
    return arc


def _best_run(fit: CurveFit, *, closed: bool = True) -> tuple[int, int]:
    """The run of draws with most objects: its first index and its length; single lacks do not end it.

    Draws out of sight neither help nor hurt. `closed`: the run may go on past the last index at the first.
    """
    count = len(fit.filling.pattern.index)
    worth = np.zeros(count)
    sure = float(fit.contrast.clamp(min=0).quantile(0.75))
    worth[fit.index[:, 1].long().numpy()] = np.clip(fit.contrast.numpy() - _PRESENT * sure, -0.3 * sure, sure)
    best, found = 0.0, (0, 0)
    for first in range(count):
        if worth[first] <= 0:
            continue
        reach = count if closed else count - first
        sums = np.cumsum(worth[(first + np.arange(reach)) % count])
        last = int(sums.argmax())
        if sums[last] > best:
            best, found = float(sums[last]), (first, last + 1)
    return found


def _ring_of(session: Session, fit: CurveFit) -> Ring:
    values = values_of(fit)
    seen = fit.filling.pattern.image_from_plane(
        fit.theta, size=session.evidence.image.size, focal_mm=fit.focal_mm
    )
    return Ring(
        center=np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]]),
        radius=values["draw.x.radius.1"],
        first_deg=values["draw.x.angle.1"],
        step_deg=values.get("draw.x.angle.j", 360 / len(fit.filling.pattern.index)),
        index=fit.index[:, 1].numpy(),
        weights=fit.contrast.numpy().astype(float),
        image_from_plane=seen.numpy(),
    )

"""Rings and hybrids in the words of the paper's Table 1, which has no phase and few ways to say a count.

Where only its programs are asked for (`strict`), what was found without that limit is put as Table 1 comes
nearest to it, and fitted once more with what the table leaves free: objects stand at whole multiples of the
angle's step, the radius is one number or `Real*i`, the bounds of a ring are `Real*i`. A note says how far
this is from the free fit; what has no such words is no answer.
"""

from dataclasses import replace

import numpy as np

from p3i.grammar.departures import departures
from p3i.grammar.leaves import leaves, with_leaves
from p3i.search.answer import Answer
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import curve_score, follow, measured, numbers_of, values_of
from p3i.search.forms.filling import Filling
from p3i.search.forms.spelled import ring_filling, rings_filling
from p3i.search.judge.region import objects_px
from p3i.search.look.session import Session
from p3i.search.result import NEEDED

_ROUNDS = 3
_NAMES = {"lattice": "a lattice", "circular": "a ring", "hybrid": "a hybrid"}


def within_table1(look: Session, answers: list[Answer]) -> list[Answer]:
    """The answers that Table 1 can write; the session remembers what else would have been one."""
    within = []
    for answer in answers:
        if departures(answer.program):
            _unwritable(look, answer)
        else:
            within.append(answer)
    return within


def unwritable_note(look: Session) -> str:
    """What was found besides the answer that Table 1 cannot write."""
    names = " and ".join(_NAMES[structure] for structure in sorted(look.unwritable))
    return f"Table 1 cannot write all that was found: {names} would be an answer without strict"


def in_table1(look: Session, fit: Fit, free: Answer) -> list[Answer]:
    """The answer in the words of Table 1, fitted anew; empty where it has none for it."""
    if free.structure == "lattice":
        return [free]
    return (_ring if free.structure == "circular" else _hybrid)(look, fit, free)


def _ring(look: Session, fit: Fit, free: Answer) -> list[Answer]:
    """The ring or arc of a fit with phase 0; empty where too few of its objects are in sight then.

    Angles are counted from 0 in steps, so the objects move along the circle by up to half a step.
    """
    values, drawn = values_of(fit), len(fit.filling.pattern.index)
    step, first = values.get("draw.x.angle.j"), 0
    if step is not None:
        first = round(values["draw.x.angle.1"] % 360 / step)
    filling = ring_filling(drawn, drawn=None if step is None else drawn, first=first, phase=False)
    # `i` is 1 where no loop binds it: the table has no other way to say how many.
    bounds = {
        "for_j.start.1": 0.0,
        "for_j.start.i": first,
        "for_j.stop.1": 0.0,
        "for_j.stop.i": first + drawn,
    }
    return _fitted(look, fit, free, filling=filling, values=values, bounds=bounds)


def _hybrid(look: Session, fit: Fit, free: Answer) -> list[Answer]:
    """Rings around one centre with multiples of one number for radii, and phase 0.

    Empty where the table has no words for them: a ring along a line, a fan that begins at another angle.
    """
    values, numbers = values_of(fit), leaves(free.program)
    first, stop = round(numbers["for_i.start.1"]), round(numbers["for_i.stop.1"])
    growth, fan = values.get("draw.x.radius.i", 0.0), numbers["for_j.stop.i"] != 0
    count = round(numbers["for_j.stop.i" if fan else "for_j.stop.1"])
    phase = (values["draw.x.angle.1"] + 180) % 360 - 180
    elsewhere = fan and abs(phase) > abs(values["draw.x.angle.j"]) / 2
    if growth <= 0 or "draw.x.offset.i" in values or elsewhere:
        return _unwritable(look, free)
    # Rings are counted from the centre; those of a fan have so many objects as their number says.
    shift = 0 if fan else max(round(values["draw.x.radius.1"] / growth), 1 - first)
    filling = rings_filling(first + shift, stop + shift, count, fan=fan, grows=True, moves=False, table1=True)
    # With `count*i` turns the ring i is drawn i times over, each object on itself (DESIGN 2.2).
    bounds = {"for_j.stop.1": 0.0, "for_j.stop.i": count}
    return _fitted(look, fit, free, filling=filling, values=values, bounds=bounds)


def _fitted(
    look: Session,
    fit: Fit,
    free: Answer,
    *,
    filling: Filling,
    values: dict[str, float],
    bounds: dict[str, float],
) -> list[Answer]:
    """The filling fitted from `values`, with its loops' `bounds` put as Table 1 says them."""
    evidence = look.evidence
    start = measured(evidence, filling, numbers_of(filling, values), focal_mm=fit.focal_mm)
    if start is None:
        return []
    moved = follow(evidence, start, rounds=_ROUNDS, free_focal=free.focal_mm is not None)
    answer = replace(
        free,
        program=with_leaves(filling.program(moved.z, ()), bounds),
        score=curve_score(moved),
        focal_mm=None if free.focal_mm is None else round(moved.focal_mm, 2),
    )
    away = _median_px(look, answer, free)
    note = f"Table 1 has no phase: the objects lie {away:.1f} pixels from the free fit"
    return [replace(answer, notes=(*free.notes, note))]


def _median_px(look: Session, answer: Answer, free: Answer) -> float:
    """How far the objects of an answer on the photo typically lie from the nearest of another one's."""
    evidence = look.evidence
    ours, theirs = (objects_px(one, evidence.image, evidence.focal_mm)[:, :2] for one in (answer, free))
    if len(ours) == 0 or len(theirs) == 0:
        return 0.0
    return float(np.median(np.linalg.norm(ours[:, None] - theirs, axis=2).min(1)))


def _unwritable(look: Session, free: Answer) -> list[Answer]:
    """No answer, and a note in the session where it would have been one."""
    if free.score >= NEEDED:
        look.unwritable.add(free.structure)
    return []

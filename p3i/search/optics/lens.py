"""Radial lens distortion: one more number of the last fit, where it pays for itself (p3i/interp/lens.py).

A lens bends the rows of a lattice and makes an egg of a ring, which no camera pose can. So where the objects
of a finished answer lie tells k1, together with all of the program's numbers (`fit/settle.py`). A page that
is not flat bends rows as well; so the lens must pay beside a plane that is bent, too, and a bend that pays
beside the lens is told of. The search itself knows of pinhole cameras only: what it found is finished once
more on the photo straightened of its lens, on a canvas wide enough for all that the photo shows, and put back
onto the photo's canvas.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

from p3i.search.answer import Answer
from p3i.search.config import MOST_K1
from p3i.search.fit.places import follow, measured
from p3i.search.fit.settle import Objects, Settled, objects_of, saved_bits, settled
from p3i.search.forms.whole import scaled, whole_filling
from p3i.search.judge.bits import explained, explained_bits, worth_of_numbers
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.look.straight import Straightened, straightened
from p3i.search.optics.tilt import tells_focal

# An answer is finished anew, and tells the lens anew by it, so many times at most.
_ROUNDS = 3
_K1_DIGITS = 4
# What moves no object by a pixel is not worth a word.
_LEAST_TOLD_PX = 1.0

Search = Callable[[Session], list[Answer]]
Finish = Callable[[Evidence, Answer], Answer]


@dataclass(frozen=True, slots=True, eq=False)
class LensTold:
    """What the objects of an answer tell of a lens: the `fit` of all numbers with k1 among them.

    `worth`: the bits that k1 is worth. `crooked`: what else the objects tell, in words, or None.
    """

    fit: Settled
    worth: float
    crooked: str | None

    @property
    def k1(self) -> float:
        """The lens, within what the options take."""
        most = MOST_K1 - 10.0**-_K1_DIGITS
        return round(max(-most, min(most, self.fit.number("lens"))), _K1_DIGITS)


def lens_told(objects: Objects, *, free_focal: bool = False) -> LensTold:
    """Whether a lens pays for the places of the objects, or a plane that is bent, or both."""
    focal = ("focal",) if free_focal else ()
    straight = dataclasses.replace(objects, k1=0.0)
    flat, lens = settled(straight, *focal), settled(objects, *focal, "lens")
    most = worth_of_numbers(saved_bits(flat, lens, share=objects.each))
    if most <= 0 and flat.fit.alike == 0:  # nothing is left that a bend could explain
        return LensTold(lens, most, None)
    bent, both = settled(straight, *focal, "bend"), settled(objects, *focal, "bend", "lens")

    def worth(less: Settled, more: Settled, numbers: int) -> float:
        return worth_of_numbers(saved_bits(less, more, share=both.share), numbers=numbers)

    alone = worth(flat, lens, 1)
    beside = min(alone, worth(bent, both, 1))
    if min(worth(flat, bent, 3), worth(lens, both, 3)) > 0:
        pair, words = ((lens, both) if beside > 0 else (flat, bent)), "not flat"
    elif beside <= 0 < alone:
        pair, words = (flat, lens), "seen through a lens, or not flat, which the objects do not tell"
    else:
        return LensTold(lens, beside, None)
    one, other = (fit.places() for fit in pair)
    off_px = float((one - other).norm(dim=1).max())
    note = f"{words}: objects lie up to {off_px:.1f} pixels from where one plane would have them"
    return LensTold(lens, beside, note if off_px >= _LEAST_TOLD_PX else None)


def with_lens(session: Session, answers: list[Answer], finish: Finish) -> list[Answer]:
    """The answers, the best of them finished under the lens that its objects tell, if they tell one.

    `finish` draws a lattice anew; it is given the straightened photo, and an answer on it, and returns one
    that is worth what it explains there. What is not flat is told of in a note. A search that was cut short
    looks for no lens.
    """
    if not answers or session.stopped is not None:
        return answers
    with session.until_interrupted():
        return [_with_lens(session, answers[0], finish), *answers[1:]]
    return answers


def through_lens(session: Session, k1: float, search: Search) -> list[Answer]:
    """What `search` finds on the photo freed of a lens that is known, on the photo's canvas."""
    with session.until_interrupted():
        seen = straightened(session.evidence.image, k1)
        again = dataclasses.replace(session, evidence=seen.looked_at(session.evidence))
        found = search(again)
        session.stopped = again.stopped
        return [_on_photo(seen, answer) for answer in found]
    return []


def _with_lens(session: Session, answer: Answer, finish: Finish) -> Answer:
    evidence, free_focal = session.evidence, tells_focal(answer)
    objects = objects_of(evidence, answer.program, focal_mm=answer.focal_mm)
    if objects is None:
        return answer
    told = lens_told(objects, free_focal=free_focal)
    if told.worth <= 0:
        return _noted(answer, told)
    before = explained_bits(evidence, answer)
    best, seen = answer, straightened(evidence.image, 0.0)
    for _ in range(_ROUNDS):
        fit, now = told.fit, told.k1
        session.tell("straightening the photo of its lens", 0.97)
        session.record("lens", k1=now, spread=fit.sigma("lens"), objects=len(fit.objects.index))
        focal_mm = math.exp(fit.number("focal")) if free_focal else answer.focal_mm
        start = _on_photo(seen, dataclasses.replace(best, program=fit.program(), focal_mm=focal_mm))
        seen = straightened(evidence.image, now)
        straight, start = seen.looked_at(evidence), _rescaled(start, 1 / seen.scale)
        found = finish(straight, start) if answer.structure == "lattice" else _followed(straight, start)
        if found is None:
            return answer
        worth = answer.worth + found.worth - before + told.worth
        best = dataclasses.replace(found, worth=worth, notes=answer.notes)
        objects = objects_of(straight, best.program, focal_mm=best.focal_mm, seen=seen)
        if objects is None:
            return answer
        told = lens_told(objects, free_focal=free_focal)
        if abs(told.k1 - now) <= told.fit.sigma("lens"):
            break
    if best.worth < answer.worth or told.worth <= 0:
        return answer
    sigma, count = told.fit.sigma("lens"), len(told.fit.objects.index)
    note = f"lens: k1 = {seen.k1:.3f} +- {sigma:.3f}, from {count} objects"
    return _noted(dataclasses.replace(_on_photo(seen, best), notes=(*answer.notes, note)), told)


def _followed(evidence: Evidence, answer: Answer) -> Answer | None:
    """A ring or hybrid on a straightened photo, fitted from where it is, and worth what it explains there."""
    focal_mm = answer.focal_mm or evidence.focal_mm
    start = measured(evidence, *whole_filling(answer.program), focal_mm=focal_mm)
    if start is None:
        return None
    fit = follow(evidence, start, rounds=3, free_focal=tells_focal(answer))
    focal_mm = fit.focal_mm if answer.focal_mm is not None else None
    answer = dataclasses.replace(answer, program=fit.filling.program(fit.z, ()), focal_mm=focal_mm)
    return explained(evidence, answer)


def _noted(answer: Answer, told: LensTold) -> Answer:
    notes = () if told.crooked is None else (told.crooked,)
    return dataclasses.replace(answer, notes=(*answer.notes, *notes))


def _on_photo(seen: Straightened, answer: Answer) -> Answer:
    """An answer on the straightened photo, in units of the photo's canvas, with its k1."""
    return dataclasses.replace(_rescaled(answer, seen.scale), lens_k1=seen.k1)


def _rescaled(answer: Answer, factor: float) -> Answer:
    """The answer in units of a canvas `factor` times as small."""
    focal_mm = None if answer.focal_mm is None else answer.focal_mm * factor
    return dataclasses.replace(answer, program=scaled(answer.program, factor), focal_mm=focal_mm)

"""How far a ring goes: closed, or an arc that grew from where its objects are plain."""

import numpy as np

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import fitted, measured, numbers_of, values_of
from p3i.search.forms.filling import Filling, standing
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.recurrence import MOST_HIDDEN
from p3i.search.look.session import Session

# Objects with less than this share of the plain ones' contrast are not there.
_PRESENT = 0.4
# Growth looks this many places beyond an arc's ends.
_REACH = 3


def as_far_as_it_goes(look: Session, fit: Fit) -> Fit:
    """The ring as far as its objects go.

    A ring that was fitted under a pose or count a little off holds on a part of the circle only; that part,
    fitted by itself, says where the next objects are.
    """
    count = len(fit.pattern.index)
    first, length = _best_run(fit)
    if length >= (1 - MOST_HIDDEN) * count:
        return fit

    def of(slots: int, *, drawn: int | None = None) -> Filling:
        return standing(ring_filling(slots, drawn=drawn), upright=fit.pattern.upright)

    values = values_of(fit)
    step = 360 / count
    values |= {"draw.x.angle.j": step, "draw.x.angle.1": values["draw.x.angle.1"] + first * step}
    filling = of(0, drawn=max(length, FEWEST_OBJECTS))
    arc = fitted(look, filling, values, focal_mm=fit.focal_mm, rounds=2)
    if arc is None:
        return fit
    while True:  # each turn takes in one object more, at least, and a circle holds no more than its slots
        values, drawn = values_of(arc), len(arc.pattern.index)
        step = values["draw.x.angle.j"]
        slots = round(360 / abs(step))
        if drawn >= slots - 1 or slots > 60:
            closed = fitted(look, of(slots), values, focal_mm=arc.focal_mm, rounds=3)
            return closed if closed is not None and closed.quality > 0.7 * arc.quality else arc
        values["draw.x.angle.1"] -= _REACH * step
        filling = of(0, drawn=drawn + 2 * _REACH)
        wider = measured(
            look.evidence, filling, numbers_of(filling, values), focal_mm=arc.focal_mm, side=arc.side
        )
        if wider is None:
            return arc
        first, length = _best_run(wider, closed=False)
        if length <= drawn:
            return arc
        values["draw.x.angle.1"] += first * step
        filling = of(0, drawn=length)
        grown = fitted(look, filling, values, focal_mm=arc.focal_mm, rounds=2)
        if grown is None or grown.quality < 0.5 * arc.quality:
            return arc
        arc = grown


def _best_run(fit: Fit, *, closed: bool = True) -> tuple[int, int]:
    """The run of draws with most objects: its first index and its length; single lacks do not end it.

    Draws out of sight neither help nor hurt. `closed`: the run may go on past the last index at the first.
    """
    count = len(fit.pattern.index)
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

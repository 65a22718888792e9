"""How far rings go on: further ones at either end that hold as well."""

from dataclasses import replace

from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import follow, measured, numbers_of, values_of
from p3i.search.fit.rings import KEPT_QUALITY, evenly_sure
from p3i.search.forms.spelled import fan_count, rings_of, with_rings
from p3i.search.look.session import Session

_MOST_GROWTHS = 4
# Whether a further ring is there is looked at in patches of this share of the fit's: the outermost ring may
# lie close to a rim.
_CLOSE_LOOK = 0.6


def with_further_rings(look: Session, fit: Fit) -> Fit:
    """The same with further rings at either end that hold as well; those found before an interrupt."""
    found = [fit]
    with look.until_interrupted():
        while len(found) <= _MOST_GROWTHS and (more := _one_more(look, found[-1])) is not None:
            found.append(more)
    return found[-1]


def _one_more(look: Session, fit: Fit) -> Fit | None:
    """The fit with one ring more, after its last or before its first; None where neither holds."""
    evidence, side = look.evidence, _CLOSE_LOOK * fit.side
    values, fan = values_of(fit), fan_count(fit.filling)
    first, stop = rings_of(fit.filling)
    for begin, end in ((first, stop + 1), (first - 1, stop)):
        if fan and (begin < 1 or fan * (end - 1) * abs(values["draw.x.angle.j"]) > 360.5):
            continue
        if values["draw.x.radius.1"] + begin * values.get("draw.x.radius.i", 0.0) <= 0:
            continue
        filling = with_rings(fit.filling, first=begin, stop=end)
        more = measured(evidence, filling, numbers_of(filling, values), focal_mm=fit.focal_mm, side=side)
        now = measured(evidence, fit.filling, fit.z, focal_mm=fit.focal_mm, side=side)
        if more is None or now is None or len(more.contrast) < len(fit.contrast) + 3:
            continue
        if evenly_sure(more) and more.mean > KEPT_QUALITY * now.mean:
            moved = follow(evidence, more, rounds=2, free_focal=look.focal_is_free)
            whole = measured(evidence, filling, moved.z, focal_mm=moved.focal_mm, side=fit.side)
            if whole is not None:
                return replace(whole, cost=moved.cost)
    return None

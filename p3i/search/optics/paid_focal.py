"""Whether a ring's own focal pays for itself, against the one that was assumed."""

import math

from p3i.interp.camera import Camera
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import follow, measured, numbers_of, values_of
from p3i.search.look.session import Session

# A free focal must lower the logarithm of the misfit, times the objects, by this much, or the quality rise by
# this factor; misfits are taken to lie between these.
_FOCAL_PAYS = 6.0
_MORE_QUALITY = 1.1
_LEAST_MISFIT, _WORST_MISFIT = 0.01, 5.0


def with_paid_focal(look: Session, fit: Fit) -> Fit:
    """The fit with the focal that was assumed, where another one does not pay for itself.

    One more number always fits a little better; whether it tells something shows an F-test on the misfit.
    """
    assumed = look.evidence.focal_mm
    if fit.focal_mm == assumed:
        return fit
    values = values_of(fit)
    camera = Camera(values["camera.rx"], values["camera.ry"], fit.focal_mm).refocused(assumed)
    values |= {"camera.rx": camera.rx_deg, "camera.ry": camera.ry_deg}
    start = measured(look.evidence, fit.filling, numbers_of(fit.filling, values), focal_mm=assumed)
    if start is None:
        return fit
    kept = follow(look.evidence, start, rounds=5)
    misfits = [min(one.cost, _WORST_MISFIT) + _LEAST_MISFIT for one in (kept, fit)]
    gain = len(fit.contrast) * math.log(misfits[0] / misfits[1])
    paid = gain > _FOCAL_PAYS or fit.quality > _MORE_QUALITY * kept.quality
    return fit if paid else kept

"""Whether the focal that a curve tells is worth telling: another one must pay for itself in bits.

A tilted circle fixes the focal, one that is seen straight on does not, and one more number always fits a
little better. So the places of the objects are told with the focal that was assumed, and with the one that
fits best (`fit/settle.py`).
"""

from dataclasses import replace

from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import follow, measured, numbers_of, values_of
from p3i.search.fit.settle import objects_of, saved_bits, settled
from p3i.search.judge.bits import worth_of_numbers
from p3i.search.look.evidence import Evidence


def with_paid_focal(evidence: Evidence, fit: Fit) -> Fit:
    """The fit with the focal that was assumed, where its own one does not pay for itself."""
    assumed = evidence.focal_mm
    if fit.focal_mm == assumed:
        return fit
    values = values_of(fit)
    camera = Camera(values["camera.rx"], values["camera.ry"], fit.focal_mm).refocused(assumed)
    values |= {"camera.rx": camera.rx_deg, "camera.ry": camera.ry_deg}
    start = measured(evidence, fit.filling, numbers_of(fit.filling, values), focal_mm=assumed)
    if start is None:
        return fit
    kept = follow(evidence, start, rounds=3)
    objects = objects_of(evidence, fit.program(), focal_mm=fit.focal_mm)
    if objects is None:
        return fit
    held = objects.filling.z_of(compile(kept.program()).theta)
    more = settled(objects, "focal")
    less = settled(replace(objects, numbers=held, focal_mm=assumed))
    return fit if worth_of_numbers(saved_bits(less, more, share=more.share)) > 0 else kept

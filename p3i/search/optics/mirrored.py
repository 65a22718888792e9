"""The two-fold ambiguity of a tilted circle: the pose mirrored at the line of sight, where it fits as well.

Seen from far away, a circle and everything on it look the same whether the plane leans to one side or to the
other: only perspective, by which near objects are larger and further apart, tells which (the two planes that
cut a cone in circles; Forsyth et al., Invariant descriptors for 3-D object recognition and pose, PAMI 1991).
Whether the objects of an answer tell is asked of the answer itself: its mirror image is fitted to their
places too, and must lie farther from them than the noise of places allows.
"""

import math
from dataclasses import replace

import numpy as np
import torch

from p3i.grammar.leaves import leaves
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.fit.robust import fitted, moving_limits
from p3i.search.fit.settle import Objects, Settled, objects_of, settled
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import misfit
from p3i.search.optics.tilt import TOLD_DEG
from p3i.search.result import NEEDED_BITS

# Planes are not seen more steeply than this.
_STEEPEST_DEG = 80.0


def mirrored_camera(evidence: Evidence, answer: Answer) -> Camera | None:
    """The other camera that the objects of rings fit about as well as the answer's, if there is one.

    None for a program whose draws do not go round a circle, and where the objects tell the two poses apart.
    """
    values = leaves(answer.program)
    if values.get("draw.x.angle.j", 0.0) == 0.0 or "draw.y.angle.j" not in values:
        return None
    objects = objects_of(evidence, answer.program, focal_mm=answer.focal_mm)
    if objects is None:
        return None
    own = settled(objects)
    camera = Camera.of(own.program(), focal_mm=objects.focal_mm)
    other = _mirrored(objects, camera)
    if other is None:
        return None
    found = Camera.of(other.program(), focal_mm=objects.focal_mm)
    apart = math.degrees(math.acos(min(1.0, abs(float(np.dot(found.normal, camera.normal))))))
    # Under the noise that places have on photos, however small it is here (`patches.misfit` is half of it).
    ours, theirs = (_misfit(one) for one in (own, other))
    told_bits = own.share * len(objects.index) * 2 * (theirs - ours) / math.log(2)
    return None if apart < TOLD_DEG or told_bits > NEEDED_BITS else found


def ambiguity_note(camera: Camera) -> str:
    """What to say of an answer whose mirrored pose is as good."""
    return (
        "the tilt may as well be the mirrored one "
        f"(rx={camera.rx_deg:.1f}, ry={camera.ry_deg:.1f}): the objects do not tell which"
    )


def _mirrored(objects: Objects, camera: Camera) -> Settled | None:
    """The program fitted to its objects from the pose mirrored at the line of sight to their middle."""
    size = objects.canvas
    sight = np.array([*(objects.places.numpy().mean(0) - size.middle), camera.focal_px(size)])
    sight /= np.linalg.norm(sight)
    normal = np.array(camera.normal)
    x, y, z = (2 * float(normal @ sight) * sight - normal).tolist()
    mirrored = Camera.from_normal((x, y, z), focal_mm=objects.focal_mm)
    if max(abs(mirrored.rx_deg), abs(mirrored.ry_deg)) > _STEEPEST_DEG:
        return None
    start = objects.numbers.clone()
    start[:2] = torch.tensor([mirrored.rx_deg, mirrored.ry_deg])
    # First the ring moves onto its objects under that camera, then all numbers do.
    limits = moving_limits(objects.filling, start)
    limits[:2] = 0.0
    moved = fitted(
        objects.seen,
        start,
        places=objects.places,
        whiten=objects.whiten,
        weights=objects.weights,
        limits=limits,
    )
    return settled(replace(objects, numbers=moved.numbers))


def _misfit(fit: Settled) -> float:
    there = fit.objects
    return misfit(fit.places() - there.places, whiten=there.whiten, certainty=there.weights)

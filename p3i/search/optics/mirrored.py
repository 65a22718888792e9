"""The two-fold ambiguity of a tilted circle: the pose mirrored at the line of sight, where it fits as well.

Seen from far away, a circle and everything on it look the same whether the plane leans to one side or to the
other: only perspective, by which near objects are larger and further apart, tells which (the two planes that
cut a cone in circles; Forsyth et al., Invariant descriptors for 3-D object recognition and pose, PAMI 1991).
Whether the objects of an answer tell is asked of the answer itself: its mirror image is fitted to them too.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from p3i.grammar.leaves import leaves
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import measured, numbers_of, registered, values_of
from p3i.search.forms.filling import Filling
from p3i.search.forms.whole import whole_filling
from p3i.search.look.evidence import Evidence
from p3i.search.optics.tilt import TOLD_DEG
from p3i.size import Size

Array = NDArray[np.float64]

# The objects tell the poses apart where the misfit is so much larger: by its logarithm, times the objects (an
# F-test), and as a logarithm of likelihoods under the noise that places have.
_TELLS = 6.0
_LEAST_MISFIT, _WORST_MISFIT = 0.01, 5.0
_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class _Turned:
    """A similarity of the plane: complex numbers, p -> factor * p + shift with p = x + y*1j."""

    factor: complex
    shift: complex


def mirrored_camera(evidence: Evidence, answer: Answer) -> Camera | None:
    """The other camera that the objects of rings fit about as well as the answer's, if there is one.

    None for a program whose draws do not go round a circle, and where the objects tell the two poses apart.
    """
    values = leaves(answer.program)
    if values.get("draw.x.angle.j", 0.0) == 0.0 or "draw.y.angle.j" not in values:
        return None
    filling, as_written = whole_filling(answer.program)
    focal_mm = answer.focal_mm or evidence.focal_mm
    camera = Camera.of(answer.program, focal_mm=focal_mm)
    own = _fit(evidence, filling, as_written, focal_mm)
    if own is None:
        return None
    start = _mirror_image(own, camera, evidence.image.size)
    other = None if start is None else _fit(evidence, filling, start, focal_mm)
    if other is None:
        return None
    values = values_of(other)
    found = Camera(values["camera.rx"], values["camera.ry"], focal_mm)
    apart = math.degrees(math.acos(min(1.0, abs(float(np.dot(found.normal, camera.normal))))))
    ours, theirs = (min(fit.cost, _WORST_MISFIT) + _LEAST_MISFIT for fit in (own, other))
    told = len(own.contrast) * min(math.log(theirs / ours), 2 * (theirs - ours))
    if apart < TOLD_DEG or told > _TELLS:
        return None
    return found


def ambiguity_note(camera: Camera) -> str:
    """What to say of an answer whose mirrored pose is as good."""
    return (
        "the tilt may as well be the mirrored one "
        f"(rx={camera.rx_deg:.1f}, ry={camera.ry_deg:.1f}): the objects do not tell which"
    )


def _fit(evidence: Evidence, filling: Filling, z: torch.Tensor, focal_mm: float) -> Fit | None:
    """A few rounds of registration: the last, since where misfits are compared all have gone as far."""
    fit = measured(evidence, filling, z, focal_mm=focal_mm)
    for _ in range(_ROUNDS):
        fit = None if fit is None else registered(evidence, fit, keep_side=True)
    return fit


def _mirror_image(fit: Fit, camera: Camera, size: Size) -> torch.Tensor | None:
    """The numbers [F] of the program that draws the same places, about, from the mirrored pose."""
    pattern = fit.filling.pattern
    plane = pattern.points_at(fit.index, fit.theta).numpy()
    seen = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm).numpy()
    photo = _projected(seen, plane)
    middle = photo.mean(0)
    sight = np.array([*(middle - size.middle), camera.focal_px(size)])
    sight /= np.linalg.norm(sight)
    normal = np.array(camera.normal)
    x, y, z = (2 * float(normal @ sight) * sight - normal).tolist()
    mirrored = Camera.from_normal((x, y, z), focal_mm=fit.focal_mm)
    if abs(mirrored.rx_deg) > 80 or abs(mirrored.ry_deg) > 80:
        return None
    plane_from_image = np.linalg.inv(mirrored.image_from_plane(size).numpy())
    turned = _similarity(plane, _projected(plane_from_image, photo))
    values = values_of(fit)
    values |= {"camera.rx": mirrored.rx_deg, "camera.ry": mirrored.ry_deg}
    for variable in ("1", "i", "j"):
        radius, x, y = (f"draw.{name}.{variable}" for name in ("x.radius", "x.offset", "y.offset"))
        if radius in values:
            values[radius] *= abs(turned.factor)
        if x in values and y in values:
            moved = turned.factor * complex(values[x], values[y]) + turned.shift * (variable == "1")
            values |= {x: moved.real, y: moved.imag}
    values["draw.x.angle.1"] += math.degrees(math.atan2(turned.factor.imag, turned.factor.real))
    return numbers_of(fit.filling, values)


def _projected(matrix: Array, points: Array) -> Array:
    """Points [N, 2] under a homography [3, 3]."""
    at = np.concatenate([points, np.ones((len(points), 1))], 1) @ matrix.T
    return at[:, :2] / at[:, 2:]


def _similarity(points: Array, onto: Array) -> _Turned:
    """The similarity that takes points [N, 2] onto others best, in least squares."""
    a, b = points @ [1, 1j], onto @ [1, 1j]
    centred = a - a.mean()
    factor = complex(np.vdot(centred, b - b.mean()) / max(float(np.vdot(centred, centred).real), 1e-12))
    return _Turned(factor, complex(b.mean() - factor * a.mean()))

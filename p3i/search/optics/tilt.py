"""How well an answer's tilt is known: its standard deviation, from where the objects lie on the photo.

The objects are looked for around the places where the program puts them. How these places move with all of
the program's free numbers, and how far the objects found stray from them, give the numbers' covariance; of
that the plane's normal has its part. A ring seen head-on, or a few small objects, move little under a tilt,
and then the answer's angles say little.

Where an object stands off, and how much neighbours stray alike, `fit/settle.py` knows.
"""

import math

import torch
from torch import Tensor

from p3i.search.answer import Answer
from p3i.search.fit.robust import Fitted
from p3i.search.fit.settle import objects_of, settled
from p3i.search.judge.evaluate import without_lens
from p3i.search.look.evidence import Evidence

TOLD_DEG = 3.0
"""A tilt that is known no better than this is told of in words."""
# What is known before anything is seen: tilts are within this (and the focal as in fit/settle.py).
_TILT_SPREAD_DEG = 30.0


def pose_sigma_deg(evidence: Evidence, answer: Answer) -> float | None:
    """The standard deviation of the angle of the plane's normal, in degrees, for a finished answer.

    `evidence` is of the photo as it was taken. The lens is taken as told, and so is the focal, but for curves
    that were to tell it themselves. At about 42 degrees nothing is known beyond what is taken for granted:
    that people more or less face what they photograph. None where the photo shows fewer than two objects of
    the program.
    """
    evidence = evidence.under(answer.focal_mm or evidence.focal_mm)
    evidence, program = without_lens(evidence, answer.program, answer.lens_k1)
    objects = objects_of(evidence, program)
    if objects is None:
        return None
    told = settled(objects, *(("focal",) if tells_focal(answer) else ()))
    known = torch.zeros(len(told.fit.numbers))
    known[:2] = _TILT_SPREAD_DEG**-2
    covariance = covariance_of(told.fit, objects.numbers, known=known, share=told.share)
    # The camera's angles are the first of a program's numbers.
    sigma_deg = sigma_of_normal_deg(covariance[:2, :2], rx_deg=program.camera.rx_deg)
    return sigma_deg if math.isfinite(sigma_deg) else None


def tells_focal(answer: Answer) -> bool:
    """Whether the places of an answer's objects tell its focal: a lattice's tell that of its cell only."""
    return answer.focal_mm is not None and answer.structure != "lattice"


def covariance_of(fit: Fitted, numbers: Tensor, *, known: Tensor, share: float) -> Tensor:
    """The covariance [V, V] of the numbers that a program is written with, the first of those fitted.

    By how far these and the places disagree, they may be wrong as well.
    """
    count = len(numbers)
    step = (fit.numbers[:count] - numbers)[:, None]
    return fit.covariance(share, known)[:count, :count] + step * step.T


def sigma_of_normal_deg(covariance: Tensor, *, rx_deg: float) -> float:
    """The standard deviation of the normal's angle, in degrees, from the covariance [2, 2] of (rx, ry).

    Along ry the normal (`Camera.normal`) moves by cos(rx) of the angle, across that by all of rx.
    """
    rx_variance, ry_variance = covariance.diagonal().clamp(min=0).tolist()
    return math.sqrt(rx_variance + math.cos(math.radians(rx_deg)) ** 2 * ry_variance)


def doubt_note(sigma_deg: float, *, two_tilts: bool) -> str | None:
    """What to say of a tilt that is known so well, None where that is well enough.

    `two_tilts`: the mirrored tilt is as good, and is told of already.
    """
    if sigma_deg < TOLD_DEG:
        return None
    which = "either tilt" if two_tilts else "the tilt"
    return f"{which} is known to about {sigma_deg:.0f} degrees only"

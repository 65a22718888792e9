"""The score: how likely an answer is right, by a few quantities that every answer has.

Right means the true structure, for a lattice the true lattice, and the plane's normal within two degrees. The
probability is told to people and decides nothing: whether there is an answer is for judge/accept.py to say,
and which one is for the bits. A logistic of the terms below, fitted by benchmarks/calibration.py to answers
for photos and rendered scenes, whose truth is known; docs/benchmarks.md has its reliability diagram.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from p3i.search.result import StructureFound

COEFFICIENTS: Mapping[str, float] = {
    "one": -2.0,
    "curve": 0.15,
    "bits": 0.11,
    "agreement": 1.74,
    "tilt": 0.52,
    "margin": 0.13,
}
"""What each of the `terms` adds to the log odds (base e) of an answer's being right."""

RIGHT_WITHIN_DEG = 2.0
"""The pose of a right answer is at most so far from the true one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signs:
    """What an answer is judged by.

    `bits`: what its program explains of the photo, less what it costs. `agreement`: the mean over the objects
    of how much better the others predict them than half a step away (judge/evaluate.py), 0 to 1.
    `margin_bits`: how much more it explains than the best answer that draws other objects; negative for a
    runner-up. `pose_sigma_deg`: how well its tilt is known, None where nothing tells.
    """

    structure: StructureFound
    bits: float
    agreement: float
    margin_bits: float
    pose_sigma_deg: float | None = None


def probability(signs: Signs) -> float:
    """How likely an answer of these signs is right, 0 to 1."""
    log_odds = sum(COEFFICIENTS[name] * value for name, value in terms(signs).items())
    return 1 / (1 + math.exp(-max(-30.0, min(log_odds, 30.0))))


def terms(signs: Signs) -> dict[str, float]:
    """The quantities that are weighed, by the names of COEFFICIENTS.

    `one`: 1 for every answer. `curve`: 1 where it is no lattice. `bits`: doublings of what it explains.
    `agreement`: as it is. `tilt`: how often the tilt is known twice as well as right answers need it, less
    than 0 where it is known worse. `margin`: doublings of the lead, negative for a runner-up.
    """
    sigma_deg = 90.0 if signs.pose_sigma_deg is None else max(signs.pose_sigma_deg, 0.01)
    return {
        "one": 1.0,
        "curve": float(signs.structure != "lattice"),
        "bits": math.log2(max(signs.bits, 1.0)),
        "agreement": signs.agreement,
        "tilt": math.log2(RIGHT_WITHIN_DEG / sigma_deg),
        "margin": math.copysign(math.log2(1 + abs(signs.margin_bits)), signs.margin_bits),
    }

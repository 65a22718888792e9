"""What a fit saves of the photo's code, in bits, before its program's own length is taken off."""

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Fit
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits, rows_bits


def saved_bits(evidence: Evidence, fit: Fit) -> float:
    """What the objects of a ring's fit save by coming again at its steps: look/recurrence.py."""
    return recurrence_bits(
        evidence, fit.pattern, fit.index, focal_mm=fit.focal_mm, cells=False, theta=fit.theta
    )


def supported_bits(evidence: Evidence, fit: Fit) -> float:
    """What those cells of a lattice save that agree with the others."""
    agreeing = fit.index[fit.support]
    if len(agreeing) < FEWEST_OBJECTS:
        return 0.0
    return rows_bits(evidence, fit.pattern, agreeing, fit.theta, focal_mm=fit.focal_mm)

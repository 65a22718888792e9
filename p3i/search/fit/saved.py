"""What a fit saves of the photo's code, in bits, before its program's own length is taken off."""

from functools import partial

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Fit
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import lie_on_own_grid, recurrence_bits, rows_bits
from p3i.search.result import NEEDED_BITS


def saved_bits(evidence: Evidence, fit: Fit) -> float:
    """What the objects of a ring's fit save by coming again at its steps: look/recurrence.py."""
    return recurrence_bits(
        evidence, fit.pattern, fit.index, focal_mm=fit.focal_mm, cells=False, theta=fit.theta
    )


def supported_bits(evidence: Evidence, fit: Fit) -> float:
    """What those cells of a lattice save that agree with the others.

    On the picture's own grid edges come again whatever it shows: they are worth a look, and no more.
    """
    index = fit.index[fit.support]
    if len(index) < FEWEST_OBJECTS:
        return 0.0
    saved = partial(rows_bits, evidence, fit.pattern, index, fit.theta, focal_mm=fit.focal_mm)
    if lie_on_own_grid(evidence, fit.pattern, index, fit.theta, fit.focal_mm):
        return max(saved(edges=False), min(saved(), NEEDED_BITS))
    return saved()

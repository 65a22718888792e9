"""What a fit saves of the photo's code, in bits, before its program's own length is taken off."""

from dataclasses import replace

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Fit
from p3i.search.fit.judged import sweeps_cells
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits


def saved_bits(evidence: Evidence, fit: Fit) -> float:
    """What the objects of a fit save by coming again at its steps: look/recurrence.py."""
    cells = sweeps_cells(fit.pattern, fit.theta)
    return recurrence_bits(
        evidence, fit.pattern, fit.index, focal_mm=fit.focal_mm, cells=cells, theta=fit.theta
    )


def supported_bits(evidence: Evidence, fit: Fit) -> float:
    """What those cells of a lattice save that agree with the others."""
    if int(fit.support.sum()) < FEWEST_OBJECTS:
        return 0.0
    agreeing = replace(fit, index=fit.index[fit.support], contrast=fit.contrast[fit.support])
    return saved_bits(evidence, agreeing)

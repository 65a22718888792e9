"""What a fit saves of the photo's code, in bits, before its program's own length is taken off."""

from p3i.search.fit.fitted import Fit
from p3i.search.fit.judged import sweeps_cells
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits
from p3i.search.look.thinned import thinned

_MOST_READ = 200


def saved_bits(evidence: Evidence, fit: Fit) -> float:
    """What the objects of a fit save by coming again at its steps: look/recurrence.py."""
    if len(fit.index) < 2:
        return 0.0
    index = fit.index[thinned(fit.index, _MOST_READ)]
    theta, cells = fit.theta, sweeps_cells(fit.pattern)
    saved = recurrence_bits(evidence, fit.pattern, index, focal_mm=fit.focal_mm, cells=cells, theta=theta)
    return saved * len(fit.index) / len(index)

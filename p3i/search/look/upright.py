"""How objects on a curve stand: turned with it, as hours of a dial, or upright, as gondolas of a wheel."""

from dataclasses import replace

from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits

UPRIGHT_NOTE = "the objects stand upright: they do not turn with the ring, as the gondolas of a wheel do not"


def as_it_stands(
    evidence: Evidence, pattern: Pattern, index: Tensor, *, focal_mm: float, theta: Tensor | None = None
) -> tuple[Pattern, float]:
    """The pattern of a curve, its objects `index` [N, 2] taken to stand as they save most, and these bits."""
    both = [replace(pattern, upright=upright) for upright in (False, True)]
    bits = [
        recurrence_bits(evidence, one, index, focal_mm=focal_mm, cells=False, theta=theta) for one in both
    ]
    surer = bits[1] > bits[0]
    return both[surer], bits[surer]

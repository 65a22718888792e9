"""Registration that keeps the limits which a person gave."""

from dataclasses import replace

import torch
from torch import Tensor

from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import follow, measured
from p3i.search.forms.filling import Filling, kept_within, pinned
from p3i.search.look.evidence import Evidence


def followed_within(evidence: Evidence, filling: Filling, z: Tensor, *, rounds: int) -> Fit | None:
    """The filling fitted from z [F]: a number that leaves its limits is held there, the others follow.

    None where too few objects are in sight.
    """
    fit = measured(evidence, filling, z, focal_mm=evidence.focal_mm)
    if fit is None or not filling.moving:
        return fit
    free = follow(evidence, fit, rounds=rounds)
    held = torch.zeros(len(z), dtype=torch.bool)
    for _ in range(len(z)):
        inside = kept_within(filling, free.z)
        out = (inside - free.z).abs() > 1e-9
        if not bool(out.any()):
            break
        held |= out
        start = measured(evidence, pinned(filling, inside, held), inside, focal_mm=evidence.focal_mm)
        if start is None:
            break
        free = follow(evidence, start, rounds=rounds)
        free = replace(free, z=torch.where(held, inside, free.z))
    again = measured(evidence, filling, kept_within(filling, free.z), focal_mm=evidence.focal_mm)
    return again if again is not None and again.mean > fit.mean else fit

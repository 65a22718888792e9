"""Whether a fit of several rings says more than the one that it began with: objects of its own on each."""

import torch

from p3i.search.fit.fitted import FEWEST_SEEN, Fit
from p3i.search.forms.guess import Base

KEPT_QUALITY = 0.6
"""More rings are believed where their objects agree at least so well, compared with the ring's own."""
# Every ring of a hybrid has at least this share of the contrast of the plainest.
_LEAST_RING = 0.25
# Draws of two rings closer than this share of a patch are one object; so large a part may be drawn twice,
# where rings cross.
_SAME_OBJECT = 0.4
_MOST_TWICE = 0.25


def says_more(fit: Fit, than: Base) -> bool:
    """Whether a fit says more than the ring alone: more objects, nearly as sure, on each of its rings."""
    if len(fit.contrast) <= than.objects + 1 or fit.quality < KEPT_QUALITY * than.quality:
        return False
    return _drawn_once(fit) and evenly_sure(fit)


def _drawn_once(fit: Fit) -> bool:
    """Whether rings have objects of their own; laid over itself a step further, one finds its own again."""
    at = fit.pattern.points_at(fit.index, fit.theta)
    other_ring = fit.index[:, None, 0] != fit.index[None, :, 0]
    twice = (other_ring & (torch.cdist(at, at) < _SAME_OBJECT * fit.side)).any(1)
    return float(twice.double().mean()) < _MOST_TWICE


def evenly_sure(fit: Fit) -> bool:
    """Whether there are several rings, with enough of each in sight to tell, and most objects of each there.

    The median, not the mean: a ring that crosses another one has a few of that one's objects for its own.
    """
    rings, drawn = fit.index[:, 0], fit.pattern.index[:, 0]
    typical: list[float] = []
    for i in rings.unique():
        own = fit.contrast[rings == i]
        if len(own) < min(FEWEST_SEEN, int((drawn == i).sum())):
            return False
        typical.append(float(own.quantile(0.5)))
    return len(typical) > 1 and min(typical) >= _LEAST_RING * max(typical)

"""One fit for every guess: over the cells of a lattice, over patches about the draws of anything else."""

from dataclasses import replace

import torch

from p3i.search.fit.arc import as_far_as_it_goes
from p3i.search.fit.fitted import Fit, as_large_as_seen
from p3i.search.fit.grow import grow
from p3i.search.fit.places import follow, measured, settled
from p3i.search.fit.rings import says_more
from p3i.search.fit.saved import saved_bits, supported_bits
from p3i.search.fit.within import followed_within
from p3i.search.forms.filling import standing, with_settings
from p3i.search.forms.guess import Guess
from p3i.search.forms.length import cost_bits
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.patches import spacing
from p3i.search.look.session import Session
from p3i.search.look.upright import as_it_stands
from p3i.search.result import NEEDED_BITS

_ROUNDS, _ROUNDS_WITHIN = 4, 3
# A guess that says more than what it began with must be as sure as this share of it before it is fitted.
_LEAST_SHARE = 0.3


def fit_places(look: Session, guess: Guess) -> Fit | None:
    """The guess fitted to where its objects are; None where too few of them show.

    A guess with a focal of its own may move it. One that a person's sketch says keeps that sketch's limits.
    """
    if guess.settled:
        nothing = torch.zeros(0)
        cells = torch.zeros(0, 2, dtype=torch.float64)
        focal_mm = look.evidence.focal_mm
        return Fit(guess.filling, guess.z, focal_mm, 0.0, cells, nothing, covered=guess.promise)
    if guess.filling is lattice_filling():
        grown = grow(look.evidence, guess)
        return None if grown is None else replace(grown, bits=supported_bits(look.evidence, grown))
    if guess.focal_mm is None:
        setting = guess.filling.settings[guess.setting]
        filling = with_settings(guess.filling, (setting,))
        return followed_within(look.evidence, filling, guess.z, rounds=_ROUNDS_WITHIN)
    if guess.base is None:
        start = measured(look.evidence, guess.filling, guess.z, focal_mm=guess.focal_mm)
        return None if start is None else _ring(look, start)
    # Where the rings of a fan lie far apart, patches as wide as its draws do are too wide for its inner ring.
    side = min(spacing(guess.filling.pattern, guess.theta), guess.base.side)
    start = measured(look.evidence, guess.filling, guess.z, focal_mm=guess.focal_mm, side=side)
    if start is None or start.mean < _LEAST_SHARE * guess.base.mean:
        return None
    return follow(look.evidence, start, rounds=3, free_focal=look.focal_is_free, keep_side=True)


def _ring(look: Session, start: Fit) -> Fit:
    """A ring fitted from a start, its objects turned with it, or upright where they save more so."""
    starts = [start]
    if _stands_upright(look, start):
        filling = standing(start.filling, upright=True)
        upright = measured(look.evidence, filling, start.z, focal_mm=start.focal_mm)
        starts += [] if upright is None else [upright]
    rings = [as_far_as_it_goes(look, settled(look, one, rounds=_ROUNDS)) for one in starts]
    return max((replace(ring, bits=saved_bits(look.evidence, ring)) for ring in rings), key=worth)


def _stands_upright(look: Session, fit: Fit) -> bool:
    pattern, _ = as_it_stands(look.evidence, fit.pattern, fit.index, focal_mm=fit.focal_mm, theta=fit.theta)
    return pattern.upright


def holds(fit: Fit, guess: Guess) -> bool:
    """Whether a fit is worth drawing: a lattice whose cells come again, more than what it began with."""
    if guess.base is not None:
        return says_more(fit, guess.base)
    if guess.filling is not lattice_filling() or guess.settled:
        return True
    return certain(fit) if guess.doubted else fit.bits > 0


def worth(fit: Fit) -> float:
    """How much a fit explains, and how well, before it is known which objects are drawn.

    Comparable between fits of one kind of form.
    """
    if len(fit.index) == 0:
        return fit.covered
    if fit.filling is lattice_filling():
        return fit.bits
    rings = len(fit.index[:, 0].unique())
    return as_large_as_seen(fit.bits, fit.covered) if rings == 1 else fit.mean * len(fit.contrast)


def certain(fit: Fit) -> bool:
    """Whether only a better fit could still matter: a lattice whose cells alone make an answer."""
    return fit.filling is lattice_filling() and fit.bits - cost_bits(fit.program()) > NEEDED_BITS

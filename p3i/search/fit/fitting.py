"""One fit for every guess: over the cells of a lattice, over patches about the draws of anything else."""

from dataclasses import replace

import torch

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.arc import as_far_as_it_goes
from p3i.search.fit.fitted import Fit, as_large_as_seen
from p3i.search.fit.grow import grow
from p3i.search.fit.places import follow, measured, settled
from p3i.search.fit.rings import says_more
from p3i.search.fit.saved import saved_bits
from p3i.search.fit.within import followed_within
from p3i.search.forms.filling import standing, with_settings
from p3i.search.forms.guess import Guess
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.patches import spacing
from p3i.search.look.session import Session
from p3i.search.look.upright import as_it_stands

_ROUNDS, _ROUNDS_WITHIN = 4, 3
# A guess that says more than what it began with must be as sure as this share of it before it is fitted.
_LEAST_SHARE = 0.3
# A pattern of n cells counts as if it had _FEW_CELLS fewer: the numbers and the mean cell take their part.
_FEW_CELLS = 10
# Below that number they still count a little, so that a pattern of few cells wins where there is no other.
_DOUBT = 0.05
# A fit of less worth is none: on rendered scenes and photos the fits of true patterns had five times as much.
_LEAST_WORTH = 5e-4
# A lattice of this worth is certain enough that only a better one could matter.
_CERTAIN = 0.025


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
        return grow(look.evidence, guess)
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
    """Whether a fit is worth drawing: a lattice of some cells, more than what it began with."""
    if guess.base is not None:
        return says_more(fit, guess.base)
    return guess.filling is not lattice_filling() or guess.settled or worth(fit) >= _LEAST_WORTH


def worth(fit: Fit) -> float:
    """How much a fit explains, and how well, before it is known which objects are drawn.

    Comparable between fits of one kind of form.
    """
    if len(fit.index) == 0:
        return fit.covered
    if fit.filling is not lattice_filling():
        rings = len(fit.index[:, 0].unique())
        return as_large_as_seen(fit.bits, fit.covered) if rings == 1 else fit.mean * len(fit.contrast)
    contrast = fit.contrast[fit.support]
    count = len(contrast)
    if count < FEWEST_OBJECTS:
        return 0.0
    beyond_chance = max(1 - _FEW_CELLS / count, _DOUBT * (1 - FEWEST_OBJECTS / count))
    return fit.covered * float(contrast.mean()) * beyond_chance


def certain(fit: Fit) -> bool:
    """Whether only a better fit could still matter."""
    return fit.filling is lattice_filling() and worth(fit) > _CERTAIN

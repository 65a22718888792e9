"""The extents of a sketch that a person wrote: which of the settings that it allows draws what is there.

Numbers that a person bounded stay within their bounds all the way.
"""

import torch
from torch import Tensor

from p3i.search.extent.centring import centred, standing_out
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.places import measured
from p3i.search.fit.within import followed_within
from p3i.search.forms.filling import Filling, kept_within, with_settings
from p3i.search.forms.settings import best_setting, widened
from p3i.search.look.patches import half_steps, patch_contrast
from p3i.search.look.session import Session
from p3i.search.look.thinned import thinned

# Of more objects in sight than this, so many say which are there.
_MOST_WEIGHED = 2000
# Rounds of registration.
_ROUNDS, _LAST_ROUNDS = 3, 5
# A pattern that was caught by its middle may grow by an object as often as this.
_EXTENTS_TRIED = 10
# An object is worth drawing from this share of the typical contrast on.
_PRESENT = 0.35
# Half a step on, the draws must stand out from the ground by this factor more.
_MORE_OBJECT = 1.3
_SHIFTS = [(1, 0), (-1, 0), (0, 1), (0, -1)]


def drawn_as_asked(look: Session, fit: Fit) -> Drawn:
    """A filling that was fitted to its objects, its extents chosen anew."""
    setting = fit.filling.settings[0]
    now = _on_objects(look, fit)
    wide = widened(fit.filling)
    for _ in range(_EXTENTS_TRIED):
        chosen = _best_extent(look, wide, now, setting)
        if chosen is None or (chosen[1] == setting and torch.equal(chosen[0], now.z)):
            break
        z, setting = chosen
        filling = with_settings(fit.filling, (setting,))
        moved = followed_within(look.evidence, filling, z, rounds=_ROUNDS)
        if moved is None:
            break
        now = moved
    last = followed_within(look.evidence, now.filling, now.z, rounds=_LAST_ROUNDS)
    best = last if last is not None and last.mean >= now.mean else now
    best = _centred(look, best)
    return Drawn(best.filling.program(best.z, setting), best, best.mean)


def _on_objects(look: Session, fit: Fit) -> Fit:
    """The fit, or the same half a step on, where objects rather than the gaps between them are drawn."""
    best, lead = fit, _MORE_OBJECT * standing_out(look.evidence, fit)
    steps = half_steps(fit.filling.pattern).tolist()
    for i, j in [*steps, *([-i, -j] for i, j in steps)]:
        z = _shifted(fit.filling, fit.z, (i, j))
        moved = None if z is None else measured(look.evidence, fit.filling, z, focal_mm=fit.focal_mm)
        if moved is None or moved.mean < 0.7 * fit.mean:
            continue
        found = standing_out(look.evidence, moved)
        if found > lead:
            best, lead = moved, found
    return best


def _centred(look: Session, fit: Fit) -> Fit:
    """The fit in the middle of its objects, if the limits allow it."""
    moved = centred(look.evidence, fit)
    inside = kept_within(fit.filling, _turned(fit.filling, moved.z))
    again = measured(look.evidence, fit.filling, inside, focal_mm=fit.focal_mm)
    return again if again is not None and again.mean > 0.8 * fit.mean else fit


def _best_extent(
    look: Session, wide: Filling, now: Fit, setting: tuple[int, ...]
) -> tuple[Tensor, tuple[int, ...]] | None:
    """Which objects are there: the setting of the extents that draws most of them and little else.

    Where the sketch's numbers allow, its indices are also counted from one object earlier or later.
    """
    typical = max(now.mean, 0.05)
    best: tuple[float, Tensor, tuple[int, ...]] | None = None
    for shift in [(0, 0), *_SHIFTS]:
        z = now.z if shift == (0, 0) else _shifted(wide, now.z, shift)
        if z is None:
            continue
        gains = _gains(look, wide, z, side=now.side, typical=typical)
        value, chosen = best_setting(wide, gains, setting)
        if best is None or value > best[0] + 0.5 * typical * (shift != (0, 0)):
            best = value, z, chosen
    return None if best is None else best[1:]


def _gains(look: Session, wide: Filling, z: Tensor, *, side: float, typical: float) -> Tensor:
    """What drawing each index gains, [N]: its contrast beyond what an object must have; 0 out of sight."""
    evidence = look.evidence
    theta = wide.theta(z)
    seen = evidence.in_sight(wide.pattern, theta)
    gains = torch.full((len(seen),), -0.02 * typical, dtype=torch.float64)
    if int(seen.sum()) >= 3:
        at = torch.nonzero(seen)[:, 0]
        at = at[thinned(wide.pattern.index[at], _MOST_WEIGHED)]
        index = wide.pattern.index[at].double()
        found = patch_contrast(evidence, wide.pattern, theta, index, side=side, focal_mm=evidence.focal_mm)
        gains[at] = found.double() - _PRESENT * typical
    return gains


def _shifted(filling: Filling, z: Tensor, shift: tuple[float, float]) -> Tensor | None:
    """The numbers that draw at (i, j) what z draws at (i, j) + shift; None where the sketch cannot say it."""
    theta = filling.theta(z)
    paths = filling.pattern.paths
    moved = theta.clone()
    for place, path in enumerate(paths):
        if path.startswith("draw.") and path.endswith(".1"):
            kind = path[:-2]
            for variable, amount in zip(("i", "j"), shift, strict=True):
                moved[place] += amount * theta[paths.index(f"{kind}.{variable}")]
    if torch.allclose(moved, theta):
        return None
    found = filling.z_of(moved)
    exact = torch.allclose(filling.theta(found), moved, atol=1e-6)
    within = torch.allclose(kept_within(filling, _turned(filling, found)), _turned(filling, found))
    return _turned(filling, found) if exact and within else None


def _turned(filling: Filling, z: Tensor) -> Tensor:
    """Angles brought back by whole turns into the limits that a person gave, where they can be."""
    turns = torch.tensor(
        [unknown.range.turns and unknown.hard for unknown in filling.moving], dtype=torch.bool
    )
    lower = torch.tensor([unknown.range.lower for unknown in filling.moving]).double()
    return torch.where(turns, lower + (z - lower) % 360, z)

"""From the coarse grid to a few good fillings: survivors climb by seeded steps, then by gradient descent.

The grid is looked at on a much blurred map, where a filling counts that is off by a third of a step. Each
survivor then tries steps around itself, smaller from round to round, on maps less and less blurred, while the
worse half falls away; what is left descends along the gradient of the generator, all in one batch.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.search.forms.filling import Filling, kept_within, start_values
from p3i.search.forms.guess import Guess
from p3i.search.look.session import Session
from p3i.search.propose.grid import BLUR_SHARES, PointMaps, distinct_share, samples, score_points

# Fillings scored in one go, and the most points that may take.
_MOST_POINTS = 400_000
# One survivor for so many points of the grid, within limits; rounds of climbing and steps tried in each.
_POINTS_A_SURVIVOR = 150
_FEWEST_SURVIVORS, _MOST_SURVIVORS = 48, 384
_ROUNDS = 14
_TRIES = 16
_FIRST_REACH, _LAST_REACH = 0.10, 0.004
# With a start for every number, the grid has so many times fewer points.
_STARTED = 8
# Gradient descent: steps, and the first one as a share of each number's range.
_DESCENTS = 40
_DESCENT_RATE = 0.004
# Fillings whose draws are this close, in steps, are one.
_SAME = 0.3


def search_grid(
    session: Session, maps: PointMaps, filling: Filling, *, budget: int, keep: int
) -> list[Guess]:
    """The best fillings of one setting of the counts, at most `keep`, the best first."""
    if not filling.moving:
        z = torch.zeros(1, 0, dtype=torch.float64)
        score, setting = score_points(maps, filling, z, share=BLUR_SHARES[-1]).max(1)
        return [Guess(filling, z[0], float(score), setting=int(setting))]
    start = start_values(filling)
    if start is not None:  # near its goal already
        budget = max(1, budget // _STARTED)
    z = samples(filling, budget, session.generator)
    if start is not None:
        z = torch.cat([start[None], z])
    z = kept_within(filling, z)
    score = _scored(session, maps, filling, z, share=BLUR_SHARES[0])
    survivors = min(max(budget // _POINTS_A_SURVIVOR, _FEWEST_SURVIVORS), _MOST_SURVIVORS)
    z, score = _best(z, score, survivors)
    score = score * distinct_share(filling, z)
    z, score = _climbed(session, maps, filling, z, score)
    z, score = _best(z, score, 4 * keep)
    with session.until_interrupted():
        z = _descended(maps, filling, z)
    return session.completed(lambda: _found(maps, filling, z))[:keep]


def _found(maps: PointMaps, filling: Filling, z: Tensor) -> list[Guess]:
    """The numbers z [K, F], each with its best setting, that draw at different places, the best first."""
    table = score_points(maps, filling, z, share=BLUR_SHARES[-1]) * distinct_share(filling, z)[:, None]
    score, setting = table.max(1)
    rows = zip(z, setting.tolist(), score.tolist(), strict=True)
    found = [Guess(filling, numbers, value, setting=which) for numbers, which, value in rows]
    return distinct(maps, sorted(found, key=lambda one: -one.promise))


def _scored(session: Session, maps: PointMaps, filling: Filling, z: Tensor, *, share: float) -> Tensor:
    """The score of each filling's best setting, [B]; 0 for those that time did not reach."""
    found = torch.zeros(len(z))
    size = max(16, _MOST_POINTS // (9 * len(filling.pattern.index)))
    with session.until_interrupted():
        for first in range(0, len(z), size):
            if not session.go_on():
                break
            part = z[first : first + size]
            found[first : first + size] = score_points(maps, filling, part, share=share, soft=True).amax(1)
    return found


def _best(z: Tensor, score: Tensor, count: int) -> tuple[Tensor, Tensor]:
    order = torch.argsort(score, descending=True, stable=True)[:count]
    return z[order], score[order]


def _climbed(
    session: Session, maps: PointMaps, filling: Filling, z: Tensor, score: Tensor
) -> tuple[Tensor, Tensor]:
    """Survivors [K, F] moved by seeded steps to better places; the worse half falls away now and then."""
    width = filling.width
    share = BLUR_SHARES[0]
    with session.until_interrupted():
        for turn in range(_ROUNDS):
            if not session.go_on():
                break
            done = turn / (_ROUNDS - 1)
            reach = _FIRST_REACH * (_LAST_REACH / _FIRST_REACH) ** done
            level = BLUR_SHARES[min(len(BLUR_SHARES) - 1, int(done * len(BLUR_SHARES)))]
            if level != share:
                share = level
                again = _scored(session, maps, filling, z, share=share) * distinct_share(filling, z)
                if not session.go_on():
                    break  # not all were scored again: those of before are as good
                z, score = _best(z, again, max(24, len(z) // 2))
            shape = (len(z), _TRIES, len(width))
            steps = torch.randn(shape, generator=session.generator, dtype=torch.float64)
            # A step along few numbers goes further than one along all.
            chosen = torch.rand(shape, generator=session.generator) < 0.5
            tries = kept_within(filling, z[:, None] + reach * width * steps * chosen)
            flat = tries.flatten(0, 1)
            value = _scored(session, maps, filling, flat, share=share)
            value = (value * distinct_share(filling, flat)).reshape(len(z), _TRIES)
            top, place = value.max(1)
            better = top > score
            moved = torch.where(better[:, None], tries[torch.arange(len(z)), place], z)
            z, score = moved, torch.where(better, top, score)
            if turn % 3 == 2:
                z, score = _best(z, score, max(24, len(z) // 2))
    return z, score


def _descended(maps: PointMaps, filling: Filling, z: Tensor) -> Tensor:
    """z [K, F] after gradient descent (Adam) on the score, from blurred to sharp, within the limits."""
    width = filling.width
    first, second = torch.zeros_like(z), torch.zeros_like(z)
    for step in range(1, _DESCENTS + 1):
        share = BLUR_SHARES[1] if step <= _DESCENTS // 2 else BLUR_SHARES[2]
        unit = (z / width).requires_grad_()
        worth = score_points(maps, filling, unit * width, share=share, soft=True).amax(1).sum()
        (slope,) = torch.autograd.grad(worth, unit)
        # Adam written out: torch.optim would load for seconds.
        first = 0.9 * first + 0.1 * slope
        second = 0.999 * second + 0.001 * slope.square()
        move = (first / (1 - 0.9**step)) / ((second / (1 - 0.999**step)).sqrt() + 1e-8)
        z = kept_within(filling, (unit.detach() + _DESCENT_RATE * move) * width)
    return z


def distinct(maps: PointMaps, found: Sequence[Guess]) -> list[Guess]:
    """Those that draw at other places than all before them."""
    kept: list[tuple[Guess, Tensor]] = []
    for one in found:
        theta = one.filling.theta(one.z)
        drawn = one.filling.pattern.centers(theta)[one.filling.masks[one.setting]]
        places, _ = project(maps.map_from_plane(one.filling, theta), drawn)
        if not any(_alike(places, other) for _, other in kept):
            kept.append((one, places))
    return [one for one, _ in kept]


def _alike(places: Tensor, others: Tensor) -> bool:
    """Whether two sets of points [N, 2] and [M, 2] on the map are the same, up to a share of their step."""
    if len(places) != len(others) or len(places) < 2:
        return False
    apart = torch.cdist(places, places) + torch.eye(len(places)).double() * 1e9
    step = float(apart.amin(1).median())
    distance = torch.cdist(places, others)
    return float(torch.maximum(distance.amin(0), distance.amin(1)).median()) < _SAME * step

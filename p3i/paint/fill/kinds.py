"""Cells of several kinds in turn, as a chessboard's, a dartboard's, rows of two sorts: which are of one kind.

Kinds alternate with a period: a sublattice of the program's own steps, on which all cells are of one kind. A
period is believed where the other cells of its kind tell a cell better than all other cells do, for more
cells than chance would have it (the number of false alarms of Desolneux, Moisan and Morel, IJCV 2000).

Convention: M cells with indices [M, 2], each with colours [P, 3] of which `shown` [P] are known.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from p3i.place.placed import Placed

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]
Period = tuple[int, int, int]

# Kinds in turn that are tried, and the finds that photos of one kind of cell would show.
_MOST_KINDS = 6
_FALSE_ALARMS = 0.05
# So many cells tell whether a period is repeated.
_MOST_ASKED = 400
# A loop closes where so many steps come back to within this share of a step.
_MOST_STEPS, _CLOSED = 720, 0.25


def kinds_of(
    index: Numbers, lit: Floats, shown: Mask, asked: Numbers, *, turns: Sequence[tuple[int, int]] = ()
) -> Numbers:
    """The kind of each cell, numbers from 0 on, [M]: all 0 where there is but one.

    `lit` [M, P, 3] are the cells in one light; those `asked` [K] tell. `turns` are steps (i, j) that lead
    back to where they start.
    """
    best = np.zeros(len(index), np.int64)
    if len(asked) < 2:
        return best
    wrong = _left_out(lit[asked], shown[asked], best[asked])
    tried = _partitions(index, asked, turns)
    for count in range(2, _MOST_KINDS + 1):
        judged = [
            (_left_out(lit[asked], shown[asked], kinds[asked]), kinds)
            for many, kinds in tried
            if many == count
        ]
        if not judged:
            continue
        off, kinds = min(judged, key=lambda one: float(one[0].sum()))
        better, worse = int((off < wrong).sum()), int((off > wrong).sum())
        if off.sum() < wrong.sum() and len(tried) * _by_chance(better, better + worse) < _FALSE_ALARMS:
            best, wrong = kinds, off
    return best


def _partitions(
    index: Numbers, asked: Numbers, turns: Sequence[tuple[int, int]]
) -> list[tuple[int, Numbers]]:
    """The ways to split cells by a period, each once: how many kinds it makes, and the kinds [M]."""
    found: dict[bytes, tuple[int, Numbers]] = {}
    for count in range(2, _MOST_KINDS + 1):
        for period in _periods(count):
            kinds = _kinds(index, period)
            _, first, numbers = np.unique(kinds[asked], return_index=True, return_inverse=True)
            closed = all(_kinds(np.array([turn]), period)[0] == 0 for turn in turns)
            if closed and len(first) == count and _repeated(index[asked], kinds[asked], period):
                # Told apart by the order in which kinds come, since their numbers may be any.
                found.setdefault(np.argsort(np.argsort(first))[numbers.reshape(-1)].tobytes(), (count, kinds))
    return list(found.values())


def turns_of(placed: Placed) -> list[tuple[int, int]]:
    """The fewest steps of each loop variable that lead once round a ring: (0, 20), where one does."""
    start = placed.index[:1].astype(float)
    found: list[tuple[int, int]] = []
    for step in ((1, 0), (0, 1)):
        places = placed.at(start + np.arange(_MOST_STEPS + 1)[:, None] * np.array(step))
        away = np.hypot(*(places - places[0]).T)
        back = np.flatnonzero(away[2:] < _CLOSED * away[1])
        if len(back):
            found.append((step[0] * (int(back[0]) + 2), step[1] * (int(back[0]) + 2)))
    return found


def _periods(count: int) -> Iterator[Period]:
    """The sublattices that make `count` kinds of the indices, in Hermite's form: rows (a, b) and (0, c)."""
    for a in range(1, count + 1):
        if count % a == 0:
            for b in range(count // a):
                yield a, b, count // a


def _kinds(index: Numbers, period: Period) -> Numbers:
    a, b, c = period
    rows = index[:, 0] // a
    return (index[:, 0] - rows * a) * c + (index[:, 1] - rows * b) % c


def _repeated(index: Numbers, kinds: Numbers, period: Period) -> bool:
    """Whether each kind comes again one period away along each step: else rows are told, not a period."""
    there = set(map(tuple, index.tolist()))
    a, b, c = period
    varied = (np.ptp(index, axis=0) > 0).tolist()
    every = range(0, len(index), max(1, len(index) // _MOST_ASKED))
    for steps in [[(a, b), (a, b - c)]] * varied[0] + [[(0, c)]] * varied[1]:
        again = {
            int(kinds[place])
            for place in every
            if any((index[place, 0] + i, index[place, 1] + j) in there for i, j in steps)
        }
        if len(again) < a * c:
            return False
    return True


def _left_out(lit: Floats, shown: Mask, kinds: Numbers) -> NDArray[np.float64]:
    """What each cell [M] differs by from the mean of the others of its kind; where none shows it, of all."""
    values = lit * shown[..., None]
    total, count = values.sum(0), shown.sum(0)
    off = np.zeros(len(lit))
    for kind in np.unique(kinds):
        own = np.flatnonzero(kinds == kind)
        others, seen = values[own].sum(0) - values[own], shown[own].sum(0) - shown[own].astype(int)
        rest, left = total - values[own], count - shown[own].astype(int)
        mean = (
            np.where((seen > 0)[..., None], others, rest)
            / np.maximum(np.where(seen > 0, seen, left), 1)[..., None]
        )
        apart = np.abs(mean - lit[own]).mean(2) * shown[own]
        off[own] = apart.sum(1) / np.maximum(shown[own].sum(1), 1)
    return off


def _by_chance(better: int, tried: int) -> float:
    """How likely it is that so many of those tried or more are better where each is or is not by chance."""
    steps = np.arange(better, tried + 1)
    logs = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, tried + 1)))])
    return float(np.exp(logs[tried] - logs[steps] - logs[tried - steps] - tried * np.log(2)).sum())

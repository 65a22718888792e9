"""The outline of a lattice: index ranges and guards that say shortly which cells hold an object.

Convention: `evidence` [R, C] holds, for cell (i, j) = (i_start + column, j_start + row), the log-odds that
it holds an object: positive where it does, 0 where nothing is known (a hole, beyond the photo). An
outline is a product of half-open ranges of i and j, cut by guards `a*i + b*j >= c` with small whole a, b.
The best outline has the greatest sum of evidence inside, less what its numbers cost to say: the two-part
description length, in nats.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIRECTIONS = tuple(
    (a, b)
    for a in range(-3, 4)
    for b in range(-3, 4)
    if (a or b) and np.gcd(a, b) == 1 and abs(a) + abs(b) <= 4 and a and b
)
"""Normals of guards; those along i or j alone are what the ranges are for."""

GUARD_COST = 4.0
"""Nats to say that there is one more guard, and its threshold."""

_SLOPE_COST = 1.0  # nats for each unit of |a| + |b| beyond 2
_MOST_GUARDS = 3
_ROUNDS = 6
_MOST_CELLS = 200_000  # of a table that other steps shear
_IDLE = 1e-3  # what a cell without evidence costs, so that outlines do not reach out for nothing


@dataclass(frozen=True, slots=True)
class Outline:
    """Half-open ranges of i and j, guards (a, b, c) for `a*i + b*j >= c`, and the gain in nats."""

    i_range: tuple[int, int]
    j_range: tuple[int, int]
    guards: tuple[tuple[int, int, int], ...]
    gain: float

    def holds(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of the cells i [N], j [N] lie inside, [N]; the two broadcast."""
        inside = (
            (i >= self.i_range[0]) & (i < self.i_range[1]) & (j >= self.j_range[0]) & (j < self.j_range[1])
        )
        for a, b, c in self.guards:
            inside &= a * i + b * j >= c
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What is known of a lattice's cells: log-odds [J, I] in nats, of (i, j) from `first` on."""

    odds: Array
    first: tuple[int, int]

    def changed(self, change: NDArray[np.int64]) -> "Cells | None":
        """The same cells under the steps `change` [2, 2], whole rows in terms of the present ones.

        None where the table would be too large.
        """
        j, i = np.nonzero(self.odds)
        index = (np.stack([i, j], 1) + self.first) @ np.round(np.linalg.inv(change)).astype(int)
        if len(index) == 0:
            return self
        low, high = index.min(0), index.max(0) + 1
        if (high - low).prod() > _MOST_CELLS:
            return None
        odds = np.zeros((high - low)[::-1])
        odds[tuple((index - low).T[::-1])] = self.odds[j, i]
        return Cells(odds, (int(low[0]), int(low[1])))

    def outline(self) -> Outline | None:
        """What of the cells is drawn; None where nothing speaks for any."""
        return best_outline(self.odds, i_start=self.first[0], j_start=self.first[1])

    def unseen(self, outline: Outline) -> int:
        """How many cells an outline holds of which nothing is known."""
        box = [np.arange(*ends) for ends in (outline.i_range, outline.j_range)]
        held = outline.holds(*np.meshgrid(*box))
        j, i = np.nonzero(self.odds)
        return int(held.sum()) - int(outline.holds(i + self.first[0], j + self.first[1]).sum())

    @property
    def most(self) -> float:
        """The log-odds that the best outline could hold at most."""
        return float(np.maximum(self.odds, 0).sum())


def best_outline(evidence: Array, *, i_start: int = 0, j_start: int = 0) -> Outline | None:
    """The outline of the greatest gain over `evidence` [I, J]; None where no cell has evidence for it."""
    if not (evidence > 0).any():
        return None
    worth = evidence - _IDLE
    rows, columns = worth.shape
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    found: list[Outline] = []
    for first in (_best_rectangle(worth), _bounds(evidence > 0)):
        outline = _improved(worth, i, j, first, ())
        found.append(outline)
        while len(outline.guards) < _MOST_GUARDS:
            step = _with_one_more(worth, i, j, outline)
            if step is None:
                break
            outline = step
            found.append(outline)
    found += [_improved(worth, i, j, _bounds(evidence > 0), guards) for guards in _diamonds(worth, i, j)]
    best = max(found, key=lambda outline: outline.gain)
    best = _without_idle_guards(worth, i, j, best)
    inside = _inside(i, j, (*best.i_range, *best.j_range), best.guards)
    i0, i1, j0, j1 = _bounds(inside) if inside.any() else (*best.i_range, *best.j_range)
    return Outline(
        (i0 + i_start, i1 + i_start),
        (j0 + j_start, j1 + j_start),
        tuple(sorted((a, b, c + a * i_start + b * j_start) for a, b, c in best.guards)),
        best.gain,
    )


def rectangle_gain(evidence: Array) -> float:
    """The greatest sum of `evidence` [I, J] over a rectangle of cells, 0 for none."""
    i0, i1, j0, j1 = _best_rectangle(evidence)
    return max(0.0, float(evidence[j0:j1, i0:i1].sum()))


def _best_rectangle(worth: Array) -> tuple[int, int, int, int]:
    """(i0, i1, j0, j1) of the rectangle of the greatest sum (Kadane's rule over pairs of rows)."""
    rows = worth.shape[0]
    sums = np.vstack([np.zeros(worth.shape[1]), np.cumsum(worth, axis=0)])
    best, at = -np.inf, (0, 1, 0, 1)
    for j0 in range(rows):
        bands = sums[j0 + 1 :] - sums[j0]
        total = np.cumsum(bands, axis=1)
        before = np.concatenate([np.zeros((len(bands), 1)), total[:, :-1]], axis=1)
        lowest = np.minimum.accumulate(before, axis=1)
        gain = total - lowest
        k = int(gain.argmax())
        band, stop = divmod(k, gain.shape[1])
        if gain[band, stop] > best:
            best = float(gain[band, stop])
            start = int(before[band, : stop + 1].argmin())
            at = (start, stop + 1, j0, j0 + band + 1)
    return at


def _bounds(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """The box of what is set."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return int(columns[0]), int(columns[-1]) + 1, int(rows[0]), int(rows[-1]) + 1


def _cost(guards: tuple[tuple[int, int, int], ...]) -> float:
    return sum(GUARD_COST + _SLOPE_COST * (abs(a) + abs(b) - 2) for a, b, _ in guards)


def _inside(i: Array, j: Array, box: tuple[int, int, int, int] | None, guards: tuple) -> NDArray[np.bool_]:
    keep = np.ones(i.shape, bool)
    if box is not None:
        keep = (i >= box[0]) & (i < box[1]) & (j >= box[2]) & (j < box[3])
    for a, b, c in guards:
        keep &= a * i + b * j >= c
    return keep


def _best_threshold(worth: Array, at: Array) -> int:
    """The whole c for which the sum of worth over `at >= c` is greatest."""
    low = int(at.min())
    per = np.bincount((at - low).ravel(), weights=worth.ravel())
    tail = np.cumsum(per[::-1])[::-1]
    return low + int(tail.argmax())


def _improved(
    worth: Array, i: Array, j: Array, box: tuple[int, int, int, int], guards: tuple[tuple[int, int, int], ...]
) -> Outline:
    """Ranges and thresholds moved in turn, each to its best place given the others, until none moves."""
    for _ in range(_ROUNDS):
        before = (box, guards)
        kept = np.where(_inside(i, j, None, guards), worth, 0.0)
        for axis in (0, 1):
            line = kept[box[2] : box[3]].sum(axis=0) if axis == 0 else kept[:, box[0] : box[1]].sum(axis=1)
            start, stop = _best_run(line)
            box = (start, stop, box[2], box[3]) if axis == 0 else (box[0], box[1], start, stop)
        for k, (a, b, _) in enumerate(guards):
            others = guards[:k] + guards[k + 1 :]
            kept = np.where(_inside(i, j, box, others), worth, 0.0)
            guards = (*guards[:k], (a, b, _best_threshold(kept, a * i + b * j)), *guards[k + 1 :])
        if (box, guards) == before:
            break
    gain = float(worth[_inside(i, j, box, guards)].sum()) - _cost(guards)
    return Outline((box[0], box[1]), (box[2], box[3]), guards, gain)


def _best_run(line: Array) -> tuple[int, int]:
    """The half-open stretch of the greatest sum."""
    total = np.cumsum(line)
    before = np.concatenate([[0.0], total[:-1]])
    lowest = np.minimum.accumulate(before)
    stop = int((total - lowest).argmax())
    return int(before[: stop + 1].argmin()), stop + 1


def _with_one_more(worth: Array, i: Array, j: Array, outline: Outline) -> Outline | None:
    """The outline with the guard that gains most; None where none pays for itself.

    Besides the outline's own box, the box of all cells with evidence is tried: a guard may make room for
    the ranges to grow.
    """
    best: Outline | None = None
    own = (*outline.i_range, *outline.j_range)
    grown = _bounds(worth > 0)
    for box in {own, grown}:
        kept = np.where(_inside(i, j, box, outline.guards), worth, 0.0)
        for a, b in DIRECTIONS:
            guard = (a, b, _best_threshold(kept, a * i + b * j))
            gain = float(kept[a * i + b * j >= guard[2]].sum()) - _cost((*outline.guards, guard))
            if best is not None and gain < best.gain - 20:
                continue
            tried = _improved(worth, i, j, box, (*outline.guards, guard))
            if best is None or tried.gain > best.gain:
                best = tried
    return best if best is not None and best.gain > outline.gain else None


def _diamonds(worth: Array, i: Array, j: Array) -> list[tuple[tuple[int, int, int], ...]]:
    """Triples of diagonal guards, each at its own best place: no guard alone gains much on a diamond."""
    sides = [(a, b, _best_threshold(worth, a * i + b * j)) for a in (-1, 1) for b in (-1, 1)]
    return [tuple(side for side in sides if side is not left_out) for left_out in sides]


def _without_idle_guards(worth: Array, i: Array, j: Array, outline: Outline) -> Outline:
    """The outline less guards that no longer earn their cost after the others have moved."""
    for guard in outline.guards:
        rest = tuple(g for g in outline.guards if g != guard)
        tried = _improved(worth, i, j, (*outline.i_range, *outline.j_range), rest)
        if tried.gain >= outline.gain:
            return _without_idle_guards(worth, i, j, tried)
    return outline

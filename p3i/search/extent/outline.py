"""The outline of a lattice: index ranges and guards that say shortly which cells hold an object.

Convention: `evidence` [R, C] holds, for cell (i, j) = (i_start + column, j_start + row), the bits that speak
for an object: positive where there is one, 0 where nothing is known. An outline is a product of half-open
ranges of i and j, cut by guards `a*i + b*j >= c` with small whole a, b. The best outline has the greatest sum
of evidence inside, less what its numbers cost to say: the two-part description length.

Two things that ranges and guards cannot say are looked at in the end. A whole line of the outline that
holds nothing divides two patterns, such as two fronts of one step; the part with more bits is the answer.
And beyond each side may lie one more line whose cells are there by the halves towards the pattern, as the
crossings along the rim of a ruled board are.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from p3i.vision.cell_bits import TOWARDS, best_rectangle

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

DIRECTIONS = tuple(
    (a, b)
    for a in range(-3, 4)
    for b in range(-3, 4)
    if (a or b) and np.gcd(a, b) == 1 and abs(a) + abs(b) <= 4 and a and b
)
"""Normals of guards; those along i or j alone are what the ranges are for."""

GUARD_BITS = 6.0
"""To say that there is one more guard: which of the four diagonals, and its threshold."""

_SLOPE_BITS = 1.5  # for each unit of |a| + |b| beyond 2
_MOST_GUARDS = 3
_ROUNDS = 6
_MOST_CELLS = 200_000  # of a table that other steps shear
_MOST_IMPROVED = 5  # guards, the best as they stand, are tried with ranges and other guards moving along
_IDLE = 1e-3  # bits that a cell costs, so that outlines do not reach out for nothing


@dataclass(frozen=True, slots=True)
class Outline:
    """Half-open ranges of i and j, guards (a, b, c) for `a*i + b*j >= c`, and the gain in bits.

    `seen` is how many of its cells can be judged, and `there` how many of these hold an entire object.
    """

    i_range: tuple[int, int]
    j_range: tuple[int, int]
    guards: tuple[tuple[int, int, int], ...]
    gain: float
    there: int = 0
    seen: int = 0

    def holds(self, i: Indices, j: Indices) -> NDArray[np.bool_]:
        """Which of the cells i [N], j [N] lie inside, [N]; the two broadcast."""
        inside = (
            (i >= self.i_range[0]) & (i < self.i_range[1]) & (j >= self.j_range[0]) & (j < self.j_range[1])
        )
        for a, b, c in self.guards:
            inside &= a * i + b * j >= c
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What is known of a lattice's cells: `bits` [R, C] that speak for an object, of (i, j) from `first` on.

    `judged` [R, C]: which of the cells the photo shows well enough; `entire`: of which of them each half
    speaks for an object as well.
    """

    bits: Array
    judged: NDArray[np.bool_]
    entire: NDArray[np.bool_]
    first: tuple[int, int]

    def changed(self, change: NDArray[np.int64]) -> "Cells | None":
        """The same cells under the steps `change` [2, 2], whole rows in terms of the present ones.

        None where the table would be too large.
        """
        j, i = np.nonzero((self.bits != 0) | self.judged)
        index = (np.stack([i, j], 1) + self.first) @ np.round(np.linalg.inv(change)).astype(int)
        if len(index) == 0:
            return self
        low, high = index.min(0), index.max(0) + 1
        if (high - low).prod() > _MOST_CELLS:
            return None
        at = tuple((index - low).T[::-1])

        def moved(table: NDArray) -> NDArray:
            found = np.zeros((high - low)[::-1], table.dtype)
            found[at] = table[j, i]
            return found

        first = (int(low[0]), int(low[1]))
        return Cells(moved(self.bits), moved(self.judged), moved(self.entire), first)

    def outline(self) -> Outline | None:
        """What of the cells is drawn; None where nothing speaks for any."""
        found = best_outline(self.bits, i_start=self.first[0], j_start=self.first[1])
        if found is None:
            return None
        seen = self._held(found) & self.judged
        return replace(found, there=int(self.entire[seen].sum()), seen=int(seen.sum()))

    def unseen(self, outline: Outline) -> int:
        """How many cells an outline holds of which nothing is known."""
        box = [np.arange(*ends) for ends in (outline.i_range, outline.j_range)]
        known = (self.bits != 0) | self.judged
        return int(outline.holds(*np.meshgrid(*box)).sum()) - int((self._held(outline) & known).sum())

    def _held(self, outline: Outline) -> NDArray[np.bool_]:
        """Which of the cells [R, C] an outline holds."""
        rows, columns = self.bits.shape
        i, j = np.meshgrid(np.arange(columns) + self.first[0], np.arange(rows) + self.first[1])
        return outline.holds(i, j)

    @property
    def most(self) -> float:
        """The bits that the best outline could hold at most."""
        return float(np.maximum(self.bits, 0).sum())


def best_outline(
    evidence: Array, *, halves: Array | None = None, parts: bool = True, i_start: int = 0, j_start: int = 0
) -> Outline | None:
    """The outline of the greatest gain over `evidence` [R, C]; None where no cell has evidence for it.

    `halves` [4, R, C] is the evidence of half of each cell: the half towards greater i, smaller i, greater j
    and smaller j. `parts`: what lies beyond an empty line is another pattern.
    """
    if not (evidence > 0).any():
        return None
    worth = evidence - _IDLE
    rows, columns = worth.shape
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    found: list[Outline] = []
    for first in (best_rectangle(worth), _bounds(evidence > 0)):
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
    best = _without_empty_lines(worth, i, j, best) if parts else best
    inside = best.holds(i, j)
    if inside.any():
        i0, i1, j0, j1 = _bounds(inside)
        best = replace(best, i_range=(i0, i1), j_range=(j0, j1))
    if halves is not None:
        best = _with_rims(halves, i, j, best)
    i0, i1, j0, j1 = *best.i_range, *best.j_range
    return Outline(
        (i0 + i_start, i1 + i_start),
        (j0 + j_start, j1 + j_start),
        tuple(sorted((a, b, c + a * i_start + b * j_start) for a, b, c in best.guards)),
        best.gain,
    )


def _bounds(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """The box of what is set."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return int(columns[0]), int(columns[-1]) + 1, int(rows[0]), int(rows[-1]) + 1


def _cost(guards: tuple[tuple[int, int, int], ...]) -> float:
    return sum(GUARD_BITS + _SLOPE_BITS * (abs(a) + abs(b) - 2) for a, b, _ in guards)


def _inside(
    i: Indices, j: Indices, box: tuple[int, int, int, int] | None, guards: tuple
) -> NDArray[np.bool_]:
    keep = np.ones(i.shape, bool)
    if box is not None:
        keep = (i >= box[0]) & (i < box[1]) & (j >= box[2]) & (j < box[3])
    for a, b, c in guards:
        keep &= a * i + b * j >= c
    return keep


def _best_threshold(worth: Array, at: Indices) -> int:
    """The whole c for which the sum of worth over `at >= c` is greatest."""
    low = int(at.min())
    per = np.bincount((at - low).ravel(), weights=worth.ravel())
    tail = np.cumsum(per[::-1])[::-1]
    return low + int(tail.argmax())


def _improved(
    worth: Array,
    i: Indices,
    j: Indices,
    box: tuple[int, int, int, int],
    guards: tuple[tuple[int, int, int], ...],
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


def _with_one_more(worth: Array, i: Indices, j: Indices, outline: Outline) -> Outline | None:
    """The outline with the guard that gains most; None where none pays for itself.

    Besides the outline's own box, the box of all cells with evidence is tried: a guard may make room for
    the ranges to grow.
    """
    own = (*outline.i_range, *outline.j_range)
    tried: list[tuple[float, tuple[int, int, int, int], tuple[int, int, int]]] = []
    for box in (own, _bounds(worth > 0)):
        kept = np.where(_inside(i, j, box, outline.guards), worth, 0.0)
        for a, b in DIRECTIONS:
            guard = (a, b, _best_threshold(kept, a * i + b * j))
            gain = float(kept[a * i + b * j >= guard[2]].sum()) - _cost((*outline.guards, guard))
            tried.append((gain, box, guard))
    best: Outline | None = None
    for _, box, guard in sorted(tried, reverse=True)[:_MOST_IMPROVED]:
        moved = _improved(worth, i, j, box, (*outline.guards, guard))
        if best is None or moved.gain > best.gain:
            best = moved
    return best if best is not None and best.gain > outline.gain else None


def _diamonds(worth: Array, i: Indices, j: Indices) -> list[tuple[tuple[int, int, int], ...]]:
    """Triples of diagonal guards, each at its own best place: no guard alone gains much on a diamond."""
    sides = [(a, b, _best_threshold(worth, a * i + b * j)) for a in (-1, 1) for b in (-1, 1)]
    return [tuple(side for side in sides if side is not left_out) for left_out in sides]


def _without_idle_guards(worth: Array, i: Indices, j: Indices, outline: Outline) -> Outline:
    """The outline less guards that no longer earn their cost after the others have moved."""
    for guard in outline.guards:
        rest = tuple(g for g in outline.guards if g != guard)
        tried = _improved(worth, i, j, (*outline.i_range, *outline.j_range), rest)
        if tried.gain >= outline.gain:
            return _without_idle_guards(worth, i, j, tried)
    return outline


def _without_empty_lines(worth: Array, i: Indices, j: Indices, outline: Outline) -> Outline:
    """The part of most bits between rows and columns that speak against objects by more than a guard."""
    kept = np.where(outline.holds(i, j), worth, 0.0)
    best: tuple[float, Outline] | None = None
    for name, line, (start, stop) in (
        ("i_range", kept.sum(axis=0), outline.i_range),
        ("j_range", kept.sum(axis=1), outline.j_range),
    ):
        empty = np.flatnonzero(line[start:stop] < -GUARD_BITS) + start
        if len(empty) == 0:
            continue
        for first, last in zip((start, *(empty + 1)), (*empty, stop), strict=True):
            bits = float(line[first:last].sum())
            if first < last and (best is None or bits > best[0]):
                best = bits, replace(outline, **{name: (int(first), int(last))})
    if best is None:
        return outline
    part = replace(best[1], gain=best[0] - _cost(outline.guards))
    return _without_empty_lines(worth, i, j, part)


def _with_rims(halves: Array, i: Indices, j: Indices, outline: Outline) -> Outline:
    """The outline with one more line on each side where the halves towards it speak for objects."""
    (i0, i1), (j0, j1) = outline.i_range, outline.j_range
    lines = [i == i0 - 1, i == i1, j == j0 - 1, j == j1]
    guarded = _inside(i, j, None, outline.guards)
    gains = []
    for half, line, (right, down) in zip(halves, lines, TOWARDS, strict=True):
        beside = line & guarded & outline.holds(i + right, j + down)
        gains.append(float(half[beside].sum()))
    more = [gain > 0 for gain in gains]
    return Outline(
        (i0 - more[0], i1 + more[1]),
        (j0 - more[2], j1 + more[3]),
        outline.guards,
        outline.gain + sum(gain for gain in gains if gain > 0),
    )

"""Which steps the program of a lattice takes: those that a person would choose, told by bits.

A lattice has many bases, and every one draws the same points. The shortest is the diagonal of bricks and of
the fields of a chessboard; a person takes the rows. What speaks for a basis, in bits:

- the objects that its ranges and guards hold, by the evidence of the cells, less what these cost to say;
- the lines of the pattern, if rows run along them: then their direction need not be told;
- a term that is nothing: one number less;
- right angles: steps that are no longer than they need be.

Convention: `change` [2, 2] whole, its rows the new steps in terms of the old, so that (i, j) becomes
(i, j) @ inverse(change); a basis [2, 2] has the steps as rows, in program units.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.outline import GUARD_BITS, Cells
from p3i.search.forms.lattice import Lattice, reduce_basis
from p3i.search.forms.layout import Layout
from p3i.search.forms.length import NUMBER_BITS
from p3i.vision.cell_bits import best_rectangle

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

# Rows that are looked at, in steps of the shortest basis: bricks four times as wide as high need (1, 2).
_ROWS = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (1, -2), (2, 1), (2, -1))
# A cell's lines count as so many independent samples (as a patch does in judge/bits.py). They run along a
# direction within so many degrees of it, which by chance is that share of them along two.
_SAMPLES = 50
_ALONG_DEG = 8
_BY_CHANCE = 2 * (2 * _ALONG_DEG + 1) / 180
# A step that leads to within this of halfway along the next row may be taken either way; a guessed focal
# skews right angles by so many degrees.
_HALF = 0.035
_SKEWED_DEG = 15
# A term of a step that moves no object by so many pixels is none.
_NOTHING_PX = 0.3
# An outline that gains so much less than another draws other objects, whatever lines say: two guards.
_WORSE = 2 * GUARD_BITS
# Within so many bits others are no better, and within so many they are as good.
_BETTER_BITS = 3.0
_TIE_BITS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """A layout, its outline's gain in bits, all that speaks for it in bits, and its objects out of sight."""

    layout: Layout
    gain: float
    bits: float
    unseen: int

    @property
    def lean_deg(self) -> float:
        """How far the straighter of its steps is from standing upright, or lying level."""
        steps = self.layout.lattice.basis
        return min(abs(math.remainder(_angle_deg(step), 90.0)) for step in steps)


def in_rows(cells: Cells, lattice: Lattice, *, edges: Array, unit_px: float) -> tuple[Layout, str] | None:
    """The lattice's objects in the steps that most bits speak for, and what to say of others as natural.

    `edges` [180] as `look/edges.py` tells them of the plane, `unit_px` a program unit in pixels. The
    shortest steps are taken where no others are better. None where no cell is seen to hold an object.
    """
    shortest = reduce_basis(lattice.basis)
    in_shortest = cells.changed(np.round(shortest @ np.linalg.inv(lattice.basis)).astype(int))
    if in_shortest is not None:
        cells, lattice = in_shortest, lattice.with_basis(shortest)
    found: list[_Told] = []
    most = -math.inf
    for change in bases_with_rows(lattice.basis):
        turned = cells.changed(change)
        # Where ranges alone do worse, it takes a guard.
        if turned is None or max(_in_a_box(turned.bits), turned.most - GUARD_BITS) < most - _WORSE:
            continue
        outline = turned.outline()
        if outline is None:
            return None
        written = lattice.with_basis(change @ lattice.basis)
        layout = Layout(written, outline.i_range, outline.j_range, outline.guards)
        bits = outline.gain + _for_steps(written.basis, edges)
        bits += NUMBER_BITS * _terms_that_are_nothing(layout, unit_px)
        found.append(_Told(layout, outline.gain, bits, turned.unseen(outline)))
        most = max(most, outline.gain)
    found = [one for one in found if one.gain >= most - _WORSE]
    best = max(one.bits for one in found)
    own = found[0].bits if np.array_equal(found[0].layout.lattice.basis, lattice.basis) else -math.inf
    if own >= best - _BETTER_BITS:
        least = own - _TIE_BITS
        chosen = min((one for one in found if one.bits >= least), key=lambda one: round(one.lean_deg))
    else:
        least = best - _BETTER_BITS
        chosen = min((one for one in found if one.bits >= least), key=lambda one: (one.unseen, one.lean_deg))
    others = [one.layout.lattice.basis for one in found if abs(one.bits - chosen.bits) < _TIE_BITS]
    return chosen.layout, _note(
        [basis for basis in others if not _same_rows(basis, chosen.layout.lattice.basis)]
    )


def _in_a_box(bits: Array) -> float:
    """The most bits that a rectangle of cells [R, C] holds, 0 for none."""
    i0, i1, j0, j1 = best_rectangle(bits)
    return max(0.0, float(bits[j0:j1, i0:i1].sum()))


def bases_with_rows(basis: Array) -> list[Whole]:
    """The changes [2, 2] of a basis that are looked at: none, then each row with the shortest next step."""
    found = [np.eye(2, dtype=int)]
    for row in _ROWS:
        along = np.array(row) @ basis
        across = np.array((0, 1) if abs(row[0]) == 1 else (1, 0))
        back = float(across @ basis @ along) / float(along @ along)
        for times in {math.floor(back), math.ceil(back)}:
            if abs(back - times) > 0.5 + _HALF:
                continue
            change = _in_order(np.array([row, across - times * np.array(row)]), basis)
            if not any(_same_steps(change, other) for other in found):
                found.append(change)
    return found


def _in_order(change: Whole, basis: Array) -> Whole:
    """The steps ordered and turned as `forms/lattice.reduce_basis` does: u to the right, v down from it."""
    u, v = change @ basis
    if abs(u[0]) * np.linalg.norm(v) < abs(v[0]) * np.linalg.norm(u):
        change, (u, v) = change[::-1], (v, u)
    signs = np.array([1 if u[0] >= 0 else -1, 1])
    signs[1] = 1 if signs[0] * (u[0] * v[1] - u[1] * v[0]) > 0 else -1
    return change * signs[:, None]


def _same_steps(change: Whole, other: Whole) -> bool:
    """Whether two changes name the same two steps, in any order and direction."""
    return {frozenset((tuple(step), tuple(-step))) for step in change} == {
        frozenset((tuple(step), tuple(-step))) for step in other
    }


def _for_steps(basis: Array, edges: Array) -> float:
    """What speaks for the steps of a basis whatever objects are drawn, in bits."""
    lengths = np.linalg.norm(basis, axis=1)
    skew = abs(float(basis[0] @ basis[1]))
    bits = -2 * math.log2(lengths.prod() / abs(float(np.linalg.det(basis))))
    rows = [
        _along_lines(basis[k], basis[1 - k], edges) for k in (0, 1) if skew <= (0.5 + _HALF) * lengths[k] ** 2
    ]
    return bits + max(rows, default=0.0)


def _along_lines(row: Array, step: Array, edges: Array) -> float:
    """What is saved of a cell's lines where they run along a row, or across it, in bits.

    That is two numbers at the most: their direction, and that they go on in the next cell. Across is where
    the rows after the next lie, if that is about a right angle on a plane of a guessed focal.
    """
    turn = _angle_deg(row)
    off = [(_angle_deg(step + times * row / 2) - turn) % 180 for times in (-2, -1, 0, 1, 2)]
    nearest = min(off, key=lambda angle: abs(angle - 90))
    across = nearest if abs(nearest - 90) < _SKEWED_DEG else 90
    along_row, along_step = (_share(edges, turn + angle) for angle in (0, across))
    both = along_row + along_step
    if both <= _BY_CHANCE:
        return 0.0
    frame = _SAMPLES * _lead(both, _BY_CHANCE)
    lead = along_row / both
    # Where most lines run along the row, they run on from object to object.
    through = _SAMPLES * both * _lead(lead, 0.5) if min(both, lead) > 0.5 else 0.0
    return min(frame, NUMBER_BITS) + min(through, NUMBER_BITS)


def _lead(share: float, chance: float) -> float:
    """The bits that a sample saves of which this share is one of two kinds, where by chance that share is."""
    parts = ((share, chance), (1 - share, 1 - chance))
    return sum(part * math.log2(part / by_chance) for part, by_chance in parts if part > 0)


def _share(edges: Array, angle_deg: float) -> float:
    """The share of the edges within a few degrees of a direction."""
    near = (math.floor(angle_deg) + np.arange(-_ALONG_DEG, _ALONG_DEG + 1)) % 180
    return float(edges[near].sum())


def _terms_that_are_nothing(layout: Layout, unit_px: float) -> int:
    """How many numbers of the steps move no object that is drawn."""
    counts = np.array([stop - start for start, stop in (layout.i_range, layout.j_range)])
    return int((np.abs(layout.lattice.basis) * (counts[:, None] - 1) / 2 * unit_px < _NOTHING_PX).sum())


def _angle_deg(step: Array) -> float:
    return math.degrees(math.atan2(step[1], step[0]))


def _same_rows(basis: Array, other: Array) -> bool:
    """Whether the longer steps of two bases lie on one line: then only where rows begin is told otherwise."""
    rows = [max(one, key=lambda step: float(step @ step)) for one in (basis, other)]
    return abs(math.remainder(_angle_deg(rows[0]) - _angle_deg(rows[1]), 180.0)) < 1.0


def _note(others: list[Array]) -> str:
    """What to say of bases that are as natural as the one that was taken; nothing where there are none."""
    if not others:
        return ""
    told = ", or ".join(" and ".join(f"({x:.2f}, {y:.2f})" for x, y in basis) for basis in others)
    return f"other rows tell this lattice as shortly: with steps of {told}"

"""The primitive cell: no part of the pattern's period.

A multiple of the period is divided where it is proposed (propose/shifts.py). But features that are blind to
black and white take a chessboard's square for its cell. So, with the camera as found, a lattice and its
sublattices of index 2 are told apart by whether the cosets look the same: a coarser one is taken where every
second cell looks different. Looks are compared both in the search's features and in colour. Where fields are
of several kinds without a rule, the kinds are never spread evenly: there the finer lattice is handed on
beside the coarser.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Fit
from p3i.search.fit.grow import side_of_cell
from p3i.search.forms.lattice import Lattice, reduce_basis
from p3i.search.look.cells import (
    Cells,
    agreement,
    agreement_with_others,
    mean_cell,
    read_cells,
    sample_grid,
)
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import MOST_READ
from p3i.search.look.thinned import thinned
from p3i.search.result import NEEDED_BITS

# Rows: u and v of each sublattice of index 2 in units of the lattice's.
_DOUBLES = ([[2, 0], [0, 1]], [[1, 0], [0, 2]], [[1, 1], [1, -1]])
# Cosets look different where cells agree with the others' mean less than this, relative to their own.
_DIFFERENT = 0.45
# Cells that agree with the mean of all others this well are of one kind, whatever their cosets.
_ALIKE = 0.3
# Cells that agree with their own kind by less than this say nothing.
_LEAST_AGREEMENT = 0.2
# Where so many of the cells know their coset, the cosets are kinds, and the doubled cell is the period:
# halfway between one half, which is no rule, and all.
_TOLD = 0.75
_TRIED = math.log2(2 * len(_DOUBLES))  # features and colours, and each way to double the cell


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """A lattice over the ground of a fit: its numbers and its cells there, index [N, 2]."""

    theta: Tensor
    index: Tensor


def primitive(evidence: Evidence, pattern: Pattern, fit: Fit) -> list[tuple[Tensor, Tensor]]:
    """The cells that the ground of `fit` may have, each as theta [P] and cells [N, 2]: one, or two.

    A chequered floor's alternate cells differ because that is its period, a crossword's or a letter board's
    because black and coloured fields fall on them unevenly. The one is told by each cell's knowing its coset;
    where they do not, the scores of the finished programs tell, the doubled cell coming first. With too few
    cells the fit's own is the only one.
    """
    found = _Ground(fit.theta, fit.index[fit.support])
    if len(found.index) < FEWEST_OBJECTS:
        return [(found.theta, found.index)]
    coarser, told = _coarser(evidence, pattern, found)
    both = [found] if coarser is None else [coarser] if told else [coarser, found]
    return [(one.theta, one.index) for one in both]


def _coarser(evidence: Evidence, pattern: Pattern, ground: _Ground) -> tuple[_Ground | None, bool]:
    """The lattice with a doubled cell that tells apart what the present one mixes, if any, and whether the
    cells know it surely: `_told`.
    """
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for rows in _DOUBLES:
        factors = np.array(rows)
        at = ground.index.numpy() @ np.linalg.inv(factors)
        coset = (np.abs(at - np.round(at)) > 1e-6).any(1).astype(int)
        likeness = _likeness(evidence, pattern, ground, coset)
        if likeness < _DIFFERENT and (best is None or likeness < best[0]):
            best = likeness, factors, coset
    if best is None:
        return None, False
    lattice = Lattice.of(pattern, ground.theta)
    basis, change = _reduced(best[1].astype(float) @ lattice.basis)
    index = ground.index.numpy() @ np.linalg.inv(best[1])
    whole = (np.abs(index - np.round(index)) < 1e-6).all(1)
    if whole.sum() < FEWEST_OBJECTS:
        return None, False
    index = torch.from_numpy(np.round(index[whole]) @ change)
    return _Ground(lattice.with_basis(basis).theta(pattern), index), _told(evidence, pattern, ground, best[2])


def _told(evidence: Evidence, pattern: Pattern, ground: _Ground, coset: np.ndarray) -> bool:
    """Whether the cells agree better with the others of their coset [N] than with the other coset.

    All of a chequered floor's do, dark with dark. Where fields of several kinds lie without a rule, most are
    of one kind and agree best with the coset that has more of it, whichever is theirs: then about half do.
    In the features that tell the cosets apart best; of so few cells that as many would by chance, for one of
    the features and doubled cells that were tried, it is not known.
    """
    for groups in _by_coset(evidence, pattern, ground, coset):
        means = [mean_cell(group, torch.ones(len(group.values)))[0] for group in groups]
        lead = [
            agreement_with_others(group, torch.ones(len(group.values)))
            - agreement(group.values, means[1 - place][None], group.known)
            for place, group in enumerate(groups)
        ]
        shares = [(float((one > 0).double().mean()), len(one)) for one in lead]
        if all(
            share >= _TOLD and count * _bits_a_toss(share) > _TRIED + NEEDED_BITS for share, count in shares
        ):
            return True
    return False


def _bits_a_toss(share: float) -> float:
    """What speaks against chance, in bits a toss, where this share of tosses of a coin fell on one side."""
    entropy = -sum(p * math.log2(p) for p in (share, 1 - share) if p > 0)
    return 1 - entropy


def _reduced(basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The reduced basis, and the whole matrix that takes row indices of the old basis to the new one's."""
    reduced = reduce_basis(basis)
    return reduced, np.round(basis @ np.linalg.inv(reduced))


def _likeness(evidence: Evidence, pattern: Pattern, ground: _Ground, coset: np.ndarray) -> float:
    """How well cells agree with the means of the other cosets, relative to their own: 1 where cosets are one.

    The lesser of features and colours; those that do not repeat within a coset have no say, and those in
    which all cells are alike have none either.
    """
    kinds = np.unique(coset)
    if len(kinds) < 2 or min(int((coset == kind).sum()) for kind in kinds) < 3:
        return 1.0
    least = 1.0
    for groups in _by_coset(evidence, pattern, ground, coset):
        ones = [torch.ones(len(group.values)) for group in groups]
        own = float(
            torch.cat([agreement_with_others(g, w) for g, w in zip(groups, ones, strict=True)]).median()
        )
        if own < _LEAST_AGREEMENT or _agreement_of_all(groups) > _ALIKE:
            continue
        means = [mean_cell(group, weights)[0] for group, weights in zip(groups, ones, strict=True)]
        across = [
            float(agreement(group.values, mean[None], group.known).median())
            for a, group in enumerate(groups)
            for b, mean in enumerate(means)
            if a != b
        ]
        least = min(least, min(across) / own)
    return least


def _by_coset(
    evidence: Evidence, pattern: Pattern, ground: _Ground, coset: np.ndarray
) -> Iterator[list[Cells]]:
    """The cells of each coset [N], as the search's features show them, then as colours do."""
    side = side_of_cell(evidence, pattern, ground.theta)
    for name in (None, "rgb"):
        level = evidence.level_for(side, name=name)
        yield [
            read_cells(level, pattern, ground.theta, cells[thinned(cells, MOST_READ)], sample_grid())
            for cells in (ground.index[coset == kind] for kind in np.unique(coset))
        ]


def _agreement_of_all(groups: list[Cells]) -> float:
    """The median agreement of a group's cells with the mean of all the others, the least of all groups.

    Of each group, since where one kind has more cells in sight the mean of all is like it.
    """
    together = Cells(torch.cat([one.values for one in groups]), torch.cat([one.known for one in groups]))
    agree = agreement_with_others(together, torch.ones(len(together.values)))
    return min(float(one.median()) for one in agree.split([len(group.values) for group in groups]))

"""Fewer objects for the same judgement: a sample of loop indices that favours no direction and no step.

Every n-th object in the order of the loops is a few columns of the pattern wherever n divides the length of a
row, and a pattern with two kinds of columns is then judged by one of them. Here objects are ranked by the
place of (i, j) in a Kronecker sequence: (i, j) stands at the fraction of i/p + j/p^2, p the plastic number,
and no small whole combination of the two comes near a fraction with a small denominator (the R2 sequence;
Roberts, The unreasonable effectiveness of quasirandom sequences, 2018). Equal stretches of the fractions are
the strata: each holds its share of every part of the pattern, of every row and column, and of every residue
of i, of j and of their combinations.
"""

import torch
from torch import Tensor

_PLASTIC = 1.324717957244746
_STEPS = (1 / _PLASTIC, 1 / _PLASTIC**2)
# Seeds begin at multiples of the golden ratio, which lie far apart.
_GOLDEN = 0.6180339887498949


def thinned(index: Tensor, most: int, *, seed: int = 0) -> Tensor:
    """Which of the objects `index` [N, 2] (loop indices i, j) to look at: positions [M] int64, ascending.

    All of them where N is at most `most`, else M = `most`. The same objects and seed give the same sample, in
    whatever order the loops visit them.
    """
    if len(index) <= most:
        return torch.arange(len(index))
    place = (index.double() @ torch.tensor(_STEPS, dtype=torch.float64) + seed * _GOLDEN) % 1.0
    return torch.argsort(place, stable=True)[:most].sort().values

"""How surely a photo comes again at a program's steps: evidence in bits, under a noise model of its own.

The null hypothesis is a picture in which no turn (of a ring) and no shift (of a row) is better than another.
Each object's sector is read off the plane: one step along the curve, as much across it. What is the same at
every turn, a rim, and what changes slowly, a shade, is taken out of it (a mean over one step has neither),
and the rest told in waves along the curve: wave m has m periods a step. The waves of different sectors are
independent under the null, whatever the picture's own texture, for these are its Fourier coefficients about
m/step; a pattern alone has the same waves in every sector. So of N sectors the mean one's share r of all
energy is what tells, and the generalised likelihood ratio of "the mean has an energy of its own" against
"no" is, for D independent samples,

    D * (-N ln N - ln r - (N - 1) ln(1 - r) + (N - 1) ln(N - 1)),    r > 1/N.

D is read off the photo itself: what the sectors do not share is noise, and unrelated vectors of D independent
samples have a mean squared cosine of 1/D. So neither overlapping patches, nor one edge seen in all rows of a
sector, nor enlarged pixels count for more than they are.
"""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Evidence
from p3i.search.look.sampling import on_own_grid
from p3i.search.look.sectors import Sectors, sectors_of, whole_cells
from p3i.search.look.thinned import thinned

UPRIGHT_BITS = 5.0
"""What it costs to say that objects on a curve do not turn with it: one kind of ring in thirty does so."""
MOST_READ = 200
"""More draws than this are judged by a part of them."""
MOST_HIDDEN = 0.2
"""A ring goes all round, and a pattern is one, where at most this share of its objects lacks."""
# Fewer sectors than this say nothing.
_FEWEST = 3
# What is fainter than this share of the plainest ring is none: that ring's objects reach there.
_FAINT = 0.1


def recurrence_bits(
    evidence: Evidence,
    pattern: Pattern,
    index: Tensor,
    *,
    focal_mm: float,
    cells: bool,
    theta: Tensor | None = None,
    needed: float = 0.0,
) -> float:
    """What the draws at `index` [N, 2] save by coming again at the program's steps, in bits, at least 0.

    `cells`: the draws are rows of rows, all of which are alike, and must come again along i and along j: the
    fewer bits count, and where they lie on the picture's own grid (sampling.py) their colours alone. Else
    each value of the loop variable that does not go along the curve has a ring, or row, of its own, and the
    bits of all add up. `theta` [P] are other numbers than the program's. That objects on a curve stand
    upright has to be told: it costs UPRIGHT_BITS.

    Of many draws a part is read, and the others are taken to save as much each. By chance a few bits would
    become many so; they count for all only where those that were read save more than `needed`.
    """
    theta = pattern.theta if theta is None else theta
    every, index = len(index), index[thinned(index, MOST_READ)]
    each = every / max(len(index), 1)
    edges = not (cells and lie_on_own_grid(evidence, pattern, index, theta, focal_mm))
    read = partial(sectors_of, evidence, pattern, theta=theta, focal_mm=focal_mm, cells=cells, edges=edges)

    def of_all(bits: float) -> float:
        return each * bits if bits > needed else bits

    if cells:
        index = whole_cells(evidence, pattern, index, theta, focal_mm=focal_mm)
        return of_all(min(_bits(read(index=index, along=along)) for along in (0, 1)))
    along = 1 if pattern.turning is None else pattern.turning
    ring = index[:, 1 - along]
    rings = [read(index=index[ring == one], along=along) for one in ring.unique()]
    plainest = max((one.energy for one in rings), default=0.0)
    saved = of_all(sum(_bits(one) for one in rings if one.energy >= _FAINT * plainest))
    return max(saved - UPRIGHT_BITS * pattern.upright, 0.0)


def rows_bits(
    evidence: Evidence, pattern: Pattern, index: Tensor, theta: Tensor, *, focal_mm: float, edges: bool = True
) -> float:
    """What cells `index` [N, 2] of a lattice under theta [P] save row by row, in bits, at least 0.

    For cells that were picked because they are like all others, which makes those that come again by chance
    look like a pattern: a row is compared with itself alone. It must come again along i and along j; the
    fewer bits count. By colours alone without `edges`.
    """
    every, index = len(index), index[thinned(index, MOST_READ)]
    cells = whole_cells(evidence, pattern, index, theta, focal_mm=focal_mm)

    def bits(along: int) -> float:
        sectors = sectors_of(
            evidence, pattern, cells, theta, focal_mm=focal_mm, along=along, cells=True, edges=edges
        )
        row = index[sectors.read, 1 - along].numpy()
        return _bits_of_rows(sectors, [np.flatnonzero(row == one) for one in np.unique(row)])

    return every / max(len(index), 1) * min(bits(along) for along in (0, 1))


def lie_on_own_grid(
    evidence: Evidence, pattern: Pattern, index: Tensor, theta: Tensor, focal_mm: float
) -> bool:
    """Whether draws [N, 2] lie on the picture's own grid."""
    matrix = pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm)
    points, _ = project(matrix, pattern.points_at(index, theta))
    return on_own_grid(evidence.on_photo(points), index)


def _bits(sectors: Sectors) -> float:
    """The bits of sectors with a mean one, some of which may be hidden by something else.

    Hidden sectors are told by nothing, and named: which k of N costs the logarithm of the ways to choose
    them, and how many of k. Without that a single object under a leaf would cost all others their evidence.
    """
    number = len(sectors.waves)
    if number < _FEWEST:
        return 0.0
    by_wave = np.moveaxis(sectors.waves, 2, 0)
    products = by_wave @ np.conj(np.swapaxes(by_wave, 1, 2))  # [M, N, N]
    likest = np.argsort(-_with_all_others(products), kind="stable")
    best, hidden = _bits_of(products, sectors.untold), 1
    while number - hidden >= max(_FEWEST, (1 - MOST_HIDDEN) * number):
        kept = np.sort(likest[: number - hidden])
        named = math.log2(math.comb(number, hidden)) + math.log2(number)
        best = max(best, _bits_of(products[:, kept[:, None], kept], sectors.untold) - named)
        hidden *= 2
    return best


def _with_all_others(products: NDArray[np.complex64]) -> NDArray[np.float32]:
    """How like each of N sectors is to the sum of the others, by their products [M, N, N]: [N]."""
    return (products.sum(2) - np.diagonal(products, axis1=1, axis2=2)).real.sum(0)


def _bits_of(products: NDArray[np.complex64], untold: float) -> float:
    """The bits of sectors whose waves have these products [M, N, N]; the lowest waves that say most count."""
    saved = _by_lowest_waves(products, _independent(products), untold)
    # One of so many choices was made.
    return max(0.0, max(saved) - math.log2(len(saved)))


def _bits_of_rows(sectors: Sectors, rows: list[NDArray[np.intp]]) -> float:
    """The bits of rows of sectors, each with a mean one of its own; a row of one says nothing.

    How many independent samples a sector has is read off all rows together: what sectors of different rows do
    not share with their own row has nothing in common but by chance.
    """
    rows = [row for row in rows if len(row) > 1]
    if not rows:
        return 0.0
    by_wave = np.moveaxis(sectors.waves, 2, 0)  # [M, N, K]
    samples = _independent_of_rows([by_wave[:, row] for row in rows])
    saved = np.zeros(len(by_wave))
    for row in rows:
        own = by_wave[:, row]
        saved += _by_lowest_waves(own @ np.conj(np.swapaxes(own, 1, 2)), samples, sectors.untold)
    # The lowest waves that say most count, one of so many choices.
    return max(0.0, float(saved.max()) - math.log2(len(saved)))


def _by_lowest_waves(
    products: NDArray[np.complex64], samples: NDArray[np.float64], untold: float
) -> list[float]:
    """The bits that sectors save by their first wave, by the first two, and so on: M numbers.

    `products` [M, N, N] are those of their waves, of which each has so many independent `samples` [M].
    """
    number = products.shape[1]
    energy = np.diagonal(products, axis1=1, axis2=2).real.sum(1)
    shared = products.sum((1, 2)).real / (number * np.maximum(energy, 1e-12))  # by the mean sector
    saved = []
    for last in range(1, len(shared) + 1):
        total = samples[:last].sum()
        share = min(float((shared[:last] * samples[:last]).sum() / total), 1 - untold)
        saved.append(float(total) * likelihood_ratio(share, number) if share > 1 / number else 0.0)
    return saved


def likelihood_ratio(share: float, number: int) -> float:
    """log2 of how much likelier a mean sector with this `share` of all energy is as an object than by chance.

    That is for one complex sample of each of `number` sectors; `share` lies between 1/number and 1.
    """
    left = number - 1
    nats = -number * math.log(number) - math.log(share) - left * math.log(1 - share) + left * math.log(left)
    return nats / math.log(2)


def _independent(products: NDArray[np.complex64]) -> NDArray[np.float64]:
    """How many independent samples each wave of sectors has, by what is not shared: [M, N, N] -> [M]."""
    number = products.shape[1]
    # The products of what is left of each sector without their mean.
    to_mean = products.mean(2, keepdims=True)
    rest = products - to_mean - np.conj(np.swapaxes(to_mean, 1, 2)) + to_mean.mean(1, keepdims=True)
    gram = np.abs(rest) ** 2
    own = np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
    alike = gram.sum((1, 2)) - np.diagonal(gram, axis1=1, axis2=2).sum(1)
    every = own.sum(1) ** 2 - (own**2).sum(1)
    # Residuals of a mean sum to nothing, so their cosines are 1/(number - 1) at least.
    return np.minimum(every / np.maximum(alike, 1e-12), (number - 1) ** 2).clip(1.0)


def _independent_of_rows(rows: list[NDArray[np.complex64]]) -> NDArray[np.float64]:
    """How many independent samples each wave of sectors has, by what rows [M, n, K] do not share: [M].

    Of a single row nothing is independent of the rest, so it tells itself: `_independent`. At most as many as
    so few sectors can tell.
    """
    if len(rows) < 2:
        return _independent(rows[0] @ np.conj(np.swapaxes(rows[0], 1, 2)))
    rest = np.concatenate([row - row.mean(1, keepdims=True) for row in rows], 1)
    number = np.concatenate([np.full(row.shape[1], place) for place, row in enumerate(rows)])
    apart = number[:, None] != number
    gram = np.abs(rest @ np.conj(np.swapaxes(rest, 1, 2))) ** 2
    own = np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
    every = (own[:, :, None] * own[:, None])[:, apart].sum(1)
    most = sum(row.shape[1] - 1 for row in rows) ** 2
    return (every / np.maximum(gram[:, apart].sum(1), 1e-12)).clip(1.0, most)

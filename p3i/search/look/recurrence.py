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
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import quarter_turned, tangents
from p3i.search.look.sampling import on_own_grid
from p3i.search.look.thinned import thinned
from p3i.search.look.unrolled import orientation
from p3i.vision.warp import sample, sample_valid

Floats = NDArray[np.float32]

ALONG = 16
"""Samples along a sector; waves up to half as many can be told."""
ACROSS = 14
"""Samples across a sector."""
UPRIGHT_BITS = 5.0
"""What it costs to say that objects on a curve do not turn with it: one kind of ring in thirty does so."""
MOST_READ = 200
"""More draws than this are judged by a part of them."""
MOST_HIDDEN = 0.2
"""A ring goes all round, and a pattern is one, where at most this share of its objects lacks."""
# A sector of which less is known is none, and fewer than this many say nothing.
_LEAST_KNOWN = 0.7
_FEWEST = 3
# This share of a sector's energy is told by nothing: objects and light differ.
_UNTOLD = 0.03
# What rounding to 8 bits leaves of three colours, each from 0 to 100: uniform over one of 255 levels.
_ROUNDING = 3 * (100 / 255) ** 2 / 12
# What is fainter than this share of the plainest ring is none: that ring's objects reach there.
_FAINT = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Sectors:
    """The waves of sectors, `waves` complex [R, K, M]: K samples (rows and features) of M waves for each of
    R, of the N draws those that are `read` [N].

    `energy` is what is typical of their gradients before they were evened out, and `untold` the share of all
    that nothing tells.
    """

    waves: NDArray[np.complex64]
    read: Tensor
    energy: float
    untold: float


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

    def bits(along: int) -> float:
        sectors = sectors_of(
            evidence, pattern, index, theta, focal_mm=focal_mm, along=along, cells=False, edges=edges
        )
        row = index[sectors.read, 1 - along].numpy()
        return sum(_bits(replace(sectors, waves=sectors.waves[row == one])) for one in np.unique(row))

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
    number = products.shape[1]
    energy = np.diagonal(products, axis1=1, axis2=2).real.sum(1)
    shared = products.sum((1, 2)).real / (number * np.maximum(energy, 1e-12))
    samples = _independent(products)
    best = 0.0
    for last in range(1, len(shared) + 1):
        total = samples[:last].sum()
        share = min(float((shared[:last] * samples[:last]).sum() / total), 1 - untold)
        if share > 1 / number:
            best = max(best, float(total) * likelihood_ratio(share, number))
    # One of so many choices was made.
    return max(0.0, best - math.log2(len(shared)))


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


def sectors_of(
    evidence: Evidence,
    pattern: Pattern,
    index: Tensor,
    theta: Tensor,
    *,
    focal_mm: float,
    along: int,
    cells: bool,
    edges: bool,
) -> Sectors:
    """The sectors about the draws at `index` [N, 2], read along the loop variable `along`, 0 for i or 1 for
    j; their colours alone, or their `edges` too.
    """
    # Half a step more at either end, for the mean over one step, and a sample for the gradients.
    a = (np.arange(2 * ALONG + 2) + 0.5) / ALONG - 1 - 1 / ALONG
    b = (np.arange(ACROSS + 2) - (ACROSS + 1) / 2) / ACROSS
    points = _points(pattern, index, theta, a, b, along=along, cells=cells)
    lab, known = _read(evidence, points, pattern, theta, focal_mm)
    gx = 0.5 * (lab[..., 2:, :] - lab[..., :-2, :])[:, 1:-1]
    gy = 0.5 * (lab[:, 2:] - lab[:, :-2])[..., 1:-1, :]
    known = known[:, 1:-1, 1:-1].astype(np.float32)
    whole = slice(ALONG // 2, ALONG // 2 + ALONG)
    seen = known[..., whole]
    gradients, colours = (
        _without_mean(values, known)
        for values in (np.stack(orientation(gx, gy), 1), np.moveaxis(lab[:, 1:-1, 1:-1], -1, 1))
    )
    # [N, 3 or 6, ACROSS, ALONG], gradients and colours with the same weight.
    values = np.concatenate([_evened(each, seen) for each in ([gradients] * edges + [colours])], 1)
    waves = np.fft.fft(values, axis=-1)[..., 1 : ALONG // 2].astype(np.complex64)
    enough = seen.mean((1, 2)) >= _LEAST_KNOWN
    typical, colour = (
        float(np.median(_energy(each, seen))) if len(index) else 0.0 for each in (gradients, colours)
    )
    rounded = _ROUNDING + (0.0 if edges else _left_by_squares(lab, known))
    untold = min(_UNTOLD + rounded / max(colour, _ROUNDING), 1.0)
    waves = waves.reshape(len(waves), -1, waves.shape[-1])[enough]
    return Sectors(waves, torch.from_numpy(enough), typical, untold)


def _points(
    pattern: Pattern, index: Tensor, theta: Tensor, a: NDArray, b: NDArray, *, along: int, cells: bool
) -> Tensor:
    """The plane points of sectors [N, B, A, 2]: `a` [A] steps along, `b` [B] steps across the draws."""
    forth, up = torch.from_numpy(a), torch.from_numpy(b)
    where = index[:, None, None, :].repeat(1, len(up) if cells else 1, len(forth), 1)
    where[..., along] += forth
    if cells:
        where[..., 1 - along] += up[:, None]
        return pattern.points_at(where.reshape(-1, 2), theta).reshape(*where.shape)
    flat = where.reshape(-1, 2)
    tangent = tangents(pattern, theta, flat, along).reshape(*where.shape)
    length = tangent.norm(dim=-1, keepdim=True).clamp(min=1e-12)
    across = quarter_turned(tangent) / length
    width = length.median(2, keepdim=True).values  # a step of this draw
    if pattern.upright:
        b_axis, a_axis = torch.meshgrid(up, forth, indexing="ij")
        return pattern.points_at(index, theta)[:, None, None] + width * torch.stack([a_axis, b_axis], -1)
    middle = pattern.points_at(flat, theta).reshape(*where.shape)
    return middle + up[:, None, None] * width * across


def _read(
    evidence: Evidence, points: Tensor, pattern: Pattern, theta: Tensor, focal_mm: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """The colours [N, B, A, 3] at plane points [N, B, A, 2] and which are known [N, B, A]."""
    matrix = pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm)
    row = points.shape[1] // 2
    middle, front = project(matrix, points[:, row].reshape(-1, 2))
    apart = (middle[1:] - middle[:-1]).norm(dim=1)[front[1:] & front[:-1]]
    colours = evidence.colours_for(float(apart.median()) if len(apart) else 1.0)
    at, in_front = project(colours.map_from_photo @ matrix, points.reshape(-1, 2))
    at = at.float()
    known = (sample_valid(colours.valid, at) & in_front).reshape(points.shape[:-1])
    lab = sample(colours.values, at).reshape(*points.shape[:-1], 3)
    return lab.numpy(), known.numpy()


def _without_mean(values: Floats, known: Floats) -> Floats:
    """Values [N, C, B, 2 * ALONG] less their mean over a step: [N, C, B, ALONG], the middle."""
    weights = np.pad(known, ((0, 0), (0, 0), (1, 0))).cumsum(-1)[:, None]
    sums = np.pad(values * known[:, None], ((0, 0), (0, 0), (0, 0), (1, 0))).cumsum(-1)
    # The two samples at the ends of a step count by half.
    weights, sums = ((table[..., 1:] + table[..., :-1]) / 2 for table in (weights, sums))
    half = ALONG // 2
    middle = slice(half, half + ALONG)
    ahead, behind = slice(ALONG, 2 * ALONG), slice(0, ALONG)
    mean = (sums[..., ahead] - sums[..., behind]) / np.maximum(
        weights[..., ahead] - weights[..., behind], 1e-6
    )
    return ((values[..., middle] - mean) * known[:, None][..., middle]).astype(np.float32)


def _left_by_squares(lab: Floats, known: Floats) -> float:
    """What squares of one colour each leave of the light's slope, as the energy of a typical sector.

    Of a slope that rises by d in a step, squares as wide as the step leave a sawtooth of variance d^2 / 12:
    it comes again as the squares do. Shapes: lab [N, B + 2, 2 * ALONG + 2, 3], known [N, B, 2 * ALONG].
    """
    inner, seen = lab[:, 1:-1, 1:-1], known[..., None]
    halves = (slice(0, ALONG), slice(ALONG, 2 * ALONG))
    before, after = (
        (inner[:, :, part] * seen[:, :, part]).sum(2) / np.maximum(seen[:, :, part].sum(2), 1e-6)
        for part in halves
    )
    both = np.minimum(*(known[..., part].mean(2) for part in halves))  # [N, B]
    rise = ((after - before) ** 2).sum(2) / 12
    return float(np.median((rise * both).sum(1) / np.maximum(both.sum(1), 1e-6))) if len(lab) else 0.0


def _energy(values: Floats, known: Floats) -> Floats:
    """The mean energy of each sector: values [N, C, B, A], known [N, B, A] -> [N]."""
    return ((values**2).sum((1, 2, 3)) / np.maximum(known.sum((1, 2)), 1)).astype(np.float32)


def _evened(values: Floats, known: Floats) -> Floats:
    """Values [N, C, B, A], each sector divided by the root of its energy and the typical one."""
    energy = _energy(values, known)
    typical = float(np.median(energy)) if len(energy) else 0.0
    return (values / np.sqrt(energy + max(typical, 1e-9))[:, None, None, None]).astype(np.float32)

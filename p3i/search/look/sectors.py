"""The sectors about a program's draws, read off the photo: what comes again at its steps, and is judged by.

Each draw's sector is read off the plane: one step along the curve, as much across it; of a lattice one cell.
What is the same at every turn, a rim, and what changes slowly, a shade, is taken out of it (a mean over one
step has neither), and the rest told in waves along the curve: wave m has m periods a step.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import quarter_turned, tangents
from p3i.search.look.unrolled import orientation
from p3i.vision.warp import sample, sample_valid

Floats = NDArray[np.float32]

ALONG = 16
"""Samples along a sector; waves up to half as many can be told."""
ACROSS = 14
"""Samples across a sector."""
# A sector of which less is known is none.
_LEAST_KNOWN = 0.7
# This share of a sector's energy is told by nothing: objects and light differ.
_UNTOLD = 0.03
# What rounding to 8 bits leaves of three colours, each from 0 to 100: uniform over one of 255 levels.
_ROUNDING = 3 * (100 / 255) ** 2 / 12


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


def whole_cells(
    evidence: Evidence, pattern: Pattern, index: Tensor, theta: Tensor, *, focal_mm: float
) -> Tensor:
    """The draws `index` [N, 2] of a lattice, moved by the part of a step that brings most cells into sight.

    What comes again about them comes again anywhere beside them. Where the frame cuts the outer ones of few
    large cells, half a step on there may be twice as many whole ones. As they are, where no more are.
    """
    matrix = pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm)
    places = torch.linspace(-0.4, 0.4, 5, dtype=torch.float64)  # the middles of fifths of a cell
    inside = torch.cartesian_prod(places, places)

    def whole(shifts: Tensor) -> Tensor:
        """How many cells are whole in sight after each of the shifts [S, 2]: [S]."""
        at = shifts[:, None, None] + index[:, None] + inside  # [S, N, K, 2]
        points, front = project(matrix, pattern.points_at(at.reshape(-1, 2), theta))
        seen = (front & evidence.part.shows(points)).reshape(at.shape[:3])
        return (seen.double().mean(2) >= _LEAST_KNOWN).sum(1)

    if int(whole(torch.zeros(1, 2, dtype=torch.float64))) == len(index):
        return index
    ticks = torch.arange(-0.5, 0.51, 0.25, dtype=torch.float64)
    shifts = torch.cartesian_prod(ticks, ticks)
    shifts = shifts[shifts.abs().sum(1).argsort(stable=True)]  # the least first: of equals, argmax takes it
    return index + shifts[int(whole(shifts).argmax())]


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

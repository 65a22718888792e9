"""Object patches: the plane around each draw of any program, read off the photo and compared.

Cells (cells.py) are swept by fractional loop indices, which suits lattices. Rings, spirals and single rows
have no second direction to sweep, and their objects turn as they go round. A patch is a square of plane of
one size for the whole program, about each draw, turned with the curve where the program draws on a curve and
the objects do not stand upright (upright.py). As there, a pattern is where objects predict each other and do
not predict what lies half a step away.

Convention: N patches of `side` x `side` samples, C channels; `index` float64 [N, 2] loop indices, fractions
allowed; plane coordinates in program units. Patch offsets (a, b) are in patch sides: a along the curve, b
across it (a quarter turn clockwise on the screen).
"""

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.search.look.cells import HALF_STEPS, Cells, contrast_of
from p3i.search.look.correlate import Instances, located, reach_of
from p3i.search.look.evidence import ColourMap, Evidence
from p3i.search.look.thinned import thinned
from p3i.vision.oriented import double_angle
from p3i.vision.warp import sample, sample_valid

SIDE = 14
"""Samples along a patch's side."""
# Loop indices this far apart give the direction of the curve.
_TANGENT_STEP = 0.02
# So many distances between draws say how far apart they are.
_MOST_DISTANCES = 400**2
# An object's place is known to this share of a patch's side, and no better than this many pixels.
_SHARE_NOISE = 0.03
_PIXEL_NOISE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """Where patches lie on the plane: `origin` [N, 2], `along` and `across` [N, 2], one patch side long."""

    origin: Tensor
    along: Tensor
    across: Tensor

    def chosen(self, which: Tensor) -> "Frames":
        """Those of them that `which` [N] bool says."""
        return Frames(self.origin[which], self.along[which], self.across[which])

    def points(self, offsets: Tensor) -> Tensor:
        """The plane points at `offsets` [..., N or 1, K, 2] -> [..., N, K, 2]."""
        a, b = offsets[..., 0, None], offsets[..., 1, None]
        return self.origin[:, None] + a * self.along[:, None] + b * self.across[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Features [N, C, side, side] of patches and which samples are `known` [N, side, side]."""

    values: Tensor
    known: Tensor

    def cells(self) -> Cells:
        """The same as rows of samples: values [N, K, C], known [N, K]."""
        return Cells(self.values.flatten(2).mT, self.known.flatten(1))


def spacing(pattern: Pattern, theta: Tensor) -> float:
    """The median distance of a draw under theta [P] to its nearest, in program units; 1 for a single draw.

    Draws that coincide count once.
    """
    centers = pattern.centers(theta)
    some = thinned(pattern.index, _MOST_DISTANCES // max(len(centers), 1) + 1)
    distance = torch.cdist(centers[some], centers)
    distance = torch.where(distance > 1e-6, distance, torch.inf).amin(1)
    finite = distance[torch.isfinite(distance)]
    return float(finite.median()) if len(finite) else 1.0


def frames(pattern: Pattern, theta: Tensor, index: Tensor, *, side: float) -> Frames:
    """The patches of `side` program units about `index` [N, 2]."""
    origin = pattern.points_at(index, theta)
    variable = pattern.turning
    if variable is None or not pattern.turns:
        along = torch.tensor([side, 0.0], dtype=torch.float64).expand_as(origin)
    else:
        tangent = tangents(pattern, theta, index, variable)
        along = side * tangent / tangent.norm(dim=1, keepdim=True).clamp(min=1e-12)
    return Frames(origin, along, quarter_turned(along))


def tangents(pattern: Pattern, theta: Tensor, index: Tensor, variable: int) -> Tensor:
    """How draws at `index` [N, 2] move with the loop variable 0, i, or 1, j, in units a step: [N, 2]."""
    step = torch.zeros(2, dtype=torch.float64)
    step[variable] = _TANGENT_STEP
    ahead, behind = (pattern.points_at(index + sign * step, theta) for sign in (1, -1))
    return (ahead - behind) / (2 * _TANGENT_STEP)


def quarter_turned(along: Tensor) -> Tensor:
    """Vectors of the plane [..., 2] turned by a quarter, clockwise on the screen."""
    return torch.stack([-along[..., 1], along[..., 0]], -1)


def half_steps(pattern: Pattern) -> Tensor:
    """The half steps [M, 2] of the loop variables that move the draws: one where only one does."""
    theta = dict(zip(pattern.paths, pattern.theta.tolist(), strict=True))
    moving = [
        any(
            path.startswith("draw.") and path.endswith(f".{variable}") and value != 0
            for path, value in theta.items()
        )
        for variable in ("i", "j")
    ]
    if all(moving):
        return HALF_STEPS
    return HALF_STEPS[:1] if moving[0] else HALF_STEPS[1:2]


def offsets_grid(count: int, *, samples_a_side: int = SIDE) -> Tensor:
    """`count` x `count` offsets about the middle of a patch that has `samples_a_side`: [count, count, 2]."""
    steps = (torch.arange(count, dtype=torch.float64) - (count - 1) / 2) / samples_a_side
    b, a = torch.meshgrid(steps, steps, indexing="ij")
    return torch.stack([a, b], -1)


def sample_px(matrix: Tensor, where: Frames, *, side: int = SIDE) -> float:
    """The median distance of patches' samples in photo pixels; `matrix` [3, 3] takes units to these."""
    lengths = []
    middle, front = project(matrix, where.origin)
    for axis in (where.along, where.across):
        there, ahead = project(matrix, where.origin + 0.25 * axis)
        lengths.append((there - middle).norm(dim=1)[front & ahead] * 4 / side)
    typical = torch.cat(lengths)
    return float(typical.median()) if len(typical) else 1.0


def read(
    colours: ColourMap,
    matrix: Tensor,
    where: Frames,
    *,
    count: int = SIDE,
    side: int = SIDE,
    by_row: bool = False,
) -> Patches:
    """The features of `count` x `count` samples about each frame, `side` of them to a patch side.

    `matrix` [3, 3] takes program units to photo pixels. Twelve channels: for each of L, a, b the gradient's
    strength and its double angle (as in vision/oriented.py, but in the frame's own directions, so that
    objects that turn with a ring stay equal), then L, a, b themselves. Each patch is freed of its mean, or,
    `by_row`, of that of each of its rows along the curve, where a rim is alike at every turn, and no object;
    and gradients and colours are each scaled to mean energy 1/2 over all patches.
    """
    rim = count + 2
    at, in_front = project(
        colours.map_from_photo @ matrix,
        where.points(offsets_grid(rim, samples_a_side=side).reshape(-1, 2)).reshape(-1, 2),
    )
    at = at.float()
    lab = sample(colours.values, at).reshape(-1, rim, rim, 3).permute(0, 3, 1, 2)
    known = (sample_valid(colours.valid, at) & in_front).reshape(-1, rim, rim)
    # A gradient is known where the samples about it are.
    whole = F.max_pool2d((~known).float()[:, None], 3, stride=1)[:, 0] < 0.5
    return Patches(_features(lab, whole, by_row=by_row), whole)


def _features(lab: Tensor, known: Tensor, *, by_row: bool) -> Tensor:
    """[N, 3, s + 2, s + 2] colours -> [N, 12, s, s] normalised features, 0 where not known [N, s, s]."""
    gx = 0.5 * (lab[:, :, 1:-1, 2:] - lab[:, :, 1:-1, :-2])
    gy = 0.5 * (lab[:, :, 2:, 1:-1] - lab[:, :, :-2, 1:-1])
    gradient = torch.cat(double_angle(gx * gx, gy * gy, gx * gy), 1)
    colours = lab[:, :, 1:-1, 1:-1]
    return torch.cat([_normalised(each, known, by_row=by_row) for each in (gradient, colours)], 1)


def _normalised(values: Tensor, known: Tensor, *, by_row: bool) -> Tensor:
    """Each patch freed of its mean, or each row of it, and divided by sqrt(its energy + that of all)."""
    mask = known[:, None].float()
    count = mask.sum((2, 3), keepdim=True).clamp(min=1)
    alike = (3,) if by_row else (2, 3)
    mean = (values * mask).sum(alike, keepdim=True) / mask.sum(alike, keepdim=True).clamp(min=1)
    values = (values - mean) * mask
    energy = values.square().sum((1, 2, 3), keepdim=True) / count
    typical = energy[energy > 0].median() if bool((energy > 0).any()) else energy.sum() + 1.0
    return values / (energy + typical).clamp(min=1e-9).sqrt()


def patch_contrast(
    evidence: Evidence,
    pattern: Pattern,
    theta: Tensor,
    index: Tensor,
    *,
    side: float,
    focal_mm: Tensor | float,
    rounds: int = 3,
) -> Tensor:
    """How well each patch at `index` [N, 2] is predicted by the others, beyond half a step away: [N]."""
    steps = half_steps(pattern)
    every = torch.cat([torch.zeros(1, 2, dtype=torch.float64), steps, -steps])
    where = frames(pattern, theta, (index[None] + every[:, None]).reshape(-1, 2), side=side)
    matrix = pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm)
    cells = read(evidence.colours_for(sample_px(matrix, where)), matrix, where, by_row=pattern.turns).cells()
    values = cells.values.reshape(len(every), len(index), *cells.values.shape[1:])
    known = cells.known.reshape(len(every), len(index), -1)
    return contrast_of(Cells(values, known), weights=torch.ones(len(index)), rounds=rounds)


def find_about(
    evidence: Evidence,
    matrix: Tensor,
    where: Frames,
    index: Tensor,
    weights: Tensor,
    *,
    side: int = SIDE,
) -> Instances:
    """Search around each frame for the mean patch, in `side` samples each; `weights` [N] make that mean.

    `matrix` [3, 3] takes program units to photo pixels; `index` [N, 2] is what the instances are called. The
    offsets that come back are in patch sides, along and across.
    """
    colours = evidence.colours_for(sample_px(matrix, where, side=side))
    patches = read(colours, matrix, where, count=side + 2 * reach_of(side), side=side)
    found = located(index, patches.values, patches.known, weights, side=side)
    # Rows of a patch run across the curve, columns along it.
    return replace(found, offsets=found.offsets.flip(1))


def whitening(matrix: Tensor, where: Frames) -> Tensor:
    """[N, 2, 2]: differences in pixels to differences in units of places' noise, along and across."""
    return in_units_of_noise(_px_from_side(matrix, where))


def areas_px(matrix: Tensor, where: Frames) -> Tensor:
    """The area of each patch on the photo, in square pixels: [N]; `matrix` [3, 3] takes units to pixels."""
    return torch.linalg.det(_px_from_side(matrix, where)).abs()


def _px_from_side(matrix: Tensor, where: Frames) -> Tensor:
    """[N, 2, 2]: steps in patch sides, along and across, to steps in pixels."""
    columns = []
    for axis in (where.along, where.across):
        ahead, _ = project(matrix, where.origin + 0.1 * axis)
        behind, _ = project(matrix, where.origin - 0.1 * axis)
        columns.append((ahead - behind) / 0.2)
    return torch.stack(columns, 2)


def in_units_of_noise(px_from_side: Tensor) -> Tensor:
    """What takes pixels to sides of patches or cells, [N, 2, 2], the other way, in units of places' noise."""
    side_px = torch.linalg.det(px_from_side).abs().sqrt().clamp(min=1.0)
    noise = (_SHARE_NOISE**2 + (_PIXEL_NOISE / side_px) ** 2).sqrt()
    return torch.linalg.pinv(px_from_side) / noise[:, None, None]


def misfit(difference: Tensor, *, whiten: Tensor, certainty: Tensor) -> float:
    """How far objects lie from their places: a robust mean, 0 where all are there.

    Shapes: difference [N, 2] in pixels; whiten [N, 2, 2], of `whitening`; certainty [N], not all 0.
    """
    residual = torch.einsum("nij,nj->ni", whiten, difference)
    return float((certainty * (1 + residual.square().sum(1) / 4).log()).sum() / certainty.sum())

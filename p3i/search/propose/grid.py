"""The coarse search of any sketch: many fillings at once, scored by what the photo shows at single points.

A draw is looked at where its middle falls, on a blurred map, and held against the points half a step away:
along each loop variable and, where a single loop draws a chain, across it. Where all draws look alike and
unlike their half steps, a pattern may be. This is equation 2, turned so that a smooth or tiny view gains
nothing; it costs microseconds a filling, so that a grid over the holes can be afforded, and has a gradient.

Convention: B fillings z [B, F]; N indices, S settings, C channels; scores [B, S] from about 0 to 1.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.search.forms.filling import Filling
from p3i.search.forms.ranges import Range
from p3i.search.look.cells import HALF_STEPS
from p3i.search.look.evidence import COARSE, Evidence
from p3i.search.look.patches import half_steps
from p3i.size import Size
from p3i.vision.normalize import locally_normalized
from p3i.vision.warp import sample, sample_valid

BLUR_SHARES = (0.3, 0.2, 0.13)
"""Blurs of the map, from coarse to fine, as shares of the distance between draws."""

# Draws closer than this on the map cannot be told apart, nor can those nearer than this share of their step.
_LEAST_STEP_PX = 7.0
_COINCIDING = 0.35
# Blurs of the maps in map pixels: a factor 2^(1/2) apart.
_SIGMAS = tuple(2 ** (k / 2) for k in range(0, 11))
# What a difference must exceed to count, in the map's units (mean energy 1).
_FLOOR = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class PointMaps:
    """Maps to read single points on: `values` [L, C, H, W] at the blurs `_SIGMAS`, `valid` [H, W].

    The channels do not change when an object is turned: colours, and how strong gradients are.
    """

    values: Tensor
    valid: Tensor
    map_from_photo: Tensor
    photo_size: Size
    focal_mm: float

    @classmethod
    def of(cls, evidence: Evidence) -> "PointMaps":
        """The maps of a photo, at about `COARSE` pixels a side."""
        colours = evidence.colours_for(max(1.0, evidence.part.size.longer / COARSE))
        lab = colours.values.numpy()
        gx = np.stack([cv2.Sobel(plane, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8) for plane in lab])
        gy = np.stack([cv2.Sobel(plane, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8) for plane in lab])
        strength = np.sqrt(np.sqrt((gx**2 + gy**2).sum(0)))
        both = torch.from_numpy(
            np.concatenate([lab / (lab.std() + 1e-6), strength[None] / (strength.std() + 1e-6)])
        )
        local = locally_normalized(both.float(), colours.valid)
        local = local / local.square().sum(0)[colours.valid].mean().sqrt().clamp(min=1e-6)
        planes = local.numpy()
        blurred = [
            torch.from_numpy(np.stack([cv2.GaussianBlur(plane, (0, 0), sigma) for plane in planes]))
            for sigma in _SIGMAS
        ]
        return cls(
            torch.stack(blurred),
            colours.valid,
            colours.map_from_photo,
            evidence.image.size,
            evidence.focal_mm,
        )

    def map_from_plane(self, filling: Filling, theta: Tensor) -> Tensor:
        """The homography from program units to map pixels, [..., 3, 3]."""
        seen = filling.pattern.image_from_plane(theta, size=self.photo_size, focal_mm=self.focal_mm)
        return self.map_from_photo @ seen

    def level(self, step_px: Tensor, share: float) -> Tensor:
        """The blur for draws `step_px` [...] map pixels apart, as places [...] in `_SIGMAS`."""
        place = torch.round(2 * torch.log2((share * step_px).clamp(min=1e-3)))
        return place.clamp(0, len(_SIGMAS) - 1).long()


def score_points(maps: PointMaps, filling: Filling, z: Tensor, *, share: float, soft: bool = False) -> Tensor:
    """How well each filling z [B, F] explains the points, [B, S]; `share` is the blur.

    Differentiable in z; fillings whose draws are too close are worth 0. `soft` averages over the half
    steps instead of taking the worst.
    """
    theta = filling.theta(z)
    steps = half_steps(filling.pattern)
    index = filling.pattern.index.double()
    count = len(index)
    offsets = torch.cat([torch.zeros(1, 2), steps, -steps]).double()
    plane = filling.pattern.points_at((index[None] + offsets[:, None]).reshape(-1, 2), theta)
    plane = plane.unflatten(-2, (len(offsets), count))  # [B, 1 + 2M, N, 2]
    if len(steps) < len(HALF_STEPS):  # a chain: look across it as well
        along = plane[:, 1] - plane[:, 2]
        across = 0.5 * torch.stack([-along[..., 1], along[..., 0]], -1)
        plane = torch.cat([plane, (plane[:, 0] + across)[:, None], (plane[:, 0] - across)[:, None]], 1)
    matrix = maps.map_from_plane(filling, theta)
    flat = plane.flatten(1, 2)
    points, front = project(matrix, flat)
    points, front = points.unflatten(1, (-1, count)), front.unflatten(1, (-1, count))
    step_px = _step_px(points.detach(), front, len(steps))
    values, known = _read(maps, points.float(), front, maps.level(step_px, share))
    kinds = _pairs(len(steps), chain=len(steps) < len(HALF_STEPS))
    scores = _separation(values, known, filling.masks, kinds, soft=soft)
    return scores * (step_px > _LEAST_STEP_PX)[:, None]


def _pairs(steps: int, *, chain: bool) -> list[tuple[int, int]]:
    """Which of the 1 + 2M rows of points are the two half steps of one kind."""
    pairs = [(1 + k, 1 + steps + k) for k in range(steps)]
    return [*pairs, (1 + 2 * steps, 2 + 2 * steps)] if chain else pairs


def _step_px(points: Tensor, front: Tensor, steps: int) -> Tensor:
    """The typical distance of draws on the map [B], by the shortest of the loop steps."""
    lengths = []
    for k in range(min(steps, 2)):
        length = (points[:, 1 + k] - points[:, 1 + steps + k]).norm(dim=-1)
        length = torch.where(front[:, 1 + k] & front[:, 1 + steps + k], length, torch.nan)
        lengths.append(length.nanmedian(1).values)
    return torch.nan_to_num(torch.stack(lengths).amin(0), nan=0.0)


def _read(maps: PointMaps, points: Tensor, front: Tensor, level: Tensor) -> tuple[Tensor, Tensor]:
    """The features [B, R, N, C] at points [B, R, N, 2], each filling on its own level, and what is known."""
    known = front & sample_valid(maps.valid, points)
    values = points.new_zeros(*points.shape[:-1], maps.values.shape[1])
    for one in level.unique().tolist():
        chosen = torch.nonzero(level == one)[:, 0]
        values = values.index_copy(0, chosen, sample(maps.values[one], points[chosen]))
    return values * known[..., None], known


def _separation(
    values: Tensor, known: Tensor, masks: Tensor, kinds: list[tuple[int, int]], *, soft: bool
) -> Tensor:
    """How far draws and half steps lie apart, against how much each varies: [B, S].

    The share of variance that telling the two apart explains, freed of chance, times the share of the most
    draws that are in view.
    """
    rows = masks.float()
    count, mean, spread = _moments(values[:, 0], known[:, 0], rows)
    found = []
    for ahead, behind in kinds:
        half_values = torch.cat([values[:, ahead], values[:, behind]], 1)
        half_known = torch.cat([known[:, ahead], known[:, behind]], 1)
        others, half_mean, half_spread = _moments(half_values, half_known, torch.cat([rows, rows], 1))
        between = (mean - half_mean).square().sum(-1)
        chance = spread / (count - 1).clamp(min=1) + half_spread / (others - 1).clamp(min=1)
        between = (between - chance).clamp(min=0)
        found.append(between / (between + 2 * (spread + half_spread) + _FLOOR))
    every = torch.stack(found)
    worst = 0.5 * (every.mean(0) + every.amin(0)) if soft else every.amin(0)
    share = count / len(masks[0])
    return worst * share * (count >= 4)


def _moments(values: Tensor, known: Tensor, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Count [B, S], mean [B, S, C] and variance [B, S] of the known values [B, N, C] in each setting."""
    mask = known.float()
    count = mask @ rows.T
    total = torch.einsum("sn,bnc->bsc", rows, values)
    squares = (values.square().sum(-1) * mask) @ rows.T
    mean = total / count.clamp(min=1)[..., None]
    return count, mean, (squares / count.clamp(min=1) - mean.square().sum(-1)).clamp(min=0)


def distinct_share(filling: Filling, z: Tensor) -> Tensor:
    """The share of draws that have no other draw upon them, [B]: 0.5 where all lie in pairs."""
    centers = filling.pattern.centers(filling.theta(z))
    distance = torch.cdist(centers, centers)
    count = distance.shape[-1]
    distance = distance + torch.eye(count, dtype=distance.dtype) * 1e9
    step = filling.pattern.points_at(
        filling.pattern.index.double() + 2 * half_steps(filling.pattern)[0], filling.theta(z)
    )
    typical = (step - centers).norm(dim=-1).median(-1).values
    lonely = distance.amin(-1) > _COINCIDING * typical[:, None]
    return lonely.double().mean(-1)


def samples(filling: Filling, count: int, generator: torch.Generator) -> Tensor:
    """Points of the coarse grid over the holes, [<= count, F].

    The whole grid where it has no more than `count` points; else as many, spread evenly (Sobol) over it.
    """
    cells = [_cells(unknown.range) for unknown in filling.moving]
    if not cells:
        return torch.zeros(1, 0, dtype=torch.float64)
    if math.prod(cells) <= count:
        axes = [(torch.arange(n, dtype=torch.float64) + 0.5) / n for n in cells]
        unit = torch.cartesian_prod(*axes).reshape(-1, len(cells))
    else:
        seed = int(torch.randint(2**31, (), generator=generator))
        engine = torch.quasirandom.SobolEngine(len(cells), scramble=True, seed=seed)
        unit = engine.draw(count, dtype=torch.float64)
    return _from_unit(filling, unit)


def _cells(found: Range) -> int:
    span = found.upper - found.lower
    if found.relative and found.lower > 0:
        return max(1, math.ceil(math.log(found.upper / found.lower) / 0.06))
    return max(1, math.ceil(span / found.cell - 1e-9))


def _from_unit(filling: Filling, unit: Tensor) -> Tensor:
    """Places in the unit cube [B, F] as numbers in the ranges."""
    columns = []
    for place, unknown in enumerate(filling.moving):
        lower, upper, u = unknown.range.lower, unknown.range.upper, unit[:, place]
        if unknown.range.relative and lower > 0:
            columns.append(lower * (upper / lower) ** u)
        else:
            columns.append(lower + (upper - lower) * u)
    return torch.stack(columns, 1)

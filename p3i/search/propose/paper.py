"""The paper's own recipe, for comparison: equation 2 as printed, a grid of 2, gradient descent.

The sketch is the paper's lattice, through the origin, filling the picture (its sections 3.2 and 3.3). A grid
of 2 degrees and 2 units over its six numbers has some 10^9 points; the paper does not say which of them it
visits, nor how it descends. Here a seeded share of the grid is looked at, and Adam descends from the best of
these points.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from p3i.interp.camera import image_from_plane, project
from p3i.search.forms.guess import Guess, lattice_guess
from p3i.search.forms.lattice import Lattice
from p3i.search.look.evidence import COARSE, Evidence
from p3i.search.look.session import Session
from p3i.vision.features import FeatureMap
from p3i.vision.warp import in_frame, sample, sample_valid

GRID = 2.0
"""The paper's grid size: degrees for the camera, program units for the lattice."""
LOOKED_AT = 12_000
"""Points of the grid that are looked at, drawn at random by the seed."""
DESCENTS = 96
"""Points from which gradient descent starts, those of the least loss."""
STEPS, RATE = 60, 0.2
"""Adam's steps and its learning rate, in degrees and units; the paper names neither."""

_MOST_TILT_DEG = 60
_SHORTEST, _LONGEST = 6.0, 40.0
# The least angle between the two steps, as in the paper's published code.
_LEAST_ANGLE_DEG = 44
# Loops run from -_REACH to _REACH: what lies outside the picture is not drawn.
_REACH = 12
_BATCH = 200
_FEWEST_TOLD = 4


def paper_guesses(look: Session) -> Iterator[Guess]:
    """The lattices of least loss, the least first; they are to stay as they are."""
    evidence = look.evidence
    features = evidence.features(COARSE)
    numbers = _grid(look.generator)
    losses: list[Tensor] = []
    with look.until_interrupted():
        for first in range(0, len(numbers), _BATCH):
            if losses and not look.go_on():
                break
            look.tell("the paper's grid", 0.5 * first / len(numbers))
            with torch.no_grad():
                losses.append(equation2(evidence, features, numbers[first : first + _BATCH]))
    if not losses:
        return
    order = torch.argsort(torch.cat(losses), stable=True)[:DESCENTS]
    moved = _descended(look, features, numbers[order])
    with torch.no_grad():
        loss = equation2(evidence, features, moved)
    for place in torch.argsort(loss, stable=True)[: max(_FEWEST_TOLD, look.config.top)].tolist():
        if math.isfinite(float(loss[place])):
            values = moved[place].tolist()
            lattice = Lattice(values[0], values[1], np.array([values[2:4], values[4:6]]), np.zeros(2))
            yield replace(lattice_guess(lattice, 1 / (1 + float(loss[place])), local=False), settled=True)


def equation2(evidence: Evidence, features: FeatureMap, numbers: Tensor) -> Tensor:
    """Equation 2 as printed, of lattices [B, 6] (rx, ry, u, v) that fill the picture: [B], differentiable.

    The sum of squared feature differences over all neighbouring draws that the picture shows. Infinite where
    it shows none.
    """
    size = evidence.image.size
    steps = torch.arange(-_REACH, _REACH + 1, dtype=torch.float64)
    i, j = torch.meshgrid(steps, steps, indexing="ij")
    u, v = numbers[:, None, None, 2:4], numbers[:, None, None, 4:6]
    plane = i[None, :, :, None] * u + j[None, :, :, None] * v
    matrix = (
        features.map_from_photo
        @ evidence.part.from_photo
        @ image_from_plane(numbers[:, 0], numbers[:, 1], size=size, focal_mm=evidence.focal_mm)
    )
    side = len(steps)
    points, front = project(matrix, plane.flatten(1, 2))
    points = points.float()
    known = (front & in_frame(points, features.size) & sample_valid(features.valid, points)).unflatten(
        1, (side, side)
    )
    values = sample(features.values, points).unflatten(1, (side, side))
    down = (values[:, 1:] - values[:, :-1]).square().sum(-1) * (known[:, 1:] & known[:, :-1])
    along = (values[:, :, 1:] - values[:, :, :-1]).square().sum(-1) * (known[:, :, 1:] & known[:, :, :-1])
    loss = down.sum((1, 2)) + along.sum((1, 2))
    pairs = (known[:, 1:] & known[:, :-1]).sum((1, 2)) * (known[:, :, 1:] & known[:, :, :-1]).sum((1, 2))
    return torch.where(pairs > 0, loss, torch.inf)


def _grid(generator: torch.Generator) -> Tensor:
    """A random share of the grid: rx, ry, u, v, [LOOKED_AT, 6]; no lattice too fine, coarse or flat."""
    most = round(_LONGEST / GRID)
    found: list[Tensor] = []
    while sum(map(len, found)) < LOOKED_AT:
        tilts = round(_MOST_TILT_DEG / GRID)
        camera = torch.randint(-tilts, tilts + 1, (LOOKED_AT, 2), generator=generator)
        lattice = torch.randint(-most, most + 1, (LOOKED_AT, 4), generator=generator)
        numbers = GRID * torch.cat([camera, lattice], 1).double()
        found.append(numbers[_allowed(numbers)])
    return torch.cat(found)[:LOOKED_AT]


def _allowed(numbers: Tensor) -> Tensor:
    u, v = numbers[:, 2:4], numbers[:, 4:6]
    lengths = torch.stack([u.norm(dim=1), v.norm(dim=1)])
    sine = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / lengths.prod(0).clamp(min=1e-9)
    inside = (lengths >= _SHORTEST).all(0) & (lengths <= _LONGEST).all(0)
    # One spelling of each lattice: v is turned clockwise from u, which points to the right.
    return inside & (sine > math.sin(math.radians(_LEAST_ANGLE_DEG))) & (u[:, 0] > 0)


def _descended(look: Session, features: FeatureMap, numbers: Tensor) -> Tensor:
    """The numbers [K, 6] after Adam on equation 2 alone, which rewards shrunk and blurred views."""
    first, second = torch.zeros_like(numbers), torch.zeros_like(numbers)
    with look.until_interrupted():
        for step in range(1, STEPS + 1):
            if not look.go_on():
                break
            look.tell("the paper's descent", 0.5 + 0.5 * step / STEPS)
            leaf = numbers.clone().requires_grad_()
            loss = equation2(look.evidence, features, leaf)
            (slope,) = torch.autograd.grad(loss[torch.isfinite(loss)].sum(), leaf)
            slope = torch.nan_to_num(slope)
            first = 0.9 * first + 0.1 * slope
            second = 0.999 * second + 0.001 * slope.square()
            move = (first / (1 - 0.9**step)) / ((second / (1 - 0.999**step)).sqrt() + 1e-8)
            after = numbers - RATE * move
            # Outside the grid's bounds the sum of nothing would be the least.
            tilted = after[:, :2].abs().amax(1) > _MOST_TILT_DEG
            numbers = torch.where((_allowed(after) & ~tilted)[:, None], after, numbers)
    return numbers

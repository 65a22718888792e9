"""From a proposal to a fit: refine on few cells, take in the neighbours that agree, refine again.

The mean of well-aligned cells predicts the next ones; a cell that it predicts better than at half steps is
part of the pattern. So a fit grows from where the pattern is plain to where it ends, and the pose gets
precise as the distances get long.
"""

import itertools

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.interp.camera import Camera
from p3i.interp.pattern import Pattern
from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.features import refine
from p3i.search.fit.fitted import SUPPORT, Fit
from p3i.search.fit.robust import fitted, step_limits
from p3i.search.forms.guess import Guess, tilted
from p3i.search.forms.lattice import PHASE, Lattice, cell_areas, cell_px, cells_in_view, map_from_index
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.cells import (
    HALF_STEPS,
    agreement,
    contrast,
    mean_cell,
    members,
    read_cells,
    sample_grid,
    sample_points,
)
from p3i.search.look.correlate import Instances, find_instances
from p3i.search.look.evidence import Evidence, Level
from p3i.search.look.patches import in_units_of_noise

# Growth looks this many cells beyond those that agree.
_REACH = 2
_ROUNDS = 9
# The tilts under which a proposal without one is tried.
_TILTS_DEG = (0.0, 35.0, 55.0)


def measure(level: Level, pattern: Pattern, theta: Tensor, *, start: Tensor | None = None) -> Fit | None:
    """How well theta explains the picture. `start` [M, 2] are cells that the mean starts from."""
    around = None if start is None else start.median(0).values
    index = cells_in_view(level, pattern, theta, around=around)
    if len(index) < FEWEST_OBJECTS:
        return None
    weights = torch.ones(len(index)) if start is None else members(index, start).float()
    if float(weights.sum()) < 3:
        return None
    found = contrast(level, pattern, theta, index, weights=weights, grid=sample_grid())
    return weighed(level, pattern, theta, index, found)


def weighed(level: Level, pattern: Pattern, theta: Tensor, index: Tensor, contrast: Tensor) -> Fit:
    """The fit of theta whose cells `index` [N, 2] have this contrast [N], with its score."""
    area, _ = cell_areas(map_from_index(level, pattern, theta), index, level)
    share = (area / (level.size.width * level.size.height)).float()
    score = float((share * (contrast - SUPPORT).clamp(min=0)).sum())
    filling = lattice_filling()
    return Fit(filling, filling.z_of(theta), level.focal_mm, 0.0, index, contrast, covered=score)


def grow(evidence: Evidence, guess: Guess) -> Fit | None:
    """Refine a guess and follow it as far as the pattern goes; None where there is nothing to follow."""
    pattern = guess.filling.pattern
    start = _local_seed(evidence, pattern, guess) if guess.local else _seed(evidence, pattern, guess)
    if start is None:
        return None
    theta, cells, weights = start
    level = evidence.level_for(side_of_cell(evidence, pattern, theta))
    theta = refine(level, pattern, theta, index=cells, weights=weights, fixed=PHASE)
    return follow(evidence, pattern, theta, cells)


def follow(
    evidence: Evidence, pattern: Pattern, theta: Tensor, selected: Tensor, *, finest: bool = False
) -> Fit | None:
    """Find the instances around cells `selected` [N, 2], fit theta [P] to them, take in more; repeat."""
    best: Fit | None = None
    previous: set[tuple[float, ...]] = set()
    for turn in range(_ROUNDS):
        if not sane(pattern, theta):
            break
        level = evidence.level_for(side_of_cell(evidence, pattern, theta), finest=finest)
        fit = measure(level, pattern, theta, start=selected)
        if fit is None:
            break
        if best is None or fit.covered > best.covered:
            best = fit
        selected, weights = _grown(fit, selected)
        now = {tuple(cell) for cell in selected.tolist()}
        if len(now) < FEWEST_OBJECTS or (turn >= 2 and len(now ^ previous) <= 0.04 * len(now)):
            break
        previous = now
        found = find_instances(level, pattern, theta, selected, weights)
        if int((found.certainty > 0).sum()) < FEWEST_OBJECTS:
            break
        theta = on_instances(level, pattern, theta, found)
    return best


def on_instances(level: Level, pattern: Pattern, theta: Tensor, found: Instances) -> Tensor:
    """Theta [P] moved so that the program's points fall on the instances.

    Offsets are compared in index units, so that near and far objects count alike.
    """
    half = 0.25 * torch.eye(2, dtype=torch.float64)
    ends = (found.index[:, None, None] + torch.stack([half, -half])).reshape(-1, 2)
    ahead, behind = sample_points(level, pattern, theta, ends)[0].reshape(-1, 2, 2, 2).unbind(1)
    return fitted(
        lambda numbers: sample_points(level, pattern, numbers, found.index)[0],
        theta,
        places=sample_points(level, pattern, theta, found.index + found.offsets)[0],
        whiten=in_units_of_noise(2 * (ahead - behind).mT),
        weights=found.certainty.double(),
        limits=step_limits(pattern, theta),
    ).numbers


def _seed(evidence: Evidence, pattern: Pattern, guess: Guess) -> tuple[Tensor, Tensor, Tensor] | None:
    """Where to start: theta, cells [N, 2] and their weights [N]."""
    theta = guess.lattice.reduced().theta(pattern)
    level = evidence.level_for(side_of_cell(evidence, pattern, theta))
    index = cells_in_view(level, pattern, theta)
    if len(index) < FEWEST_OBJECTS:
        return None
    support = _smoothed(index, _neighbour_contrast(level, pattern, theta, index).clamp(min=0))
    if float(support.sum()) <= 0:
        return None
    middle = index[int(_smoothed(index, support).argmax())]
    theta = Lattice.of(pattern, theta).moved_to(middle.numpy()).theta(pattern)
    near = (index - middle).abs().amax(1) <= 2
    return theta, (index - middle)[near], support[near].clamp(min=1e-3)


def _local_seed(evidence: Evidence, pattern: Pattern, guess: Guess) -> tuple[Tensor, Tensor, Tensor] | None:
    """The tilt under which the neighbourhood of a local proposal agrees best, and its middle cells."""
    flat = guess.lattice.theta(pattern)
    level = evidence.level_for(side_of_cell(evidence, pattern, flat))
    steps = torch.arange(-3, 4, dtype=torch.float64)
    index = torch.cartesian_prod(steps, steps)
    near = index.abs().amax(1) <= 1
    grid = sample_grid()
    best: tuple[float, Tensor] | None = None
    for rx_deg, ry_deg in _tilts():
        seen = tilted(guess, rx_deg=rx_deg, ry_deg=ry_deg, focal_mm=evidence.focal_mm, size=level.photo_size)
        theta = seen.lattice.theta(pattern)
        cells = read_cells(level, pattern, theta, index, grid)
        mean, _ = mean_cell(cells, torch.ones(len(index)))
        # The spread of the cells around their mean: small where the whole neighbourhood lies in step.
        share = (mean.square().sum(-1) / _mean_energy(cells.values, cells.known)).mean()
        if best is None or float(share) > best[0]:
            best = float(share), theta
    return None if best is None else (best[1], index[near], torch.ones(int(near.sum())))


def _tilts() -> list[tuple[float, float]]:
    """Poses around the frontal one: each tilt of _TILTS_DEG in eight directions."""
    poses = []
    for tilt, around in itertools.product(_TILTS_DEG, range(8)):
        if tilt == 0 and around:
            continue
        sine, cosine = np.sin(np.radians(tilt)), np.cos(np.radians(tilt))
        turn = np.radians(45.0 * around)
        camera = Camera.from_normal((sine * np.cos(turn), sine * np.sin(turn), cosine))
        poses.append((camera.rx_deg, camera.ry_deg))
    return poses


def _mean_energy(values: Tensor, known: Tensor) -> Tensor:
    """Mean of |F|^2 over the cells: [N, K, C], [N, K] -> [K]."""
    total = known.float().sum(0).clamp(min=1)
    return ((values.square().sum(-1) * known).sum(0) / total).clamp(min=1e-6)


def _neighbour_contrast(level: Level, pattern: Pattern, theta: Tensor, index: Tensor) -> Tensor:
    """Agreement of each cell with its four neighbours less that with its half steps, [N]: needs no mean."""
    grid = sample_grid()
    cells = read_cells(level, pattern, theta, index, grid)

    def towards(step: Tensor) -> Tensor:
        both = []
        for sign in (1, -1):
            other = read_cells(level, pattern, theta, index + sign * step, grid)
            shared = cells.known & other.known
            enough = shared.float().mean(1) > 0.5
            both.append(torch.where(enough, agreement(cells.values, other.values, shared), torch.nan))
        return torch.stack(both).nanmean(0).nan_to_num(0.0)

    whole = torch.stack([towards(step) for step in torch.eye(2, dtype=torch.float64)]).mean(0)
    half = torch.stack([towards(step) for step in HALF_STEPS]).amax(0)
    return whole - half.clamp(min=0)


def _grown(fit: Fit, selected: Tensor) -> tuple[Tensor, Tensor]:
    """The cells for the next round: those that agree and hang together with the present ones, and a rim.

    With how much each says of what all are like.
    """
    index = fit.index.numpy().astype(int)
    low = index.min(0) - _REACH - 1
    shape = tuple(index.max(0) - low + _REACH + 2)

    def mask(rows: np.ndarray) -> np.ndarray:
        plane = np.zeros(shape, np.uint8)
        rows = rows[((rows >= low) & (rows < low + np.array(shape))).all(1)]
        plane[tuple((rows - low).T)] = 1
        return plane

    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))

    def wider(plane: np.ndarray) -> np.ndarray:
        return cv2.dilate(plane, cross, iterations=_REACH)

    agreeing = mask(index[fit.contrast.numpy() > SUPPORT])
    kept = agreeing & wider(mask(selected.numpy().astype(int)))
    wanted = kept | wider(kept)
    chosen = torch.from_numpy(wanted[tuple((index - low).T)].astype(bool))
    contrast = fit.contrast[chosen]
    return fit.index[chosen], torch.where(contrast > SUPPORT, contrast, 0.0)


def _smoothed(index: Tensor, values: Tensor) -> Tensor:
    """Each cell's value averaged with its four neighbours'; what lies outside counts as 0."""
    whole = index.numpy().astype(int)
    low = whole.min(0) - 1
    plane = np.zeros(tuple(whole.max(0) - low + 2), np.float32)
    plane[tuple((whole - low).T)] = values.numpy()
    kernel = np.array([[0, 1, 0], [1, 2, 1], [0, 1, 0]], np.float32) / 6
    mean = cv2.filter2D(plane, -1, kernel, borderType=cv2.BORDER_CONSTANT)
    return torch.from_numpy(mean[tuple((whole - low).T)])


def side_of_cell(evidence: Evidence, pattern: Pattern, theta: Tensor) -> float:
    """The side of the cell at the origin under theta [P], in photo pixels."""
    return cell_px(evidence.frame, pattern, theta)


def sane(pattern: Pattern, theta: Tensor) -> bool:
    """Whether theta [P] still means a lattice seen by a camera."""
    if not bool(torch.isfinite(theta).all()):
        return False
    lattice = Lattice.of(pattern, theta)
    return max(abs(lattice.rx_deg), abs(lattice.ry_deg)) < 85 and lattice.cell_area > 1e-3

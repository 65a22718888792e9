"""All cells of a photo side by side: what they share, and how light and place change smoothly over the photo.

Each cell is read on one grid, by the program's own moves. The common cell is their median; each cell tells
its light against it (a level and a contrast for each channel) and how far the program is off there. Both
are smooth over the photo, so that cells which show nothing of themselves have them too, told by all that do.

Convention: program units on the plane of one cell, the `reference`; colours RGB in 0..1; M objects, G
places of the grid.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.field import Field, field_of
from p3i.place.moves import moves
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed
from p3i.vision.sheet import Box, project, sampled

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Samples along the side of the grid, and so many in all.
_SIDES = (10, 28)
_SAMPLES = 1_500_000
# Cells are surveyed from so many on; the common cell is the median of so many at most.
_FEWEST = 3
_MOST_COMMON = 150
# A cell tells of its light and place where this share of it is seen.
_LEAST_SEEN = 0.25
# So many places of a cell tell how alike cells are, and so many cells over which widths, in steps, they are.
_TOLD, _JUDGED = 200, 200
_WIDTHS = (0.6, 1.2, 2.4, 5.0, 20.0)
# Light does not change within so many steps: what does is the objects' own colour.
_LIGHT = 3.0
# Contrast is drawn towards 1 as if by this variance: flat cells say nothing of it.
_PRIOR_VARIANCE = 1e-3
# Residuals of this size count half in finding a place; neighbouring samples tell the same: one in so many
# counts.
_ROBUST = 0.02
_ALIKE = 9.0
# Cells are off by no more than this share of the cell's shorter side.
_MOST_OFF = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """The cells: `seen` [M] in shares; `lit` [M, P, 3] is each in the common light, `shown` [M, P] where it
    is known.

    `levels`, `contrasts` [M, 3] are the light there by its field, `offs` [M, 2] the shift, on the
    reference's plane; `own_offs` [M, 2] are each cell's own, drawn to the field by how surely it tells;
    `turns` [M, 2, 2] bring the reference's plane to that of each. `places` [M, 2] lie on the plane. Cells
    at `at` [M, 2], in steps of the program, are alike over the `widths` [2]; they lie off their field by
    `likely_off`, in distances to the next object.
    """

    places: Array
    seen: Array
    lit: Floats
    shown: Mask
    at: Array
    widths: Array
    likely_off: float
    levels: Array
    contrasts: Array
    offs: Array
    own_offs: Array
    turns: Array

    def between(self, target: int, source: int) -> Array:
        """How much more the program is off at a source than at the target: [2] on the target's plane."""
        return self.turns[target] @ (self.own_offs[source] - self.own_offs[target])

    def misfits(self, target: int) -> Array:
        """How much each cell [M] differs from what the target is to be expected to show; inf where unseen.

        That is the target itself where it is known, else what the cells near it show.
        """
        apart = (self.at - self.at[target]) / self.widths
        near = np.exp(-0.5 * (apart**2).sum(1)).astype(np.float32)
        near[target] = 0
        expected = _mean_of(self.lit, self.shown, near[None])[0]
        own = self.shown[target]
        expected[own] = self.lit[target, own]
        off = np.abs(self.lit - expected).mean(2) * self.shown
        found = off.sum(1) / np.maximum(self.shown.sum(1), 1)
        return np.where(self.seen >= _LEAST_SEEN, found, np.inf)

    def light(self, target: int, source: int) -> tuple[Array, Array]:
        """The gain and offset [3] that bring a source's colours into the light of the target."""
        gain = self.contrasts[target] / self.contrasts[source]
        return gain, self.levels[target] - gain * self.levels[source]


def survey_of(pixels: Floats, known: Mask, placed: Placed) -> Survey | None:
    """The survey of what is known of a photo [H, W, 3]; None with too few objects."""
    at_px, front = placed.centers_px()
    if int((front & placed.in_sight()).sum()) < _FEWEST:
        return None
    count = len(placed.points)
    reference = int(
        np.argmin(np.where(placed.in_sight(), np.hypot(*(at_px - np.median(at_px[front], 0)).T), np.inf))
    )
    corners = polygons(chart_of(placed.pattern), placed.index[reference : reference + 1])[0]
    low, high = corners.min(0), corners.max(0)
    side = int(np.clip(np.sqrt(_SAMPLES / count), *_SIDES))
    steps = (np.arange(side) + 0.5) / side
    grid = np.stack(np.meshgrid(low[0] + steps * (high[0] - low[0]), low[1] + steps * (high[1] - low[1])), -1)
    inside = np.zeros((side, side), np.uint8)
    on_grid = (corners - low) / (high - low) * side - 0.5
    cv2.fillPoly(inside, [np.rint(on_grid * 16).astype(np.int32)], 1, shift=4)
    plane_moves = moves(placed, reference)
    usable = np.isfinite(plane_moves).all((1, 2))
    plane_moves[~usable] = 0

    def read(offs: Array) -> tuple[Floats, Mask]:
        points = grid[None] + offs[:, None, None]
        points = (
            np.einsum("mij,mrcj->mrci", plane_moves[:, :2, :2], points) + plane_moves[:, None, None, :2, 2]
        )
        at, ahead = project(placed.image_from_plane, points)
        spacing = np.maximum(*(np.linalg.norm(np.gradient(at, axis=axis), axis=-1) for axis in (1, 2)))
        flat = (count * side, side)
        found = sampled(
            pixels, known, at.reshape(*flat, 2), ahead.reshape(flat), spacing.reshape(flat),
            box=Box(0, 1, 0, 1), side=side,
        )  # fmt: skip
        seen = found.seen.reshape(count, side, side) & (inside > 0) & np.asarray(usable)[:, None, None]
        return found.values.transpose(1, 2, 0).reshape(count, side, side, 3), seen

    offs, most = np.zeros((count, 2)), _MOST_OFF * float((high - low).min())
    share, telling = np.zeros(count), np.zeros(count, bool)
    step = (high - low) / side
    information = np.zeros((count, 2, 2))
    levels, contrasts, misfit = np.zeros((count, 3)), np.ones((count, 3)), np.full(count, np.inf)
    variance, seen = np.zeros((count, 3)), np.zeros((count, side, side), bool)
    colours, middle = np.zeros((count, side, side, 3), np.float32), np.zeros(3)
    for _ in range(2):
        colours, seen = read(offs)
        share = seen.sum((1, 2)) / max(int(inside.sum()), 1)
        telling = share >= _LEAST_SEEN
        if telling.sum() < _FEWEST:
            return None
        weights = seen.astype(np.float32)
        common = _common(colours, seen, share, None)
        for _ in range(2):
            levels, contrasts, variance = _light(colours, weights, common)
            common = _common(colours, seen, share, (levels, contrasts, common[inside > 0].mean(0)))
        middle = common[inside > 0].mean(0)
        levels, contrasts, variance = _light(colours, weights, common)
        lit = (colours - levels[:, None, None]) / contrasts[:, None, None] + middle
        residual = (common - lit) * weights[..., None]
        misfit = np.abs(residual).sum((1, 2, 3)) / np.maximum(3 * weights.sum((1, 2)), 1)
        slopes = [np.gradient(common, axis=axis) / width for axis, width in ((1, step[0]), (0, step[1]))]
        found, information = _steps(slopes, residual, weights)
        offs = np.clip(offs + np.where(telling[:, None], found, 0), -most, most)
    information[~telling] = 0
    basis = placed.basis
    at = (
        placed.index.astype(float)
        if basis is not None
        else placed.points / _spacing(placed.points, reference)
    )
    spacing = _spacing(placed.points, reference)
    off = field_of(placed.points, offs, information, towards=np.zeros(2), spacing=spacing)
    smooth_offs = np.clip(off.at(placed.points), -most, most)
    # Each cell's own shift is drawn to the field's by what it tells, as if cells lay about it by what they
    # were found to.
    spread = np.median(np.abs(offs - smooth_offs)[telling], 0) * 1.48 + 1e-9
    prior = np.diag(1 / spread**2)
    own = np.linalg.solve(
        information + prior,
        np.einsum("mij,mj->mi", information, offs)[:, :, None] + (smooth_offs @ prior)[:, :, None],
    )[:, :, 0]
    surely = np.where(telling, share / np.maximum(misfit, 1e-3) ** 2, 0)
    level = _told(placed.points, levels, surely[:, None] * np.ones(3), middle, spacing)
    contrast = _told(placed.points, contrasts, surely[:, None] * variance, np.ones(3), spacing)
    level_at, contrast_at = level.at(placed.points), np.clip(contrast.at(placed.points), 0.25, 4)
    told_at = np.argwhere(inside > 0)
    told_at = told_at[:: max(1, len(told_at) // _TOLD)].T
    shown = seen[:, *told_at]
    # In the light of the field, not in its own: what an object's colour differs by is its own.
    few = ((colours[:, *told_at] - level_at[:, None]) / contrast_at[:, None] + middle).astype(np.float32)
    return Survey(
        placed.points,
        share,
        few,
        shown,
        at,
        _widths(few, shown, at, np.flatnonzero(telling), together=basis is None),
        float(np.hypot(*spread)) / spacing,
        level_at,
        contrast_at,
        smooth_offs,
        own,
        plane_moves[:, :2, :2],
    )


def _widths(lit: Floats, shown: Mask, at: Array, telling: NDArray, *, together: bool) -> Array:
    """The widths [2] under which the cells near each tell best what it shows, left out itself."""
    telling = telling[np.linspace(0, len(telling) - 1, min(len(telling), _JUDGED)).astype(int)]
    lit, shown = lit[telling, ::2], shown[telling, ::2]
    squares = (at[telling][:, None] - at[telling][None]) ** 2
    tried = [(i, j) for i in _WIDTHS for j in _WIDTHS if i == j or not together]
    wrong = []
    for widths in tried:
        near = np.exp(-0.5 * (squares / np.square(widths)).sum(2)).astype(np.float32)
        np.fill_diagonal(near, 0)
        off = np.abs(_mean_of(lit, shown, near) - lit).mean(2)
        wrong.append(float(off[shown].mean()))
    return np.array(tried[int(np.argmin(wrong))])


def _mean_of(lit: Floats, shown: Mask, near: Floats) -> Floats:
    """The means [K, P, 3] of what cells show [M, P, 3], weighed by how near they are, [K, M]."""
    # What no near cell shows, all do.
    near = near + np.float32(1e-6)
    weight = near @ shown.astype(np.float32)
    total = near @ (lit * shown[..., None]).reshape(len(lit), -1)
    return (total.reshape(len(near), -1, 3) / np.maximum(weight, 1e-9)[..., None]).astype(np.float32)


def _told(places: Array, values: Array, surely: Array, towards: Array, spacing: float) -> Field:
    information = surely[:, :, None] * np.eye(values.shape[1])
    return field_of(places, values, information, towards=towards, spacing=spacing, finest=_LIGHT)


def _spacing(points: Array, number: int) -> float:
    apart = np.hypot(*(points - points[number]).T)
    others = apart[apart > 1e-6]
    return float(others.min()) if len(others) else 1.0


def _common(colours: Floats, seen: Mask, share: Array, light: tuple[Array, Array, Array] | None) -> Floats:
    """The median [side, side, 3] of the cells that are seen best, in one light."""
    best = np.argsort(-share, kind="stable")[:_MOST_COMMON]
    best = best[share[best] >= min(_LEAST_SEEN, float(share[best[0]]))]
    values = colours[best].astype(np.float32)
    if light is not None:
        levels, contrasts, middle = light
        values = (values - levels[best][:, None, None]) / contrasts[best][:, None, None] + middle
    values = np.ma.masked_array(values, np.repeat(~seen[best][..., None], 3, axis=3))
    found = np.ma.median(values, axis=0)
    mean = np.ma.mean(found, axis=(0, 1)).filled(0.5)
    return np.where(np.ma.getmaskarray(found), mean, found.filled(0)).astype(np.float32)


def _light(colours: Floats, weights: Floats, common: Floats) -> tuple[Array, Array, Array]:
    """The level and contrast [M, 3] of cells against the common one, and the variance that tells of it."""
    inside = weights[..., None] / np.maximum(weights.sum((1, 2)), 1)[:, None, None, None]
    mean, wanted = (inside * colours).sum((1, 2)), (inside * common).sum((1, 2))
    around = common - wanted[:, None, None]
    variance = (inside * around**2).sum((1, 2))
    together = (inside * around * (colours - mean[:, None, None])).sum((1, 2))
    contrast = np.clip((together + _PRIOR_VARIANCE) / (variance + _PRIOR_VARIANCE), 0.25, 4)
    # What is seen of a cell has a mean of its own: the level is where the common cell's middle would lie.
    whole = common.mean((0, 1))
    return (mean + contrast * (whole - wanted)).astype(float), contrast.astype(float), variance.astype(float)


def _steps(slopes: list[NDArray], residual: NDArray, weights: NDArray) -> tuple[Array, Array]:
    """The step [M, 2] of each cell's place that lessens its residual [M, side, side, 3]; its information."""
    robust = weights[..., None] / (np.abs(residual) + _ROBUST)
    normal = np.array([[(robust * one * other).sum((1, 2, 3)) for other in slopes] for one in slopes])
    normal = normal.transpose(2, 0, 1).astype(float)
    told = np.stack([(robust * one * residual).sum((1, 2, 3)) for one in slopes], 1).astype(float)
    size = np.trace(normal, axis1=1, axis2=2)
    ridged = normal + (1e-3 * size + 1e-6)[:, None, None] * np.eye(2)
    found = np.linalg.solve(ridged, told[:, :, None])[:, :, 0]
    scale = np.sqrt(
        (weights[..., None] * residual**2).sum((1, 2, 3)) / np.maximum(3 * weights.sum((1, 2)), 1)
    )
    return found, normal / (_ALIKE * 3 * np.maximum(scale, 1e-3))[:, None, None]

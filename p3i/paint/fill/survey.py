"""All cells of a photo side by side: what they share, and how light and place change smoothly over the photo.

Each cell is read on one grid, by the program's own moves. Against the common cell of its kind (kinds.py) each
tells its light (beside.py) and how far the program is off there. Both are smooth over the photo, so that
cells which show nothing of themselves have them too, told by all that do.

Convention: program units on the plane of one cell, the `reference`; colours RGB in 0..1; M objects, G
places of the grid.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.beside import FEWEST, LEAST_SEEN, side_by_side
from p3i.paint.fill.field import field_of
from p3i.paint.fill.kinds import kinds_of, turns_of
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
# So many places of a cell tell how alike cells are, and so many cells over which widths, in steps, they are.
_TOLD, _JUDGED = 200, 200
_WIDTHS = (0.6, 1.2, 2.4, 5.0, 20.0)
# Cells of another kind count so little beside those of the same.
_OTHER_KIND = 1e-4
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

    `kinds` [M] number the kinds of cell that take turns.
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
    kinds: NDArray[np.int64]
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
        near *= _of_one_kind(self.kinds, self.kinds[target])
        near[target] = 0
        expected = _mean_of(self.lit, self.shown, near[None])[0]
        own = self.shown[target]
        expected[own] = self.lit[target, own]
        off = np.abs(self.lit - expected).mean(2) * self.shown
        found = off.sum(1) / np.maximum(self.shown.sum(1), 1)
        return np.where(self.seen >= LEAST_SEEN, found, np.inf)

    def light(self, target: int, source: int) -> tuple[Array, Array]:
        """The gain and offset [3] that bring a source's colours into the light of the target."""
        gain = self.contrasts[target] / self.contrasts[source]
        return gain, self.levels[target] - gain * self.levels[source]


def survey_of(pixels: Floats, known: Mask, placed: Placed) -> Survey | None:
    """The survey of what is known of a photo [H, W, 3]; None with too few objects."""
    at_px, front = placed.centers_px()
    if int((front & placed.in_sight()).sum()) < FEWEST:
        return None
    reference = int(
        np.argmin(np.where(placed.in_sight(), np.hypot(*(at_px - np.median(at_px[front], 0)).T), np.inf))
    )
    grid = _Grid.of(placed, reference)
    spacing = _spacing(placed.points, reference)
    basis = placed.basis
    at = placed.index.astype(float) if basis is not None else placed.points / spacing
    together = basis is None
    told_at = np.argwhere(grid.inside)
    told_at = told_at[:: max(1, len(told_at) // _TOLD)].T

    colours, seen = grid.read(pixels, known, placed, None)
    kinds = np.zeros(len(placed.points), np.int64)
    cells = side_by_side(colours, seen, grid.inside, kinds)
    if cells is None:
        return None
    _, _, few = cells.lit(placed.points, spacing, colours[:, *told_at])
    shown = seen[:, *told_at]
    telling = np.flatnonzero(cells.telling)
    kinds = _kinds(placed, few, shown, at, telling, together=together)
    offs = np.zeros((len(placed.points), 2))
    information = np.zeros((len(placed.points), 2, 2))
    for turn in range(2):
        if turn:
            colours, seen = grid.read(pixels, known, placed, offs)
        if turn or kinds.any():
            cells = side_by_side(colours, seen, grid.inside, kinds)
            if cells is None:
                return None
        steps, information = _steps(
            grid.slopes(cells.commons), kinds, cells.residual(colours, seen), seen.astype(np.float32)
        )
        offs = np.clip(offs + np.where(cells.telling[:, None], steps, 0), -grid.most_off, grid.most_off)
    information[~cells.telling] = 0
    off = field_of(placed.points, offs, information, towards=np.zeros(2), spacing=spacing)
    smooth_offs = np.clip(off.at(placed.points), -grid.most_off, grid.most_off)
    # Each cell's own shift is drawn to the field's by what it tells, as if cells lay about it by what they
    # were found to.
    spread = np.median(np.abs(offs - smooth_offs)[cells.telling], 0) * 1.48 + 1e-9
    prior = np.diag(1 / spread**2)
    own = np.linalg.solve(
        information + prior,
        np.einsum("mij,mj->mi", information, offs)[:, :, None] + (smooth_offs @ prior)[:, :, None],
    )[:, :, 0]
    levels, contrasts, few = cells.lit(placed.points, spacing, colours[:, *told_at])
    shown = seen[:, *told_at]
    telling = np.flatnonzero(cells.telling)
    widths, _ = _widths(few, shown, at, kinds, telling, together=together)
    return Survey(
        placed.points,
        cells.share,
        few,
        shown,
        kinds,
        at,
        widths,
        float(np.hypot(*spread)) / spacing,
        levels,
        contrasts,
        smooth_offs,
        own,
        grid.moves[:, :2, :2],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """The `places` [side, side, 2] read of the reference's cell, which lie `inside` it, `step` [2] apart.

    `moves` [M, 3, 3] lay it on each cell, where that is `usable` [M]; cells are off by `most_off` at most.
    """

    places: Array
    inside: Mask
    step: Array
    moves: Array
    usable: Mask
    most_off: float

    @classmethod
    def of(cls, placed: Placed, reference: int) -> "_Grid":
        corners = polygons(chart_of(placed.pattern), placed.index[reference : reference + 1])[0]
        low, high = corners.min(0), corners.max(0)
        side = int(np.clip(np.sqrt(_SAMPLES / len(placed.points)), *_SIDES))
        along = (np.arange(side) + 0.5) / side
        places = np.stack(
            np.meshgrid(low[0] + along * (high[0] - low[0]), low[1] + along * (high[1] - low[1])), -1
        )
        inside = np.zeros((side, side), np.uint8)
        on_grid = (corners - low) / (high - low) * side - 0.5
        cv2.fillPoly(inside, [np.rint(on_grid * 16).astype(np.int32)], 1, shift=4)
        plane_moves = moves(placed, reference)
        usable = np.isfinite(plane_moves).all((1, 2))
        plane_moves[~usable] = 0
        most_off = _MOST_OFF * float((high - low).min())
        return cls(places, inside > 0, (high - low) / side, plane_moves, np.asarray(usable), most_off)

    def read(self, pixels: Floats, known: Mask, placed: Placed, offs: Array | None) -> tuple[Floats, Mask]:
        """The colours [M, side, side, 3] of all cells, off by `offs` [M, 2], and what is seen of them."""
        points = self.places[None] if offs is None else self.places[None] + offs[:, None, None]
        points = np.matmul(points, self.moves[:, None, :2, :2].transpose(0, 1, 3, 2))
        points = points + self.moves[:, None, None, :2, 2]
        at, ahead = project(placed.image_from_plane, points)
        spacing = np.maximum(*(np.linalg.norm(np.gradient(at, axis=axis), axis=-1) for axis in (1, 2)))
        count, side = len(self.moves), len(self.inside)
        flat = (count * side, side)
        found = sampled(
            pixels, known, at.reshape(*flat, 2), ahead.reshape(flat), spacing.reshape(flat),
            box=Box(0, 1, 0, 1), side=side,
        )  # fmt: skip
        seen = found.seen.reshape(count, side, side) & self.inside & self.usable[:, None, None]
        return found.values.transpose(1, 2, 0).reshape(count, side, side, 3), seen

    def slopes(self, commons: Floats) -> tuple[Floats, Floats]:
        """The slopes along x and y of common cells [N, side, side, 3]."""
        x, y = (
            np.gradient(commons, axis=axis) / width for axis, width in ((2, self.step[0]), (1, self.step[1]))
        )
        return x.astype(np.float32), y.astype(np.float32)


def _kinds(
    placed: Placed, lit: Floats, shown: Mask, at: Array, telling: NDArray[np.int64], *, together: bool
) -> NDArray[np.int64]:
    """The kinds [M] of the cells, where those of one kind near a cell tell it better than all near it do."""
    one = np.zeros(len(lit), np.int64)
    kinds = kinds_of(placed.index, lit[:, ::2], shown[:, ::2], telling, turns=turns_of(placed))
    if not kinds.any():
        return one
    off = [_widths(lit, shown, at, each, telling, together=together)[1] for each in (one, kinds)]
    return kinds if off[1] < off[0] else one


def _widths(
    lit: Floats, shown: Mask, at: Array, kinds: NDArray[np.int64], telling: NDArray, *, together: bool
) -> tuple[Array, float]:
    """The widths [2] under which the cells of its kind near each tell best what it shows, left out itself.

    And what they are off by then.
    """
    telling = telling[np.linspace(0, len(telling) - 1, min(len(telling), _JUDGED)).astype(int)]
    lit, shown, kinds = lit[telling, ::2], shown[telling, ::2], kinds[telling]
    alike = _of_one_kind(kinds[:, None], kinds[None])
    squares = (at[telling][:, None] - at[telling][None]) ** 2
    tried = [(i, j) for i in _WIDTHS for j in _WIDTHS if i == j or not together]
    wrong = []
    for widths in tried:
        near = np.exp(-0.5 * (squares / np.square(widths)).sum(2)).astype(np.float32) * alike
        np.fill_diagonal(near, 0)
        off = np.abs(_mean_of(lit, shown, near) - lit).mean(2)
        wrong.append(float(off[shown].mean()))
    best = int(np.argmin(wrong))
    return np.array(tried[best]), wrong[best]


def _of_one_kind(kinds: NDArray[np.int64], others: NDArray[np.int64]) -> Floats:
    """How much cells tell of each other: those of another kind only what none of the same does."""
    return np.where(kinds == others, np.float32(1), np.float32(_OTHER_KIND))


def _mean_of(lit: Floats, shown: Mask, near: Floats) -> Floats:
    """The means [K, P, 3] of what cells show [M, P, 3], weighed by how near they are, [K, M]."""
    # What no near cell shows, all do.
    near = near + np.float32(1e-6)
    weight = near @ shown.astype(np.float32)
    total = near @ (lit * shown[..., None]).reshape(len(lit), -1)
    return (total.reshape(len(near), -1, 3) / np.maximum(weight, 1e-9)[..., None]).astype(np.float32)


def _spacing(points: Array, number: int) -> float:
    apart = np.hypot(*(points - points[number]).T)
    others = apart[apart > 1e-6]
    return float(others.min()) if len(others) else 1.0


def _steps(
    slopes: tuple[Floats, Floats], kinds: NDArray[np.int64], residual: NDArray, weights: NDArray
) -> tuple[Array, Array]:
    """The step [M, 2] of each cell's place that lessens its residual [M, side, side, 3]; its information.

    `slopes` are those of the common cell of each kind, [N, side, side, 3] along x and along y.
    """
    slopes = (slopes[0][kinds], slopes[1][kinds])
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

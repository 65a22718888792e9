"""Which cells of a sheet look alike: the common cell, a second kind, and how well each cell agrees with them.

A first guess of where the pattern is comes from comparing the sheet with itself one period on, less half a
period on; the cells there give a mean cell, agreement with it gives better weights, and so on. Works at any
phase. Cells and sheets as in p3i.vision.cells and p3i.vision.sheet; arrays in, arrays out.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.cells import COLOUR, GRADIENT, agreement, cut, sheet_features, weighted_mean
from p3i.vision.sheet import Sheet

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_ROUNDS = 6
_LEAST_SECOND, _SECOND_SHARE = 5, 0.08  # cells of a second kind: at least so many, and of the first's number
_PLAIN = 0.004  # standard deviation of the colours, of 1: below it there is nothing to see
_LEAST_ENERGY = 0.5  # of a second kind's texture, as a share of the first's: an empty place is no kind
_LEAST_LEVEL = 0.45  # agreement of a second kind's cells with their mean


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of cell: its mean features [C, side, side], and how far each cell [N] is of it, 0..1."""

    template: Floats
    weights: Floats


@dataclass(frozen=True, slots=True)
class Alike:
    """The cells of a sheet and what they share, one entry a cell of `sheet.box`, row by row.

    `features` [C, H, W] of the sheet and where they are `known` [H, W]; the same cut into `cells`
    [N, C, side, side] and `cells_known` [N, side, side]. `template` [C, side, side] is the mean feature cell,
    `weights` [N] in 0..1 how far each cell is taken for a part of the pattern, `level` the agreement of a
    typical one with the template. `second` is the other kind of cell that the pattern holds, if it does
    (stones on a board's lines). `colour_share` in 0..1 says how well colours repeat (0 where neighbours swap
    them, as on a chessboard read square by square).
    """

    sheet: Sheet
    features: Floats
    known: Mask
    cells: Floats
    cells_known: Mask
    template: Floats
    weights: Floats
    level: float
    second: Kind | None
    colour_share: float

    @property
    def visible(self) -> Floats:
        """The share of each cell [N] that is known."""
        return self.cells_known.mean(axis=(1, 2), dtype=np.float32)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """The one or two kinds of cell, the common one first."""
        first = Kind(self.template, self.weights)
        return (first,) if self.second is None else (first, self.second)


def alike_in(sheet: Sheet, likely: Floats | None = None) -> Alike | None:
    """What the cells of a sheet share; None where there is nothing to see.

    `likely` [N] in 0..1 says where the pattern is thought to be; it may be rough.
    """
    side, box = sheet.side, sheet.box
    features, known = sheet_features(sheet)
    if not known.any() or float(sheet.values[:, known].std(axis=1).max()) < _PLAIN:
        return None
    by_gradient, gradient_level = _self_agreement(features[GRADIENT], known, side)
    by_colour, colour_level = _self_agreement(features[COLOUR], known, side)
    repeats = np.maximum(by_gradient, by_colour)
    where = np.clip(repeats - 0.1, 0, None) * known
    total = max(float(where.sum()), 1e-6)
    gradient_share = float(np.clip((where * gradient_level).sum() / total, 0.2, 1))
    colour_share = float(np.clip((where * colour_level).sum() / total, 0, 1))
    features[GRADIENT] *= np.sqrt(gradient_share)
    features[COLOUR] *= np.sqrt(colour_share)
    cells, cells_known = cut(features, side), cut(known, side)
    middle = repeats[side // 2 :: side, side // 2 :: side].ravel()
    weights = np.clip(middle - 0.05, 0, 1).astype(np.float32) ** 2
    where = np.ones(len(cells), np.float32) if likely is None else likely
    grid = (box.rows, box.columns)
    template, fit, weights, level = _agreed_cell(cells, cells_known, weights, where.reshape(grid))
    second = _second_kind(cells, cells_known, weights, fit / max(level, 1e-6), (box.rows, box.columns))
    return Alike(sheet, features, known, cells, cells_known, template, weights, level, second, colour_share)


def _agreed_cell(
    cells: Floats, known: Mask, weights: Floats, where: Floats
) -> tuple[Floats, Floats, Floats, float]:
    """Mean cell and weights that explain each other: template, fit, weights, level; cells [N, C, n, n].

    The mean is of the cells `where` [rows, columns] the pattern is thought to be, in 0..1, and of what grows
    from there, next to next: elsewhere much may repeat that is another pattern, or a smooth ground's noise.
    """
    visible = known.mean(axis=(1, 2), dtype=np.float32)
    shown = visible > 0.3
    weights = weights * shown
    fit, level = np.zeros(len(cells), np.float32), 0.0
    sure = _trusted(weights, where)
    template = weighted_mean(cells, known, sure)
    for _ in range(_ROUNDS):
        fit = agreement(cells, known, template[None])[:, 0] * shown
        level = float((sure * fit).sum() / max(float(sure.sum()), 1e-6))
        if level <= 0:
            break
        weights = np.clip((fit / level - 0.4) / 0.6, 0, 1) * visible * shown
        near = cv2.blur(_trusted(weights, where).reshape(where.shape), (3, 3))
        where = np.maximum(where, np.clip(2 * near, 0, 1))
        sure = _trusted(weights, where)
        template = weighted_mean(cells, known, sure)
    return template, fit, weights, level


def _trusted(weights: Floats, where: Floats) -> Floats:
    """The weights [N] of cells as far as the pattern is thought to be there, `where` [rows, columns]."""
    return (weights * where.ravel()).astype(np.float32)


def _second_kind(
    cells: Floats, known: Mask, weights: Floats, score: Floats, grid: tuple[int, int]
) -> Kind | None:
    """Another kind of cell [N, C, n, n], alike among themselves, in gaps of the pattern, or None.

    Only cells with parts of the pattern on both sides of them, along a row or a column, may found it, so
    that the border of a board is not taken for a kind.
    """
    inside = between(weights.reshape(grid) > 0.5).ravel()
    gaps = np.flatnonzero(inside & (score < 0.4) & (known.mean(axis=(1, 2)) > 0.9))
    least = max(_LEAST_SECOND, _SECOND_SHARE * float(weights.sum()))
    if len(gaps) < least:
        return None
    gaps = gaps[np.linspace(0, len(gaps) - 1, min(len(gaps), 300)).astype(int)]
    # By gradient alone: stones are black and white.
    some, some_known = cells[gaps][:, GRADIENT], known[gaps]
    flat = some.reshape(len(gaps), -1)
    size = np.linalg.norm(flat, axis=1)
    near = (flat @ flat.T) / np.maximum(np.outer(size, size), 1e-6)
    seed = np.clip(near - 0.3, 0, None).sum(axis=1).argmax()
    chosen = np.clip(near[seed] - 0.3, 0, None).astype(np.float32)
    for _ in range(_ROUNDS):
        own = weighted_mean(some, some_known, chosen)
        fit = agreement(some, some_known, own[None])[:, 0].clip(0, None)
        level = float((chosen * fit).sum() / max(float(chosen.sum()), 1e-6))
        if level < _LEAST_LEVEL:
            return None
        chosen = np.clip((fit / level - 0.4) / 0.6, 0, 1)
    if chosen.sum() < least:
        return None
    template, all_weights = weighted_mean(cells[gaps], some_known, chosen), np.zeros(len(cells), np.float32)
    all_weights[gaps] = chosen
    common = weighted_mean(cells, known, weights)
    if (template[GRADIENT] ** 2).sum() < _LEAST_ENERGY * (common[GRADIENT] ** 2).sum():
        return None  # places that are alike because they are all empty
    return Kind(template, all_weights)


def between(passes: Mask) -> Mask:
    """Cells [H, W] with passes on both sides of them along their row or their column."""
    result = np.zeros_like(passes)
    for axis in (0, 1):
        before = np.cumsum(passes, axis=axis)
        after = np.flip(np.cumsum(np.flip(passes, axis), axis=axis), axis)
        result |= (before >= 2) & (after >= 2)
    return result


def _self_agreement(values: Floats, known: Mask, side: int) -> tuple[Floats, Floats]:
    """Agreement of a sheet [C, H, W] with itself one period on less half a period on, and the former alone.

    Windows of one cell; half periods along u, v and both diagonals, of which the greatest counts.
    """
    energy = (values * values).sum(axis=0)
    floor = 0.3 * float(energy[known].mean())
    window = (side | 1, side | 1)

    def level(shifts: tuple[tuple[int, int], ...]) -> Floats:
        product, base = np.zeros_like(energy), np.zeros_like(energy)
        for dx, dy in shifts:
            here, there = _overlap(energy.shape, dx, dy)
            both = known[here] & known[there]
            agreed = (values[:, *here] * values[:, *there]).sum(axis=0) * both
            mean = 0.5 * (energy[here] + energy[there]) * both
            for part in (here, there):
                product[part] += agreed
                base[part] += mean
        blur = [cv2.blur(v, window, borderType=cv2.BORDER_CONSTANT) for v in (product, base)]
        return blur[0] / (blur[1] + floor)

    half = side // 2
    if values.shape[1] == side:  # one row: only along it
        whole = level(((side, 0),))
        return whole - level(((half, 0),)), whole
    whole = level(((side, 0), (0, side)))
    between = np.maximum.reduce(
        [level(((half, 0),)), level(((0, half),)), level(((half, half), (half, -half)))]
    )
    return whole - between, whole


def _overlap(shape: tuple[int, ...], dx: int, dy: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Index pairs of the samples of a sheet and of those (dx, dy) further on."""

    def pair(step: int, size: int) -> tuple[slice, slice]:
        step = int(np.clip(step, -size, size))
        return (
            (slice(0, size - step), slice(step, size))
            if step >= 0
            else (slice(-step, size), slice(0, size + step))
        )

    (x0, x1), (y0, y1) = pair(dx, shape[1]), pair(dy, shape[0])
    return (y0, x0), (y1, x1)

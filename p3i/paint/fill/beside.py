"""All cells beside the common one of their kind: the light of each, and what it differs by.

The common cell of a kind is its cells' median in one light; a cell's light is a level and a contrast for each
channel, that bring it closest to the common one. The light is smooth over the photo (field.py).

Convention: M cells read on one grid, colours [M, side, side, 3] with `seen` [M, side, side]; N kinds.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.field import Field, field_of

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Cells are compared from so many on; the common one is the median of so many at most.
FEWEST = 3
_MOST_COMMON = 150
# A cell tells of its light and place where this share of it is seen.
LEAST_SEEN = 0.25
# Light does not change within so many steps: what does is the objects' own colour.
_LIGHT = 3.0
# Contrast is drawn towards 1 as if by this variance: flat cells say nothing of it.
_PRIOR_VARIANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """All cells beside the common one of their kind, of `commons` [N, side, side, 3]: `share` [M] is seen.

    `levels`, `contrasts` [M, 3] are the light of each, which its `variance` [M, 3] tells, `misfit` [M] what
    is left; `middle` [3] is the mean of the common cells.
    """

    commons: Floats
    kinds: NDArray[np.int64]
    share: Array
    levels: Array
    contrasts: Array
    variance: Array
    misfit: Array
    middle: Array

    @property
    def telling(self) -> Mask:
        """Which cells are seen enough to tell of their light and place."""
        return self.share >= LEAST_SEEN

    def residual(self, colours: Floats, seen: Mask) -> Floats:
        """What each cell lacks of the common one in its own light, [M, side, side, 3]; 0 where unseen."""
        light = (
            self.contrasts.astype(np.float32)[:, None, None],
            self.levels.astype(np.float32)[:, None, None],
        )
        lit = (colours - light[1]) / light[0] + self.middle.astype(np.float32)
        return np.asarray((self.commons[self.kinds] - lit) * seen[..., None], np.float32)

    def lit(self, places: Array, spacing: float, colours: Floats) -> tuple[Array, Array, Floats]:
        """The light as a field: levels, contrasts [M, 3] at the `places`, and colours [M, P, 3] lit alike.

        By the field, not each by its own light: what an object's colour differs by is its own.
        """
        surely = np.where(self.telling, self.share / np.maximum(self.misfit, 1e-3) ** 2, 0)
        level = _told(places, self.levels, surely[:, None] * np.ones(3), self.middle, spacing)
        contrast = _told(places, self.contrasts, surely[:, None] * self.variance, np.ones(3), spacing)
        levels, contrasts = level.at(places), np.clip(contrast.at(places), 0.25, 4)
        few = (colours - levels[:, None]) / contrasts[:, None] + self.middle
        return levels, contrasts, few.astype(np.float32)


def side_by_side(colours: Floats, seen: Mask, inside: Mask, kinds: NDArray[np.int64]) -> Cells | None:
    """The cells beside the common one of their kind; None where too few are seen.

    Colours [M, side, side, 3], `seen` [M, side, side]; `inside` [side, side] are the places of a cell.
    """
    share = seen.sum((1, 2)) / max(int(inside.sum()), 1)
    telling = share >= LEAST_SEEN
    if telling.sum() < FEWEST:
        return None
    weights = seen.astype(np.float32)
    many = np.bincount(kinds[telling], minlength=int(kinds.max()) + 1) / telling.sum()
    light = None
    commons, middle = _commons(colours, seen, share, kinds, None), np.zeros(3)
    for last in (False, False, True):
        middle = (many @ commons[:, inside].mean(1)).astype(float)
        light = _light(colours, weights, commons[kinds], middle)
        if not last:
            commons = _commons(colours, seen, share, kinds, (light[0], light[1], middle))
    assert light is not None
    cells = Cells(commons, kinds, share, *light, np.zeros(0), middle)
    misfit = np.abs(cells.residual(colours, seen)).sum((1, 2, 3)) / np.maximum(3 * weights.sum((1, 2)), 1)
    return replace(cells, misfit=misfit)


def _told(places: Array, values: Array, surely: Array, towards: Array, spacing: float) -> Field:
    information = surely[:, :, None] * np.eye(values.shape[1])
    return field_of(places, values, information, towards=towards, spacing=spacing, finest=_LIGHT)


def _commons(
    colours: Floats,
    seen: Mask,
    share: Array,
    kinds: NDArray[np.int64],
    light: tuple[Array, Array, Array] | None,
) -> Floats:
    """The medians [N, side, side, 3] of each kind's cells that are seen best, in one light.

    A place that no cell of a kind shows has the mean of those shown, a kind without cells the median of all.
    """
    result = np.zeros((int(kinds.max()) + 1, *colours.shape[1:]), np.float32)
    for kind in range(len(result)):
        own = np.flatnonzero((kinds == kind) & (share >= LEAST_SEEN))
        own = own if len(own) else np.flatnonzero(share >= LEAST_SEEN)
        best = own[np.argsort(-share[own], kind="stable")[:_MOST_COMMON]]
        values = colours[best].astype(np.float32)
        if light is not None:
            levels, contrasts, middle = (part.astype(np.float32) for part in light)
            values = (values - levels[best][:, None, None]) / contrasts[best][:, None, None] + middle
        values[~seen[best]] = np.nan
        some = seen[best].any(0)
        found = np.zeros(colours.shape[1:], np.float32)
        found[some] = np.nanmedian(values[:, some], axis=0)
        found[~some] = found[some].mean(0) if some.any() else 0.5
        result[kind] = found
    return result


def _light(colours: Floats, weights: Floats, commons: Floats, middle: Array) -> tuple[Array, Array, Array]:
    """The level and contrast [M, 3] of cells against common ones [M, side, side, 3]; the variance that tells.

    The level is what a cell has where the common ones have their `middle` [3].
    """
    inside = weights[..., None] / np.maximum(weights.sum((1, 2)), 1)[:, None, None, None]
    mean, wanted = (inside * colours).sum((1, 2)), (inside * commons).sum((1, 2))
    around = commons - wanted[:, None, None]
    variance = (inside * around**2).sum((1, 2))
    together = (inside * around * (colours - mean[:, None, None])).sum((1, 2))
    contrast = np.clip((together + _PRIOR_VARIANCE) / (variance + _PRIOR_VARIANCE), 0.25, 4)
    return (mean + contrast * (middle - wanted)).astype(float), contrast.astype(float), variance.astype(float)

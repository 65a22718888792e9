"""A quantity told by some places of a plane, with how surely each tells it, evaluated at others.

A plane is laid through what all places tell, robustly; what is left is averaged about each place asked for,
nearer places counting more (kernel regression). How near is near is told by leaving each place out in turn.

Convention: float64; M places [M, 2] in any one unit, values [M, C], information [M, C, C] (inverse
covariance).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Widths of the average that are tried, in distances to the next place.
_WIDTHS = (0.75, 1.5, 3.0, 6.0, 12.0)
# So many places tell at most, and a slope is believed with so many.
_MOST = 1200
_FOR_SLOPES = 9
# Rounds of weighing outliers down.
_ROUNDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """The quantity: a plane of `slopes` [3, C] over (1, x, y), and the `left` [M, C] that an average adds.

    `information` [M, C, C] weighs each place, `towards` [C, C] draws the average to 0; `width` is None where
    no average helps. `middle` [2] and `unit` scale the places.
    """

    places: Array
    left: Array
    information: Array
    towards: Array
    slopes: Array
    middle: Array
    unit: float
    width: float | None

    def at(self, places: Array) -> Array:
        """The quantity at places [K, 2]: [K, C]."""
        found = _rows(places, self.middle, self.unit) @ self.slopes
        if self.width is None:
            return found
        apart = np.linalg.norm(places[:, None] - self.places[None], axis=2)
        return found + _averaged(apart, self.width, self.left, self.information, self.towards)


def field_of(
    places: Array, values: Array, information: Array, *, towards: Array, spacing: float, finest: float = 0.0
) -> Field:
    """The field that `values` tell; `towards` [C] is what it is where nothing tells, `spacing` how far the
    next is.

    Places without information say nothing; no average is narrower than `finest` times the spacing.
    """
    told = np.flatnonzero(np.trace(information, axis1=1, axis2=2) > 0)
    told = told[np.linspace(0, len(told) - 1, min(len(told), _MOST)).astype(int)]
    count = values.shape[1]
    if not len(told):
        slopes = np.zeros((3, count))
        slopes[0] = towards
        none = np.zeros((0, count))
        return Field(places[:0], none, information[:0], np.eye(count), slopes, np.zeros(2), 1.0, None)
    places, values, information = places[told], values[told], information[told].copy()
    middle = places.mean(0)
    unit = max(float(np.abs(places - middle).max()), spacing)
    rows = _rows(places, middle, unit)
    slopes = np.zeros((3, count))
    left = values
    weights = np.ones(len(told))
    for _ in range(_ROUNDS):
        slopes = _plane(rows, values, information * weights[:, None, None], sloped=len(told) >= _FOR_SLOPES)
        left = values - rows @ slopes
        squares = np.einsum("mc,mcd,md->m", left, information, left)
        weights = 1 / (1 + squares / max(3 * float(np.median(squares)), 1e-12))
    information = information * weights[:, None, None]
    spread = np.diag((weights[:, None] * left**2).sum(0) / weights.sum() + 1e-12)
    prior = np.linalg.inv(spread)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    np.fill_diagonal(apart, np.inf)  # each is told by the others
    best, width = float(np.einsum("mc,mcd,md->", left, information, left)), None
    for factor in _WIDTHS:
        if factor < finest:
            continue
        off = left - _averaged(apart, factor * spacing, left, information, prior)
        wrong = float(np.einsum("mc,mcd,md->", off, information, off))
        if wrong < best:
            best, width = wrong, factor * spacing
    return Field(places, left, information, prior, slopes, middle, unit, width)


def _rows(places: Array, middle: Array, unit: float) -> Array:
    return np.column_stack([np.ones(len(places)), (places - middle) / unit])


def _plane(rows: Array, values: Array, information: Array, *, sloped: bool) -> Array:
    """The slopes [3, C] of the plane through the values, by least squares."""
    count = values.shape[1]
    if not sloped:
        rows = rows * (1.0, 0.0, 0.0)
    normal = np.einsum("mi,mcd,mj->icjd", rows, information, rows).reshape(3 * count, 3 * count)
    told = np.einsum("mi,mcd,md->ic", rows, information, values).reshape(-1)
    ridge = 1e-6 * np.trace(normal) / len(normal) + 1e-12
    return np.linalg.solve(normal + ridge * np.eye(len(normal)), told).reshape(3, count)


def _averaged(apart: Array, width: float, left: Array, information: Array, towards: Array) -> Array:
    """What is left, averaged by a Gauss bell of `width` over the places `apart` [K, M]: [K, C]."""
    near = np.exp(-0.5 * (apart / width) ** 2)
    count = left.shape[1]
    normal = (near @ information.reshape(len(left), -1)).reshape(-1, count, count) + towards
    told = near @ np.einsum("mcd,md->mc", information, left)
    return np.linalg.solve(normal, told[:, :, None])[:, :, 0]

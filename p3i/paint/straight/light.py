"""The light over a pattern: one smooth gain that makes its cells alike.

Convention: `samples` [L, K, 3] are the same K places of L patches, in 0..1, `seen` [L, K] which are known,
`points` [L, K, 2] where they lie on the plane. The gain is the exponential of a polynomial in the plane's
coordinates, one a channel; dividing by it gives the pattern in even light. Cells that were painted darker on
one side stay so: only what changes from cell to cell is light.
"""

from dataclasses import dataclass

import numpy as np

_DARK = 0.03
"""Added to values before their logarithm is taken, so that noise in shadows weighs little."""

_ROUNDS = 6
_MOST_LOG_GAIN = 1.2


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """The fitted gain: `terms` [T, 3] over the monomials of `(points - middle) / radius`."""

    terms: np.ndarray
    middle: np.ndarray
    radius: float

    def gain(self, points: np.ndarray) -> np.ndarray:
        """The gain [..., 3] at plane points [..., 2]; 1 in the middle of the light."""
        at = (points - self.middle.astype(points.dtype)) / points.dtype.type(self.radius)
        log_gain = _monomials(at, len(self.terms)) @ self.terms.astype(points.dtype)
        return np.exp(np.clip(log_gain, -_MOST_LOG_GAIN, _MOST_LOG_GAIN))


def even() -> Light:
    """No light to remove."""
    return Light(np.zeros((0, 3)), np.zeros(2), 1.0)


def fitted_light(samples: np.ndarray, seen: np.ndarray, points: np.ndarray) -> Light:
    """The gain that makes the patches most alike: quadratic for eight patches or more, linear for three.

    `samples` [N, K, 3] are the colours at K places of N patches, `seen` [N, K] says which are known, `points`
    [N, K, 2] where they lie on the plane. Least squares of logarithms, places against their own mean over
    the patches, outliers weighed down.
    """
    count = len(samples)
    terms = 5 if count >= 8 else 2 if count >= 3 else 0
    if not terms:
        return even()
    middle = points[seen].mean(axis=0)
    radius = max(1e-9, float(np.abs(points[seen] - middle).max()))
    logs = np.log(samples + _DARK)
    monomials = _monomials((points - middle) / radius, terms)
    weight = seen.astype(float)
    found = np.zeros((terms, 3))
    for _ in range(_ROUNDS):
        share = weight / np.maximum(weight.sum(axis=0), 1e-9)
        # Against the mean over the patches, place by place: what a cell looks like drops out.
        rows = monomials - (share[:, :, None] * monomials).sum(axis=0)
        values = logs - (share[:, :, None] * logs).sum(axis=0)
        flat, scale = rows.reshape(-1, terms), weight.ravel()
        normal = (flat * scale[:, None]).T @ flat
        normal += 1e-3 * np.trace(normal) / terms * np.eye(terms) + 1e-12 * np.eye(terms)
        found = np.linalg.solve(normal, (flat * scale[:, None]).T @ values.reshape(-1, 3))
        apart = np.abs(values - rows @ found).mean(axis=2)
        typical = max(1e-4, float(np.median(apart[seen]))) if seen.any() else 1.0
        weight = seen / (1 + (apart / (2 * typical)) ** 2)
    log_gain = monomials @ found
    offset = (log_gain * seen[:, :, None]).sum(axis=(0, 1)) / max(1, int(seen.sum()))
    return _levelled(Light(found, middle, radius), offset)


def _levelled(light: Light, offset: np.ndarray) -> Light:
    """The light with its mean taken out, so that a picture in even light is as bright as it was."""
    return Light(np.concatenate([light.terms, -offset[None]]), light.middle, light.radius)


def _monomials(at: np.ndarray, count: int) -> np.ndarray:
    """x, y[, xx, xy, yy][, 1] at [..., 2]: [..., count]; a count of 3 or 6 has the 1."""
    x, y = at[..., 0], at[..., 1]
    found = [x, y, x * x, x * y, y * y][: 5 if count >= 5 else 2 if count else 0]
    if count in (3, 6):
        found.append(np.ones_like(x))
    return np.stack(found, axis=-1) if found else np.zeros((*x.shape, 0))

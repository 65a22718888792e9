"""All shifts at once: how alike a view and its shifted copy are, by FFT, and the lattice in the peaks.

Convention: a view is float32 [H, W, C] with weights [H, W] in 0..1 (0 = unknown), shifts are (x, y) in pixels
of the view. OpenCV's transforms are used on packed real spectra: they were the fastest at these sizes, unless
they are told which rows are empty, which keeps them from the processor's own.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from p3i.search.forms.lattice import reduce_basis

# Shifts at which less than this share of the view (or of its energy) overlaps itself are not judged.
_LEAST_OVERLAP = 0.15
# A peak lower than this is not worth a look.
_LEAST_PEAK = 0.02
# Peaks are paired among this many of the best.
_PEAKS = 14
# Two shifts closer to parallel than this (sine of the angle) do not span a lattice.
_LEAST_SINE = 0.35
# The smallest cell among the pairs within this share of the best pair wins, and a cell is divided where its
# parts are within this share as alike as it is. At most a tenth of what repeats may then change sign from
# part to part: next to nothing does in the fields of ruled sheets, more than that in the strands of a woven
# mat (at 0.7 they were taken for one).
_NEARLY_BEST = 0.8
# Rows in halves and thirds of a basis: the lattices of which it spans every second or third point.
_FINER = (
    [[0.5, 0], [0, 1]],
    [[1, 0], [0, 0.5]],
    [[0.5, 0.5], [0.5, -0.5]],
    [[1 / 3, 0], [0, 1]],
    [[1, 0], [0, 1 / 3]],
    [[1 / 3, 1 / 3], [0, 1]],
    [[1 / 3, -1 / 3], [0, 1]],
)
_MOST_DIVISIONS = 3
# A correlation is told up to this: where a view has no noise, there would be no end to what it saves.
_MOST_TOLD = 0.99


@dataclass(frozen=True, slots=True, eq=False)
class Autocorrelation:
    """All shifts [S, S], zero in the middle.

    `values` float32, -1 where too little overlaps; `judged` where enough does; `trust` is the root of the
    share of the view that overlaps itself: what few pixels say is said by chance more often. The view has so
    many `pixels`, each counted by its weight.
    """

    values: np.ndarray
    judged: np.ndarray
    trust: np.ndarray
    pixels: float


@dataclass(frozen=True, slots=True, eq=False)
class ShiftPair:
    """Two shifts that span a lattice: `basis` [2, 2] rows in view pixels, and the `bits` that it saves."""

    basis: np.ndarray
    bits: float


def autocorrelation(view: np.ndarray, weights: np.ndarray) -> Autocorrelation:
    """2 sum w w' F.F' / sum w w' (|F|^2 + |F'|^2) over all shifts up to half the view [H, W, C].

    w is the weight of a pixel, F its features, primes the shifted copy (DESIGN.md, 4.2).
    """
    side = cv2.getOptimalDFTSize(int(1.5 * max(weights.shape)))
    weighted = view * weights[:, :, None]
    energy = np.einsum("hwc,hwc->hw", view, view)

    def spectrum(plane: np.ndarray) -> np.ndarray:
        padded = np.zeros((side, side), np.float32)
        padded[: plane.shape[0], : plane.shape[1]] = plane
        return cv2.dft(padded)

    def correlation(product: np.ndarray) -> np.ndarray:
        return cv2.idft(product, flags=cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT)

    power = np.zeros((side, side), np.float32)
    for channel in range(view.shape[2]):
        one = spectrum(np.ascontiguousarray(weighted[:, :, channel]))
        power += cv2.mulSpectrums(one, one, 0, conjB=True)
    of_weights = spectrum(weights)
    of_energy = spectrum(weights * energy)
    inner = correlation(power)
    crossed = correlation(cv2.mulSpectrums(of_energy, of_weights, 0, conjB=True))
    # The mean of |F|^2 and |F'|^2: the crossed term and its mirror image.
    mirrored = np.roll(crossed[::-1, ::-1], (1, 1), (0, 1))
    norm = 0.5 * (crossed + mirrored)
    overlap = correlation(cv2.mulSpectrums(of_weights, of_weights, 0, conjB=True))
    judged = (overlap > _LEAST_OVERLAP * overlap[0, 0]) & (norm > _LEAST_OVERLAP * norm[0, 0])
    values = np.where(judged, inner / np.maximum(norm, 1e-6 * max(float(norm[0, 0]), 1e-9)), -1)
    trust = np.sqrt(np.clip(overlap / max(float(overlap[0, 0]), 1e-9), 0, 1))
    shifted = (np.fft.fftshift(one) for one in (values.astype(np.float32), judged, trust))
    return Autocorrelation(*shifted, pixels=float(weights.sum()))


def best_pair(
    found: Autocorrelation, *, least: float, most: float, least_part: float | None = None
) -> ShiftPair | None:
    """The two shifts between `least` and `most` pixels that best span a lattice, None where there is none.

    A shift's worth is its valley contrast: its value less the least on the way from zero, the less the less
    of the view overlaps. A pair needs its sum and difference too, and to save bits; among those nearly as
    good as the best, the smallest cell is taken. It is divided where its parts are as alike; these may be as
    short as `least_part` pixels (`least` where it is None).
    """
    shifts, worth = _peaks(found, least=least, most=most)
    if len(shifts) < 2:
        return None
    first, second = np.triu_indices(len(shifts), 1)
    u, v = shifts[first], shifts[second]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    wide = area > _LEAST_SINE * np.hypot(*u.T) * np.hypot(*v.T)
    if not wide.any():
        return None
    first, second, u, v, area = first[wide], second[wide], u[wide], v[wide], area[wide]
    diagonals = np.stack([valley_contrast(found, u + v), valley_contrast(found, u - v)])
    score = 0.6 * np.minimum(worth[first], worth[second]) + 0.4 * diagonals.clip(0).mean(0)
    nearly = np.flatnonzero(score >= _NEARLY_BEST * score.max())
    best = nearly[np.argmin(area[nearly])]
    basis = _divided(found, np.stack([u[best], v[best]]), least=least if least_part is None else least_part)
    bits = _saved_bits(found, basis)
    return ShiftPair(basis, bits) if bits > 0 else None


def _saved_bits(found: Autocorrelation, basis: np.ndarray) -> float:
    """What a lattice saves of each sample of a cell, in bits, over all cells of the view.

    N cells that are told by others with the correlation r save -N/2 log2(1 - r^2). Here r is the mean value
    at all steps of the lattice, each counted by the pixels that overlap, less that at the half steps, of
    whichever half is most alike: what is alike everywhere repeats nowhere.
    """
    middle = found.values.shape[0] // 2
    basis = reduce_basis(basis)
    most = int(middle / np.hypot(*basis.T).min()) + 1  # steps to the rim, at an angle of 60 degrees or more
    i, j = np.meshgrid(np.arange(-most, most + 1), np.arange(most + 1))  # the other half mirrors this one
    index = np.stack([i, j], -1)[(j > 0) | (i > 0)]

    def mean(half: tuple[float, float]) -> float:
        shifts = (index + half) @ basis
        shifts = shifts[(np.abs(shifts) < middle - 1).all(1)]
        across, down = (middle + np.round(shifts).astype(int)).T
        counted = found.trust[down, across] ** 2 * found.judged[down, across]
        if not counted.any():
            return 0.0
        return float((_values_at(found, shifts) * counted).sum() / counted.sum())

    between = max(mean(half) for half in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)))
    told = min(max(mean((0.0, 0.0)) - max(between, 0.0), 0.0), _MOST_TOLD)
    cells = found.pixels / abs(float(np.linalg.det(basis)))
    return -cells / 2 * math.log2(1 - told**2)


def _divided(found: Autocorrelation, basis: np.ndarray, *, least: float) -> np.ndarray:
    """The finest lattice [2, 2] that holds `basis` and at whose further shifts the view is nearly as alike.

    Along a row of ruled lines the view stays alike on the way to the next field, so the step has a shallow
    valley and a diagonal wins; but the view is as alike at the step as at the diagonal, and that shows it.
    """
    for _ in range(_MOST_DIVISIONS):
        needed = _NEARLY_BEST * _values_at(found, basis).min()
        finer = None
        for rows in _FINER:
            parts = _with_sums(np.array(rows) @ basis)
            alike = _values_at(found, parts).min()
            short = np.hypot(*parts.T).min() < least
            if short or alike < needed or valley_contrast(found, parts).min() < _LEAST_PEAK:
                continue
            if finer is None or alike > finer[0]:
                finer = alike, parts[:2]
        if finer is None:
            break
        basis = finer[1]
    return basis


def _with_sums(basis: np.ndarray) -> np.ndarray:
    """The two shifts of a reduced basis, their sum and their difference: [4, 2]."""
    u, v = reduce_basis(basis)
    return np.stack([u, v, u + v, u - v])


def valley_contrast(found: Autocorrelation, shifts: np.ndarray) -> np.ndarray:
    """The value at each shift [N, 2] less the least value on the straight way to it from zero, [N]."""
    middle = found.values.shape[0] // 2
    way = np.linspace(0, 1, 21)[None, :]
    x = (middle + shifts[:, :1] * way).astype(np.float32)
    y = (middle + shifts[:, 1:] * way).astype(np.float32)
    on_the_way = cv2.remap(
        found.values, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1
    )
    return on_the_way[:, -1] - on_the_way.min(1)


def _values_at(found: Autocorrelation, shifts: np.ndarray) -> np.ndarray:
    """The value at each shift [N, 2], between pixels in proportion, [N]."""
    at = (found.values.shape[0] // 2 + shifts).astype(np.float32)
    return cv2.remap(
        found.values,
        at[:, :1],
        at[:, 1:],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=-1,
    )[:, 0]


def _peaks(found: Autocorrelation, *, least: float, most: float) -> tuple[np.ndarray, np.ndarray]:
    """The local maxima of one half plane, as the other mirrors it: shifts [N, 2] and worth, best first."""
    values = found.values
    middle = values.shape[0] // 2
    high = cv2.dilate(values, np.ones((5, 5), np.uint8))
    y, x = np.nonzero((values >= high) & found.judged & (values > _LEAST_PEAK))
    inside = (x > 0) & (y > 0) & (x < values.shape[1] - 1) & (y < values.shape[0] - 1)
    dx, dy = x - middle, y - middle
    far = np.hypot(dx, dy)
    kept = inside & (far >= least) & (far <= most) & ((dy > 0) | ((dy == 0) & (dx > 0)))
    x, y, dx, dy = x[kept], y[kept], dx[kept], dy[kept]
    if len(x) == 0:
        return np.zeros((0, 2)), np.zeros(0)
    peak = values[y, x]
    fine_x = _vertex(values[y, x - 1], peak, values[y, x + 1])
    fine_y = _vertex(values[y - 1, x], peak, values[y + 1, x])
    worth = valley_contrast(found, np.stack([dx, dy], 1).astype(float)) * found.trust[y, x]
    best = np.argsort(-worth, kind="stable")[:_PEAKS]
    return np.stack([dx + fine_x, dy + fine_y], 1)[best], worth[best]


def _vertex(before: np.ndarray, at: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Where the parabola through three neighbours has its top, in (-1/2, 1/2) of a pixel."""
    bend = before - 2 * at + after
    flat = np.abs(bend) < 1e-9
    return np.where(flat, 0, 0.5 * (before - after) / np.where(flat, 1, bend)).clip(-0.5, 0.5)

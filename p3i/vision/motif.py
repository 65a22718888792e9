"""Where in a repeating cell its object lies: cues over all phases of one cell of a lattice.

A cell repeats without a border of its own, so it is a torus: arrays [C, n, n] or [n, n] whose opposite
sides meet. Each cue is an array [n, n]: entry [y, x] says how much speaks for an object centred on sample
(x, y). None of them is sure of itself; p3i.search.extent.phase weighs them against each other. And some
places of a cell have a name of their own, whatever the object is: where lines cross, or a dark field is.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

_INNER, _OUTER = 0.3, 0.4  # the middle and the border of a cell, in periods from its centre
_THRESHOLDS = np.linspace(0.08, 0.92, 14)  # quantiles at which parts are cut out
_LEAST_PART, _FULL_PART = (
    0.02,
    0.15,
)  # shares of the cell: smaller parts are noise, from the second on they count fully
_VOTE_WIDTH = 0.08  # of a period
_THIN = 0.4  # of a cell: what covers less and runs on from cell to cell are lines, and the rest is ground
_PLAIN = 0.04  # of lightness 0..1: a cell that varies by less has no dark or light in it
_WIDE = 0.2  # of a period: a field's middle is where least lies so near


def offsets(n: int) -> tuple[Array, Array]:
    """Distance (x [n, n], y [n, n]) of each sample of a torus from sample (0, 0), in periods: -0.5 to 0.5."""
    line = ((np.arange(n) + n // 2) % n - n // 2) / n
    x, y = np.meshgrid(line, line)
    return x, y


def correlate(values: NDArray, kernel: NDArray) -> Array:
    """sum over p of values(q + p) kernel(p) at each q of the torus; the kernel's middle is sample (0, 0).

    Shapes: values [n, n], kernel [n, n] -> [n, n].
    """
    return np.real(np.fft.ifft2(np.fft.fft2(values) * np.conj(np.fft.fft2(kernel))))


def concentration(mass: NDArray) -> Array:
    """How much a mass [n, n] gathers about each place: its first harmonic, 1 where all of it sits there."""
    x, y = offsets(len(mass))
    kernel = (np.cos(2 * np.pi * x) + np.cos(2 * np.pi * y)) / 2
    return correlate(mass / max(float(mass.sum()), 1e-9), kernel)


def symmetry(template: Floats) -> Array:
    """Correlation of a cell [C, n, n] with itself turned by half a turn about each place, -1 to 1."""
    n = template.shape[1]
    turned = np.real(np.fft.ifft2(np.fft.fft2(template.astype(float)) ** 2)).sum(axis=0)
    twice = (2 * np.arange(n)) % n
    return turned[np.ix_(twice, twice)] / max(float((template**2).sum()), 1e-9)


def contrast(appearance: Floats) -> Array:
    """How much the middle of the cell [C, n, n] about each place differs from the border's usual colour.

    The mean distance from the border's median colour in the middle, less that along the border itself, over
    the mean of all: an object in the middle on a plain ground scores high, a cut through objects low.
    """
    channels, n = len(appearance), appearance.shape[1]
    x, y = offsets(n)
    border, middle = np.maximum(np.abs(x), np.abs(y)) > _OUTER, np.hypot(x, y) < _INNER
    rows = np.arange(n)
    around = appearance[:, (rows[:, None, None, None] + rows[:, None]) % n, (rows[:, None, None] + rows) % n]
    around = around.reshape(channels, n * n, n * n)  # [C, place, sample about it]
    ground = np.median(around[:, :, border.ravel()], axis=2, keepdims=True)
    distance = np.abs(around - ground).sum(axis=0)
    overall = distance.mean(axis=1) + 0.01
    inside, outside = distance[:, middle.ravel()].mean(axis=1), distance[:, border.ravel()].mean(axis=1)
    return ((inside - outside) / overall).reshape(n, n)


def parts(appearance: Floats) -> Array:
    """Votes, 0 to 1, for the middles of parts: what is brighter or darker than a threshold and ends there.

    What wraps round the torus is ground (a wall, a sheet of paper); what does not is a thing. Each part
    votes by the contrast along its outline, at every threshold at which it exists.
    Shapes: appearance [C, n, n] -> [n, n].
    """
    n = appearance.shape[1]
    votes = np.zeros((n, n))
    widest = max(float(np.ptp(channel)) for channel in appearance)
    for channel in appearance:
        if np.ptp(channel) < 0.25 * widest or widest <= 0:
            continue
        tiled = np.ascontiguousarray(np.tile(channel, (2, 2)), np.float32)
        slope = (
            np.hypot(*(np.abs(np.roll(tiled, -1, axis) - np.roll(tiled, 1, axis)) for axis in (0, 1)))
            / widest
        )
        for threshold in np.quantile(channel, _THRESHOLDS):
            for sign in (1, -1):
                _vote(votes, ((tiled - threshold) * sign > 0).astype(np.uint8), slope)
    x, y = offsets(n)
    votes = correlate(votes, np.exp(-(x**2 + y**2) / (2 * _VOTE_WIDTH**2)))
    return votes / max(float(votes.max()), 1e-9)


def _vote(votes: Array, region: NDArray[np.uint8], slope: NDArray) -> None:
    """Add the votes of the parts of a region [2n, 2n], a cell tiled twice each way; each part counts once."""
    n = len(votes)
    count, labels, stats, middles = cv2.connectedComponentsWithStats(region, connectivity=4)
    if count == 1:
        return
    rim = labels * (cv2.erode(region, np.ones((3, 3), np.uint8)) == 0)
    length = np.bincount(rim.ravel(), minlength=count)
    sharp = np.bincount(rim.ravel(), weights=slope.ravel(), minlength=count) / np.maximum(length, 1)
    for k in range(1, count):
        x, y, width, height, area = stats[k]
        cut_off = x == 0 or y == 0 or x + width == 2 * n or y + height == 2 * n
        if cut_off or width >= n + 2 or height >= n + 2 or area < _LEAST_PART * n * n:
            continue
        # Of the copies of a part in the tiling, the one whose middle lies in the central cell.
        if not (n / 2 <= middles[k][0] < 1.5 * n and n / 2 <= middles[k][1] < 1.5 * n):
            continue
        at_x = (middles[k][0] + x + (width - 1) / 2) / 2
        at_y = (middles[k][1] + y + (height - 1) / 2) / 2
        votes[round(at_y) % n, round(at_x) % n] += sharp[k] * min(1.0, np.sqrt(area / (_FULL_PART * n * n)))


def named_places(lightness: NDArray) -> dict[str, tuple[int, int]]:
    """The places (row, column) of a cell [n, n] that have a name, by its lightness 0..1.

    `crossing` and `field` are where lines that run through all cells are densest, and where they are
    farthest; without such lines `dark` and `light` are the middles of what is darker and what is lighter, as
    far as it is no ground that covers most of the cell: both on a chequered floor, one for discs on a wall.
    """
    low, high = float(lightness.min()), float(lightness.max())
    if high - low < _PLAIN:
        return {}
    grey = np.round(255 * (lightness - low) / (high - low)).astype(np.uint8)
    threshold, _ = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    light = grey > threshold
    for thin in (light, ~light):
        if thin.mean() < _THIN and _runs_on(thin):
            near = _blurred(thin, _VOTE_WIDTH), -_blurred(thin, _WIDE)
            return {name: _top(by) for name, by in zip(("crossing", "field"), near, strict=True)}
    parts = {"dark": ~light, "light": light}
    return {name: _top(_blurred(part, _WIDE)) for name, part in parts.items() if part.mean() <= 1 - _THIN}


def _runs_on(region: NDArray[np.bool_]) -> bool:
    """Whether a region of the torus [n, n] hangs together from cell to cell, along x and along y."""
    n = len(region)
    _, labels = cv2.connectedComponents(np.tile(region, (3, 3)).astype(np.uint8), connectivity=4)
    here = labels[n : 2 * n, n : 2 * n]
    onward = labels[n : 2 * n, 2 * n :], labels[2 * n :, n : 2 * n]
    return all(bool(((here == there) & region).any()) for there in onward)


def _blurred(region: NDArray, width: float) -> Array:
    """The share of a region [n, n] about each place of the torus: a Gaussian of `width` periods."""
    x, y = offsets(len(region))
    return correlate(region.astype(float), np.exp(-(x**2 + y**2) / (2 * width**2)))


def _top(values: Array) -> tuple[int, int]:
    """The (row, column) of the greatest of values [n, n]."""
    row, column = divmod(int(values.argmax()), values.shape[1])
    return row, column

"""The photo unrolled about a centre: angle to the right, logarithm of the radius down; a ring is a row.

Turning a ring shifts its row, enlarging it moves the row down, and neither changes shapes: objects of equal
size round a ring are equal things at equal distances, whose count the row's autocorrelation tells.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.interp.camera import image_from_plane
from p3i.search.look.evidence import ColourMap, Evidence
from p3i.vision.oriented import double_angle

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

_ANGLES = 288
_STEP = 2 * math.pi / _ANGLES
# Rows are this far apart in log radius; a bit coarser than the angles.
_ROW_STEP = 0.035
RADII = (3.0, 75.0)
"""Radii in hundredths of the longer side that is looked at: program units, where that is all of the photo."""
COUNTS = (4, 48)
"""The least and the most objects of a ring."""
LONGER = 400
"""Rings are looked for on the level of the photo that has about so many pixels on its longer side."""
# A band of rows with less than this share of the mean energy holds nothing to compare.
_LEAST_ENERGY = 0.15
# Bands of which less than this share is in sight are no rings.
_LEAST_KNOWN = 0.35
# What is near a radius: up to this factor.
_NEAR = 1.5
# At most so many readings of a strip are told.
_MOST_ROWS = 4
_ALL_COUNTS = range(COUNTS[0], COUNTS[1] + 1)
_PERIODS = _ANGLES / np.array(_ALL_COUNTS, float)
# A band is as high as the step is wide, but no ring reaches further than from half to twice its radius.
_HEIGHTS = np.clip(np.round(_PERIODS * _STEP / _ROW_STEP).astype(int), 3, 29) | 1
# The shifts that are compared: one and two steps, half and one and a half, each give or take a little.
_SHIFTS = np.array([1.0, 2.0, 0.5, 1.5])
_COLUMNS = (
    np.round(_PERIODS[:, None, None] * _SHIFTS[:, None] * np.linspace(0.92, 1.08, 5)).astype(int) % _ANGLES
)


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Features [C, R, T] of the unrolled photo, which are `known` [R, T], and the radius [R] of each row."""

    values: Floats
    known: NDArray[np.bool_]
    radii: Array


@dataclass(frozen=True, slots=True)
class Rows:
    """A reading of a strip: so many equal things at this radius (program units), and how well they agree."""

    count: int
    radius: float
    worth: float


def unroll(
    evidence: Evidence,
    pose: tuple[float, float],
    center: Array,
    *,
    focal_mm: float,
    about: float | None = None,
) -> Strip | None:
    """The strip about `center` [2] (program units) under a pose (rx, ry, degrees); None if little is seen.

    `about` asks for the radii near this one only.
    """
    size, share = evidence.image.size, evidence.part.share
    colours = evidence.colours_for(evidence.part.size.longer / LONGER)
    matrix = colours.map_from_photo.numpy() @ image_from_plane(*pose, size=size, focal_mm=focal_mm).numpy()
    low, high = (about / _NEAR, about * _NEAR) if about is not None else (r * share for r in RADII)
    radii = np.exp(np.arange(math.log(low), math.log(high), _ROW_STEP))
    angles = np.arange(_ANGLES, dtype=float) * _STEP
    at, known = polar_points(colours, matrix, center, radii, angles)
    enough = np.flatnonzero(known.mean(1) > 0.3)
    if len(enough) < 8:
        return None
    rows = slice(0, int(enough[-1]) + 1)
    known, radii = known[rows], radii[rows]
    strip = colours_at(colours, at[rows])
    return Strip(*_features(strip, known), radii)


def polar_points(
    colours: ColourMap, map_from_plane: Array, center: Array, radii: Array, angles: Array
) -> tuple[Floats, NDArray[np.bool_]]:
    """Where the circles of `radii` [R] about `center` lie on a map of colours, at `angles` [T] (radians).

    Returns map pixels [R, T, 2] and which of them can be read [R, T].
    """
    x = center[0] + radii[:, None] * np.cos(angles)
    y = center[1] + radii[:, None] * np.sin(angles)
    across, down, depth = (row[0] * x + row[1] * y + row[2] for row in map_from_plane)
    front = depth > 1e-6
    depth = np.where(front, depth, 1.0)
    at = np.stack([across / depth, down / depth], -1).astype(np.float32)
    height, width = colours.valid.shape
    across, down = at[..., 0], at[..., 1]
    known = front & (across >= 0) & (down >= 0) & (across <= width - 1) & (down <= height - 1)
    if not bool(colours.valid.all()):
        mask = colours.valid.numpy().astype(np.float32)
        known &= cv2.remap(mask, at[..., 0], at[..., 1], cv2.INTER_LINEAR) > 0.99
    return at, known


def colours_at(colours: ColourMap, at: Floats) -> Floats:
    """The colours [R, T, 3] at map pixels [R, T, 2]; beyond the map its nearest pixels."""
    taken = cv2.remap(colours.lab, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(taken, np.float32)


def orientation(gx: NDArray, gy: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """The `double_angle` of all colours together: gx, gy [..., 3] -> three [...]."""

    def over_colours(one: NDArray, other: NDArray) -> NDArray:
        # numpy sums along a last axis of three at a seventh of this speed.
        return one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1] + one[..., 2] * other[..., 2]

    return double_angle(over_colours(gx, gx), over_colours(gy, gy), over_colours(gx, gy))


def gradients(lab: NDArray) -> Floats:
    """Gradient strength and double angle of unrolled colours [R, T, 3] whose ends meet: [3, R, T]."""
    smooth = cv2.GaussianBlur(np.pad(lab, ((0, 0), (4, 4), (0, 0)), mode="wrap"), (0, 0), 1.0)
    gx = 0.5 * (smooth[:, 5:-3] - smooth[:, 3:-5])
    inner = smooth[:, 4:-4]
    gy = np.zeros_like(inner)
    gy[1:-1] = 0.5 * (inner[2:] - inner[:-2])
    return np.stack(orientation(gx, gy)).astype(np.float32)


def _features(lab: NDArray, known: NDArray) -> tuple[Floats, NDArray[np.bool_]]:
    """The gradients of a strip [R, T, 3] freed of each row's mean [3, R, T], and where they are known."""
    values = gradients(lab)
    mask = cv2.erode(np.pad(known.astype(np.uint8), ((0, 0), (3, 3)), mode="wrap"), np.ones((3, 5)))
    mask = mask[:, 3:-3].astype(bool)
    mask[[0, -1]] = False
    count = np.maximum(mask.sum(1), 1)[None, :, None]
    values -= (values * mask).sum(2, keepdims=True) / count
    return values * mask, mask


def best_rows(strip: Strip) -> list[Rows]:
    """The readings of a strip whose neighbours agree best, beyond half a step: distinct ones, best first."""
    inner, both = _autocorrelation(strip)
    typical = float(both[:, 0].mean())
    if typical <= 0:
        return []
    shifted = _COLUMNS.reshape(len(_COLUMNS), -1)
    overlap = _bands(both, shifted)
    ncc = _bands(inner, shifted) / np.maximum(overlap, _LEAST_ENERGY * typical)
    ncc = ncc.reshape(*ncc.shape[:2], *_COLUMNS.shape[1:]).max(3)
    contrast = ncc[:, :, :2].min(2) - np.maximum(ncc[:, :, 2:].max(2), 0)
    nothing = np.zeros_like(shifted[:, :1])
    norm = _bands(both, nothing)
    known = _bands(strip.known.mean(1, keepdims=True), nothing)
    # Bands that hold little energy, or are seen in part, are worth less.
    share = norm[:, :, 0] / (norm[:, :, 0] + typical)
    worth = np.where(known[:, :, 0] > _LEAST_KNOWN, contrast * share * known[:, :, 0], 0.0)
    best = worth.argmax(1)
    found = [
        Rows(count, float(strip.radii[row]), float(worth[place, row]))
        for place, (count, row) in enumerate(zip(_ALL_COUNTS, best, strict=True))
    ]
    return sorted(found, key=lambda reading: -reading.worth)[:_MOST_ROWS]


def likeness(strip: Strip, count: int) -> float:
    """How much a narrow strip looks like `count` equal things: up to three steps on, less half steps."""
    inner, both = (table.sum(0) for table in _autocorrelation(strip))
    ncc = inner / np.maximum(both, 1e-3 * both[0] + 1e-9)
    period = _ANGLES / count
    whole = [ncc[round(step * period) % _ANGLES] for step in (1, 2, 3)]
    half = [ncc[round(step * period) % _ANGLES] for step in (0.5, 1.5, 2.5)]
    return float(np.mean(whole) - max(float(np.mean(half)), 0.0))


def _autocorrelation(strip: Strip) -> tuple[NDArray, NDArray]:
    """By the shift, [R, T] both: the inner product of each row with itself, and the energy that overlaps."""
    spectrum = np.fft.rfft(strip.values, axis=2)
    inner = np.fft.irfft((np.abs(spectrum) ** 2).sum(0), n=_ANGLES, axis=1)
    mask = np.fft.rfft(strip.known.astype(np.float32), axis=1)
    of_energy = np.fft.rfft((strip.values**2).sum(0), axis=1)
    # sum of w w' (E + E') / 2: it is even in the shift.
    return inner, np.fft.irfft((np.conj(mask) * of_energy).real, n=_ANGLES, axis=1)


def _bands(table: NDArray, columns: NDArray) -> NDArray:
    """Means over bands of rows of a table [R, T] at the `columns` [counts, M] of each count: [counts, R, M].

    Each count has its own height of band.
    """
    rows = len(table)
    sums = np.concatenate([np.zeros_like(table[:1]), table.cumsum(0)])[:, columns].transpose(1, 0, 2)
    at = np.arange(rows)
    first = np.clip(at - _HEIGHTS[:, None] // 2, 0, rows)[..., None]
    last = np.clip(at + _HEIGHTS[:, None] // 2 + 1, 0, rows)[..., None]
    difference = np.take_along_axis(sums, last, 1) - np.take_along_axis(sums, first, 1)
    return difference / _HEIGHTS[:, None, None]

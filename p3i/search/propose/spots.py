"""Rings of separate objects: ellipses through spots that look alike, and the two circles that each may be.

Where nothing but the objects themselves lies on a ring, rotations of the whole picture say little (votes.py).
But five spots fix an ellipse, and an ellipse of known focal is one of two circles in space.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.interp.camera import Camera
from p3i.search.look.evidence import Evidence
from p3i.search.look.unrolled import COUNTS, LONGER

Array = NDArray[np.float64]

# Spots of these widths are looked for, in pixels of the map.
_WIDTHS = (2.0, 3.0, 4.5, 6.7, 10.0, 15.0)
_MOST_SPOTS = 70
# Alike are spots whose colours differ from their ground in the same direction, and by this factor at most,
# as do their widths.
_LEAST_COSINE = 0.85
_MOST_STRONGER = 2.5
# Each spot is tried with this many of the spots like it, and with the nearest, twice as many as fix an
# ellipse, in so many draws of five each.
_FELLOWS = 16
_DRAWS = 75
# A spot lies on an ellipse where it is this close, as a share of the ellipse's size, and in pixels.
_CLOSE = 0.03
_CLOSE_PX = 1.5
_FEWEST = 5
# An ellipse is no longer than this beside its width, and its radius lies between these shares of the map.
_MOST_OBLONG = 4.0
_RADII = (0.05, 0.6)
_MOST_ELLIPSES = 12


@dataclass(frozen=True, slots=True, eq=False)
class _Spots:
    """Spots of a map: places [N, 2], widths [N], and how their colour differs from the ground [N, 3]."""

    at: Array
    width: Array
    colour: Array


def circles(evidence: Evidence, generator: np.random.Generator) -> list[tuple[Camera, Array]]:
    """The circles through spots that look alike, the most telling first: two for each ellipse.

    Each is a camera that sees it straight on, and its centre [2] in photo pixels.
    """
    colours = evidence.colours_for(evidence.part.size.longer / LONGER)
    lab, map_from_photo = colours.lab, colours.map_from_photo.numpy()
    spots = _spots(lab, colours.valid.numpy())
    if len(spots.at) < _FEWEST:
        return []
    size = evidence.image.size
    focal_px = Camera(focal_mm=evidence.focal_mm).focal_px(size)
    lens = np.array([[focal_px, 0, size.middle[0]], [0, focal_px, size.middle[1]], [0, 0, 1.0]])
    conics = _ellipses(spots, max(lab.shape[:2]), generator)
    on_photo = [map_from_photo.T @ conic @ map_from_photo for conic in conics]
    return [circle for conic in on_photo for circle in _circles(conic, lens, evidence.focal_mm)]


def _spots(lab: NDArray, known: NDArray[np.bool_]) -> _Spots:
    """The strongest spots: places where a blur differs most from a wider one, over place and width."""
    levels, differences = [], []
    for width in _WIDTHS:
        inner = cv2.GaussianBlur(lab, (0, 0), width * 0.7)
        difference = inner - cv2.GaussianBlur(lab, (0, 0), width * 1.3)
        differences.append(difference)
        levels.append(np.sqrt((difference**2).sum(2)) * known)
    stack = np.stack(levels)
    widest = np.stack([cv2.dilate(level, np.ones((5, 5))) for level in stack])
    around = np.maximum(widest, np.maximum(np.roll(widest, 1, 0), np.roll(widest, -1, 0)))
    peaks = np.argwhere((stack >= around) & (stack > 0))
    height, width_px = known.shape
    strength = stack[tuple(peaks.T)]
    kept: list[NDArray] = []
    for place in np.argsort(-strength):
        level, y, x = peaks[place]
        rim = 1.0 * _WIDTHS[level]
        if not (rim <= x < width_px - rim and rim <= y < height - rim):
            continue
        if all(np.hypot(y - other[1], x - other[2]) > _WIDTHS[level] for other in kept):
            kept.append(peaks[place])
        if len(kept) >= _MOST_SPOTS:
            break
    if not kept:
        return _Spots(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3)))
    level, y, x = np.array(kept).T
    colour = np.stack([differences[k][row, column] for k, row, column in zip(level, y, x, strict=True)])
    return _Spots(np.stack([x, y], 1).astype(float), np.array(_WIDTHS)[level], colour.astype(float))


def _ellipses(spots: _Spots, longer: int, generator: np.random.Generator) -> list[Array]:
    """Ellipses through many spots that are alike, as conics [3, 3] of the map, the most telling first."""
    strength = np.linalg.norm(spots.colour, axis=1)
    cosine = (spots.colour @ spots.colour.T) / np.maximum(strength[:, None] * strength, 1e-9)
    stronger = np.maximum(strength[:, None] / strength, strength / strength[:, None])
    wider = np.maximum(spots.width[:, None] / spots.width, spots.width / spots.width[:, None])
    alike = (cosine > _LEAST_COSINE) & (stronger < _MOST_STRONGER) & (wider < _MOST_STRONGER)
    best: list[tuple[float, Array, NDArray]] = []
    for spot in range(len(spots.at)):
        fellows = np.flatnonzero(alike[spot])
        if len(fellows) < _FEWEST:
            continue
        nearest = fellows[np.argsort(-cosine[spot, fellows])][:_FELLOWS]
        nearest = nearest[nearest != spot]
        if len(nearest) < _FEWEST - 1:
            continue
        away = np.hypot(*(spots.at[fellows] - spots.at[spot]).T)
        closest = fellows[np.argsort(away)][1 : 2 * _FEWEST + 1]
        five = np.concatenate([_fives(spot, nearest, generator), _fives(spot, closest, generator)])
        conics = _conics(spots.at[five], longer)
        off, angle, share = _off_and_angles(conics, spots.at[fellows], longer)
        bits = _bits_on(off, share) + _bits_even(angle, off < 1)
        # As many of its draws as fix an ellipse are kept: one spot is on few rings.
        for k in np.argsort(-bits)[:_FEWEST]:
            if bits[k] > 0:
                best.append((float(bits[k]), conics[k], fellows[off[k] < 1]))
    best.sort(key=lambda one: -one[0])
    found: list[Array] = []
    taken: list[set[int]] = []
    for _, conic, members in best:
        names = set(members.tolist())
        if any(len(names & other) > 0.6 * len(names) for other in taken):
            continue
        taken.append(names)
        found.append(conic)
        if len(found) >= _MOST_ELLIPSES:
            break
    return found


def _fives(spot: int, others: NDArray, generator: np.random.Generator) -> NDArray:
    """Draws [D, 5] of a spot and four others."""
    draws = np.argsort(generator.random((_DRAWS, len(others))), 1)[:, : _FEWEST - 1]
    return np.concatenate([np.full((_DRAWS, 1), spot), others[draws]], 1)


def _conics(points: Array, longer: int) -> Array:
    """The conics [D, 3, 3] through five points each [D, 5, 2]."""
    scale = longer / 2
    x, y = (points / scale - 1)[..., 0], (points / scale - 1)[..., 1]
    rows = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], -1)
    _, _, vectors = np.linalg.svd(rows)
    a, b, c, d, e, f = vectors[:, -1].T
    normed = np.stack(
        [np.stack([a, b / 2, d / 2], -1), np.stack([b / 2, c, e / 2], -1), np.stack([d / 2, e / 2, f], -1)],
        -2,
    )
    change = np.array([[1 / scale, 0, -1], [0, 1 / scale, -1], [0, 0, 1.0]])
    return change.T @ normed @ change


def _off_and_angles(conics: Array, points: Array, longer: int) -> tuple[Array, Array, Array]:
    """How far points [N, 2] lie from each conic and at which angle about it, both [D, N].

    Below 1 is on it, infinite from what is no fair ellipse. Angles in radians, of the ellipse made a circle.
    The third is the share [D] of the map that is on each.
    """
    block = conics[:, :2, :2]
    determinant = np.linalg.det(block)
    safe = np.where(np.abs(determinant) > 1e-15, determinant, 1.0)
    inverse = (
        np.stack(
            [
                np.stack([block[:, 1, 1], -block[:, 0, 1]], -1),
                np.stack([-block[:, 1, 0], block[:, 0, 0]], -1),
            ],
            -2,
        )
        / safe[:, None, None]
    )
    center = -np.einsum("dij,dj->di", inverse, conics[:, :2, 2])
    level = np.einsum("di,di->d", conics[:, 2, :2], center) + conics[:, 2, 2]
    shape = -block / np.where(np.abs(level) > 1e-15, level, 1.0)[:, None, None]  # (p - c)' shape (p - c) = 1
    values = np.linalg.eigvalsh(shape)
    fair = (determinant > 0) & (values[:, 0] > 0)
    axes = 1 / np.sqrt(np.where(values > 0, values, 1.0))
    fair &= axes[:, 0] < _MOST_OBLONG * axes[:, 1]
    radius = np.sqrt(axes[:, 0] * axes[:, 1])
    fair &= (radius > _RADII[0] * longer) & (radius < _RADII[1] * longer)
    away = points[None] - center[:, None]
    shape = np.where(fair[:, None, None], shape, np.eye(2))
    root = np.linalg.cholesky(shape)
    x, y = np.moveaxis(away @ root, -1, 0)
    distance = np.hypot(x, y) - 1
    limit = _CLOSE + _CLOSE_PX / np.maximum(radius, 1.0)
    off = np.where(fair[:, None], np.abs(distance) / limit[:, None], np.inf)
    return off, np.arctan2(y, x), 4 * math.pi * radius**2 * limit / longer**2


def _bits_on(off: Array, share: Array) -> Array:
    """What speaks against chance that so many points are so near to each conic, [D] bits.

    Hoeffding's bound on the tail of the binomial law, at the nearness that tells most, of five points less:
    those fix the conic (Desolneux, Moisan and Morel, From Gestalt Theory to Image Analysis, chapter 3).
    """
    others = off.shape[1] - _FEWEST
    bits = np.zeros(len(off))
    if others <= 0:
        return bits
    for near in (1.0, 0.5, 0.25):
        by_chance = np.clip(near * share, 1e-6, 0.5)
        on = np.clip(((off < near).sum(1) - _FEWEST) / others, 0, 1)
        more = on * np.log2(np.maximum(on, 1e-9) / by_chance)
        more += (1 - on) * np.log2(np.maximum(1 - on, 1e-9) / (1 - by_chance))
        bits = np.maximum(bits, np.where(on > by_chance, others * more, 0.0))
    return bits


def _bits_even(angle: Array, on: NDArray[np.bool_]) -> Array:
    """What speaks against chance for the angles [D, N] (radians) that are `on`, at even steps: [D] bits.

    The test of Rayleigh, at the count of steps a turn that tells most.
    """
    each = np.where(on, np.exp(1j * angle), 0)
    counts = np.maximum(on.sum(1), 1)
    turned, most = each, np.zeros(len(angle))
    for count in range(2, COUNTS[1] + 1):
        turned = turned * each
        if count >= COUNTS[0]:
            most = np.maximum(most, np.abs(turned.sum(1)) ** 2 / counts)
    return np.maximum(most / math.log(2) - math.log2(COUNTS[1] - COUNTS[0] + 1), 0)


def _circles(conic: Array, lens: Array, focal_mm: float) -> list[tuple[Camera, Array]]:
    """The two cameras that see a circle as this conic of the photo, with the circle's centre in pixels.

    The cone over the conic, turned to its axes, is cut in circles by two families of planes (a classical
    result; Forsyth et al., Invariant descriptors for 3-D object recognition and pose, PAMI 1991).
    """
    cone = lens.T @ conic @ lens
    cone = cone / np.cbrt(np.abs(np.linalg.det(cone)) + 1e-30)
    values, vectors = np.linalg.eigh(cone)
    if (values > 0).sum() == 1:
        values, vectors = -values[::-1], vectors[:, ::-1]
    if (values > 0).sum() != 2:
        return []
    low, middle, high = values  # low < 0 < middle <= high
    across, along = np.sqrt(max(high - middle, 0.0)), np.sqrt(middle - low)
    found = []
    for sign in (1.0, -1.0):
        normal = sign * across * vectors[:, 2] + along * vectors[:, 0]
        camera = Camera.from_normal((normal[0], normal[1], normal[2]), focal_mm=focal_mm)
        horizon = np.linalg.inv(lens).T @ np.array(camera.normal)
        center = np.linalg.inv(conic) @ horizon
        found.append((camera, center[:2] / center[2]))
    return found

"""What lies under a thing, told from what lies around it: what meets it on two opposite sides goes on.

The directions are those of the pattern, along which grout, bars, board lines and the rims of discs run. Where
the profile across a direction is the same on both sides of the hidden part, a line or an edge runs through
it and is drawn on; where nothing does, the surroundings are continued smoothly.

Convention: values float32 [h, w, C], masks bool [h, w]; directions [D, 2] in places, (x, y), of any length.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.fill import filled

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Profiles are read so far to both sides of a direction, and so deep into what is known, in places.
_ACROSS = np.arange(-4, 5)
_DEPTH = np.arange(4)
_MIDDLE = len(_ACROSS) // 2
# The middle of a profile counts most: of two lines that cross, each is drawn where it runs.
_NEAR = np.exp(-(_ACROSS**2) / (2 * 1.5**2))[:, None]
# Detail is what differs from a mean over so many places.
_EVEN = 2.5
# A line is as strong as this share of all detail that is known, at least; fainter ones count as less.
_LEAST_LINE = 0.5
# A membrane is stretched by means over so many places, again and again.
_MEMBRANE = (7,) * 30 + (3,) * 90


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """What is met from K places on both ways of a direction: `near` [2, K] how far away, inf for nowhere.

    `profile` [2, K, A, C] is what is known across, both in one sense of running, and `seen` [2, K, A] where.
    """

    near: Array
    profile: Array
    seen: Mask


def continuations(values: Floats, known: Mask, directions: Array) -> list[Floats]:
    """All that is not known, continued smoothly, then along each direction alone: pictures [h, w, C].

    Where a direction meets what is known on one side only, or on none, the smooth continuation stands.
    """
    smooth = _smooth(values, known)
    rows, columns = np.nonzero(~known)
    found = [smooth]
    for direction in directions:
        ends = _ends(values, known, np.stack([columns, rows], 1).astype(float), direction)
        both = np.isfinite(ends.near).all(0)
        picture = smooth.copy()
        picture[rows[both], columns[both]] = _between(ends)[both]
        found.append(picture)
    return found


def through(values: Floats, known: Mask, wanted: Mask, directions: Array) -> Floats:
    """The values with those `wanted` replaced by what is `known` beside them, carried on: [h, w, C].

    What is neither stays as it is, and is not read.
    """
    smooth = _smooth(values, known)
    rows, columns = np.nonzero(wanted)
    if not len(rows) or not known.any():
        return values
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), _EVEN)[:, :, None]
    even = cv2.GaussianBlur(np.where(known[:, :, None], values, np.float32(0)), (0, 0), _EVEN)
    even = np.where(known[:, :, None], even / np.maximum(weight, 1e-4), 0).astype(np.float32)
    detail = np.where(known[:, :, None], values - even, 0).astype(np.float32)
    places = np.stack([columns, rows], 1).astype(float)
    typical = _LEAST_LINE * float((detail[known] ** 2).sum(1).mean()) * float(_NEAR.sum()) + 1e-9
    strongest, share = np.zeros(len(rows)), np.zeros(len(rows))
    drawn = np.zeros((len(rows), values.shape[2]))
    for direction in directions:
        ends = _ends(detail, known, places, direction)
        both = (ends.seen[0] & ends.seen[1] & np.isfinite(ends.near.max(axis=0))[:, None])[:, :, None]
        one, other = ends.profile * both
        energy = (_NEAR * (one**2 + other**2) / 2).sum((1, 2))
        apart = (_NEAR * (one - other) ** 2 / 2).sum((1, 2))
        # Of the profiles' energy, that which both sides share; a line is where it is most of it.
        alike = np.clip(1 - 2 * apart / np.maximum(energy, 1e-12), 0, 1)
        worth = alike * energy
        better = worth > strongest
        strongest[better], share[better] = worth[better], (alike * energy / (energy + typical))[better]
        drawn[better] = _between(ends)[better]
    base = _smooth(even, known)[rows, columns]
    lines = share[:, None]
    result = values.copy()
    result[rows, columns] = lines * (base + drawn) + (1 - lines) * smooth[rows, columns]
    return result


def _smooth(values: Floats, known: Mask) -> Floats:
    """What is known, with a membrane stretched over the rest: what is nearest counts."""
    under = filled(np.where(known[:, :, None], values, np.float32(0)), known)
    for width in _MEMBRANE:
        under = np.where(known[:, :, None], values, cv2.blur(under, (width, width)))
    return under.astype(np.float32)


def _between(ends: _Ends) -> Array:
    """The values [K, C] between both ends, nearer to that of the nearer."""
    near = np.where(np.isfinite(ends.near), ends.near, 0)
    first = (near[1] / np.maximum(near.sum(0), 1e-9))[:, None]
    return first * ends.profile[0][:, _MIDDLE] + (1 - first) * ends.profile[1][:, _MIDDLE]


def _ends(values: Floats, known: Mask, places: Array, direction: Array) -> _Ends:
    """What is known on both ways from places [K, 2] along a direction [2]."""
    height, width = known.shape
    step = direction / np.hypot(*direction)
    across = np.array([-step[1], step[0]])
    near, profiles, shown = [], [], []
    for way in (step, -step):
        at, met = places.copy(), np.zeros(len(places), bool)
        going = np.ones(len(places), bool)
        while going.any():
            at[going] += way
            x, y = np.rint(at).astype(int).T
            inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
            here = going & inside
            here[here] = known[y[here], x[here]]
            met |= here
            going &= inside & ~here
        spots = at[:, None, None] + _ACROSS[:, None, None] * across + _DEPTH[:, None] * way
        x, y = np.rint(spots).astype(int).transpose(3, 0, 1, 2)
        inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
        seen = inside & known[y, x]
        count = seen.sum(2)
        profiles.append((values[y, x] * seen[..., None]).sum(2) / np.maximum(count, 1)[..., None])
        shown.append((count > 0) & met[:, None])
        near.append(np.where(met, np.hypot(*(at - places).T), np.inf))
    return _Ends(np.stack(near), np.stack(profiles), np.stack(shown))

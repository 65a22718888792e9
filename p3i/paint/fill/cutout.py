"""The object of a cell, cut out of its ground: which part of the common cell is not what lies around it.

The cells of all objects are laid onto one another by the program's own frames (place/moves.py), brought to
one light, and their median taken. The cell's border, as far from objects as places are, shows the ground;
continued into the cell, smoothly or straight along the pattern's directions (through.py), it is what would
lie under the object, and what none of these continuations tells is the object. What is fainter and hangs on
the object, its shadow and rim, goes where it goes.

Convention: a cell is sampled on a square grid about its object, `side` x `side` places, `step` program units
apart; RGB in 0..1.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.grid import Straight
from p3i.paint.fill.through import continued, through
from p3i.place.moves import frames
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed
from p3i.vision.cells import median_cell
from p3i.vision.fill import filled
from p3i.vision.image import Image
from p3i.vision.lab import lab_of
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_SIDE = 65
# The grid reaches this far from the object, in distances between objects.
_REACH = 0.75
_MOST_CELLS = 60
# The ground is what lies this near to the border between cells, in distances between objects.
_BORDER = 0.07
# An object differs from its ground by this at least (Lab, 0 to 100), and by this many deviations.
_LEAST_CONTRAST = 4.0
_DEVIATIONS = 2.0
# An object is at least this share of its cell, and at most that.
_LEAST_SHARE, _MOST_SHARE = 0.01, 0.92
# Ground that runs on straight must leave this share at most of what a smooth one leaves unexplained, to be
# believed: along one direction, along several at once.
_STRAIGHT, _CROSSED = 0.8, 0.5
_FAINT = 0.5  # in Lab: less than this is explained by any
_TOLD = 0.6  # of a cell, at least, is ground
# What hangs on an object and differs from its ground by so much goes with it: the least that an eye sees, in
# Lab (Mahy, van Eycken and Oosterlinck, Color Research and Application 1994), and so many deviations.
_JUST_SEEN = 2.3
_SEEN_DEVIATIONS = 1.0
_SLIPPED = 2.0
# Shadow and rim lie within this of it, in distances.
_HANGS_ON = 0.15
# What goes reaches this much further, in distances: edges are blurred, and objects slip.
_SLIP = 0.03
# Parts of fewer places are noise; what stays within the cell is its object, if it is this share of all.
_LEAST_PART = 6
_LOOSE_SHARE = 0.15
# Where no object stands out, the middle of the cell is taken for it, this far, in distances.
_ASSUMED = 0.36
# Where edits of photos looked good, the ground was more even than this, and objects more alike; where objects
# leave less room than this up to their cell's border, the ground must be more even still.
_MOST_UNEVEN, _MOST_UNLIKE = 0.35, 0.6
_LEAST_ROOM, _MOST_UNEVEN_THERE = 0.06, 0.17


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """A picture float32 [H, W, 3] and its halves, so that it can be read where it is shrunk."""

    pictures: tuple[Floats, ...]

    @classmethod
    def of(cls, pixels: Floats) -> "Levels":
        """The picture down to a side of about 32 pixels."""
        found = [pixels]
        while min(found[-1].shape[:2]) >= 64:
            found.append(np.asarray(cv2.pyrDown(found[-1]), np.float32))
        return cls(tuple(found))

    def read(self, at: NDArray, shrink: float) -> Floats:
        """The colours [K, 3] at pixels [K, 2], read `shrink` pixels apart."""
        level = int(np.clip(np.round(np.log2(max(shrink, 1e-6)) + 0.2), 0, len(self.pictures) - 1))
        return taken(
            self.pictures[level], np.asarray(at, float) / 2**level, sharp=level == 0 and shrink < 0.8
        )


@dataclass(frozen=True, slots=True, eq=False)
class Cutout:
    """The object of a program's cells: `alpha` float32 [side, side], 1 on it, soft at its edge.

    `gone` [side, side] is 1 on all that goes with it, shadow and rim too, `ground` [side, side, 3] the median
    cell without that, `own` [side, side] how far inside its own cell a place lies, in distances.

    `room` is how much ground lies between it and the cell's border, where they are closest, in distances.
    `uneven` is how much the ground at that border differs from place to place, but along the direction that
    it runs in, as a share of the difference between object and ground; `unlike` how far a typical object is
    from the median cell, as a share of the contrast within that.

    `step` is the grid's distance in program units; `mean` [side, side, 3] the median cell; `misfit` [M] how
    far each object of the program is from it, inf for those not seen wholly. `clear` says whether the object
    stood out from its ground.
    """

    alpha: Floats
    gone: Floats
    mean: Floats
    ground: Floats
    own: Array
    step: float
    misfit: Array
    clear: bool
    room: float
    uneven: float
    unlike: float

    @property
    def radius(self) -> float:
        """How far the object reaches from its middle, in program units."""
        half = (self.alpha.shape[0] - 1) / 2
        rows, columns = np.nonzero(self.alpha > 0.5)
        return float(np.hypot(columns - half, rows - half).max(initial=0)) * self.step

    def at(self, local: Array, layer: Floats | None = None) -> Floats:
        """`alpha`, or another `layer` of the grid, at places [K, 2] in units from the object's middle: [K].

        Nothing lies beyond the grid.
        """
        half = (self.alpha.shape[0] - 1) / 2
        at = local / self.step + half
        inside = (at >= 0).all(1) & (at <= 2 * half).all(1)
        return taken(self.alpha if layer is None else layer, at) * inside


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """The cells of all objects as the photo has them: `cells` [M, side, side, 3], `seen` [M, side, side].

    `own` [side, side] is how far inside its own cell a place lies, in distances, `step` that of places in
    program units, `places` how many there are from an object to the next.
    """

    cells: Floats
    seen: Mask
    own: Array
    step: float
    places: float


def sampled_cells(placed: Placed, photo: Image) -> Sampled:
    """The cells of all objects of a straight photo."""
    spacing = pitch(chart_of(placed.pattern))
    local, step = _grid(spacing)
    cells, seen = _cells(placed, photo, local)
    shape = (len(cells), _SIDE, _SIDE)
    own = _own_ground(placed, local, spacing)
    return Sampled(cells.reshape(*shape, 3), seen.reshape(shape), own, step, spacing / step)


def _grid(spacing: float) -> tuple[Array, float]:
    """The grid's places [K, 2] about an object, in program units, and how far they are apart."""
    half = (_SIDE - 1) // 2
    step = _REACH * spacing / half
    line = (np.arange(_SIDE) - half) * step
    return np.stack(np.meshgrid(line, line), -1).reshape(-1, 2).astype(np.float64), step


def doubts(cut: Cutout) -> list[str]:
    """A sentence where what was cut out, or the ground that replaces it, is not to be relied on."""
    if not cut.clear:
        return ["no object stands out from the ground of its cell: the middle of the cell is taken for it"]
    why: list[str] = []
    if cut.uneven > _MOST_UNEVEN:
        why.append("there is no even ground between the objects")
    elif cut.room < _LEAST_ROOM and cut.uneven > _MOST_UNEVEN_THERE:
        why.append("the objects reach to their cells' borders")
    if cut.unlike > _MOST_UNLIKE:
        why.append("the objects differ much from one another")
    return [f"look at the result: {', and '.join(why)}, so pieces of others may show"] if why else []


def cutout(placed: Placed, photo: Image) -> Cutout:
    """The object that the cells of `placed` on its straight photo have in common."""
    spacing = pitch(chart_of(placed.pattern))
    local, step = _grid(spacing)
    own = _own_ground(placed, local, spacing)
    cells, seen = _cells(placed, photo, local)
    whole = seen[:, own.ravel() > 0].mean(1) > 0.98
    some = np.flatnonzero(whole)
    if not len(some):
        some = np.argsort(-seen.mean(1))[:1]
    chosen = some[np.linspace(0, len(some) - 1, min(len(some), _MOST_CELLS)).astype(int)]
    cells = _evened(cells, seen & (own.ravel() > 0), chosen)
    stacked = cells.transpose(0, 2, 1).reshape(-1, 3, _SIDE, _SIDE)
    middle, spread = median_cell(stacked, seen.reshape(-1, _SIDE, _SIDE), chosen)
    mean = np.ascontiguousarray(middle.transpose(1, 2, 0))
    apart = np.abs(cells - mean.reshape(-1, 3)).mean(2) * seen
    misfit = np.where(whole, apart[:, own.ravel() > 0].mean(1), np.inf)
    straight = Straight.of(placed, side=_SIDE, step=step)
    flat, flat_own = straight.laid(mean), straight.laid(own.astype(np.float32))
    along, found = _segmented(
        flat, straight.laid(spread.transpose(1, 2, 0)).mean(2), flat_own, straight.directions
    )
    clear = found is not None
    if found is None:
        reach = np.hypot(local[:, 0], local[:, 1]).reshape(_SIDE, _SIDE)
        disc = np.clip((_ASSUMED * spacing - reach) / (0.05 * spacing) + 0.5, 0, 1).astype(np.float32)
        found = straight.laid(disc), straight.laid(disc) > 0
    thing, with_it = found
    slip = _disc(_SLIP * spacing / step)
    with_it = (cv2.dilate(with_it.astype(np.uint8), slip) > 0) & (flat_own > 0)
    known = (flat_own > -_BORDER) & ~with_it
    # Lines go on, and where all of the ground runs along one direction, it does so under the object.
    flat_ground = through(flat, known, with_it, straight.directions)
    if along is not None:
        flat_ground = np.where(with_it[:, :, None], continued(flat, known, along[None])[1], flat_ground)
    ground = straight.bent(flat_ground)
    # A soft edge, two places wide, within the cell.
    within = np.clip(own * spacing / step + 1, 0, 1)
    alpha = (straight.bent(thing) * within).astype(np.float32)
    gone = (straight.bent(with_it.astype(np.float32)) * within).astype(np.float32)
    room = max(0.0, float(own[alpha > 0.5].min(initial=0.5)))
    uneven = _unevenness(flat, thing, flat_own, along)
    contrast = float(mean[own > 0].std(axis=0).mean())
    unlike = float(np.median(misfit[whole])) / max(contrast, 1e-6) if whole.sum() > 1 else 0.0
    return Cutout(alpha, gone, mean, ground, own, step, misfit, clear, room, uneven, unlike)


def _unevenness(mean: Floats, thing: Floats, own: Floats, along: Array | None) -> float:
    """The spread of the ground's colour at the cell's border over its distance from the object's (Lab).

    What runs `along` a direction [2] through all of the cell is even.
    """
    colours = lab_of(mean)
    rows, columns = np.nonzero((own > -_BORDER) & (own < _BORDER))
    ground, inside = colours[rows, columns], thing > 0.5
    apart = float(np.linalg.norm(colours[inside].mean(0) - ground.mean(0))) if inside.any() else 0.0
    if along is not None:
        step = along / np.hypot(*along)
        strip = np.rint(columns * step[1] - rows * step[0]).astype(int)
        strip -= strip.min()
        count = np.maximum(np.bincount(strip), 1)
        means = np.stack([np.bincount(strip, channel) / count for channel in ground.T], 1)
        ground = ground - means[strip]
    return float(np.linalg.norm(ground.std(0))) / max(apart, 1e-6)


def _own_ground(placed: Placed, local: Array, spacing: float) -> Array:
    """How far inside its own cell each place [K] lies, in distances to the next object: [side, side].

    The border is half way to the nearest other objects, drawn or not drawn, of an object in the middle.
    """
    chosen = np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T))
    frame = frames(placed)[chosen]
    points = local @ frame[:2, :2].T + frame[:2, 2]
    index = placed.index[chosen]
    near = index + np.stack(np.meshgrid([-2, -1, 0, 1, 2], [-2, -1, 0, 1, 2]), -1).reshape(-1, 2)
    others = np.concatenate([placed.at(near), placed.points])
    middle = placed.points[chosen]
    others = others[np.hypot(*(others - middle).T) > 0.3 * spacing]
    inside = np.full(len(points), np.inf)
    for other in others:
        away = other - middle
        length = float(np.hypot(*away))
        inside = np.minimum(inside, length / 2 - (points - middle) @ away / length)
    # Single rows have no neighbours across: there the cell is as wide as it is long.
    inside = np.minimum(inside, 0.5 * spacing * 1.2 - np.hypot(*(points - middle).T) * 0.8)
    return (inside / spacing).reshape(_SIDE, _SIDE)


def _cells(placed: Placed, photo: Image, local: Array) -> tuple[Floats, Mask]:
    """The colours of all objects' cells [M, K, 3] and which places are known [M, K]."""
    maps = frames(placed)
    height, width = photo.valid.shape
    values = np.zeros((len(maps), len(local), 3), np.float32)
    seen = np.zeros((len(maps), len(local)), bool)
    valid = photo.valid.astype(np.float32)
    levels = Levels.of(photo.pixels)
    for number, frame in enumerate(maps):
        at, front = project(placed.image_from_plane, local @ frame[:2, :2].T + frame[:2, 2])
        inside = front & (at >= 0).all(1) & (at[:, 0] <= width - 1) & (at[:, 1] <= height - 1)
        x, y = np.where(inside[:, None], at, 0).astype(np.float32).T.reshape(2, 1, -1)
        apart = np.hypot(*np.diff(at.reshape(_SIDE, _SIDE, 2)[_SIDE // 2], axis=0).T)
        shrink = float(np.median(apart))
        values[number] = levels.read(np.stack([x[0], y[0]], 1), shrink)
        seen[number] = inside & (cv2.remap(valid, x, y, cv2.INTER_LINEAR)[0] > 0.99)
    return values, seen


def _evened(cells: Floats, seen: Mask, chosen: NDArray[np.int64]) -> Floats:
    """The cells in the light of their median: each is multiplied by one gain a channel."""
    weight = seen[:, :, None].astype(np.float32)
    means = (cells * weight).sum(1) / np.maximum(weight.sum(1), 1) + 0.02
    gain = np.median(means[chosen], axis=0) / means
    return cells * np.clip(gain, 0.4, 2.5)[:, None].astype(np.float32)


def _segmented(
    mean: Floats, spread: Floats, own: Floats, directions: Array
) -> tuple[Array | None, tuple[Floats, Mask] | None]:
    """How much each place of the median cell is object, and what goes with it, both [side, side].

    None where nothing stands out. First the direction [2] along which the ground runs, if it does.
    """
    ground = (own > -_BORDER) & (own < _BORDER)
    inner = own > 0
    colours = lab_of(mean)
    ways = [np.sqrt(((colours - under) ** 2).sum(2)) for under in continued(colours, ground, directions)]
    ways.append(np.minimum.reduce(ways))
    # By the places that are told best: the object tells nothing of its ground.
    most = int(_TOLD * inner.sum())
    told = [np.sort(way[inner])[:most].mean() + _FAINT for way in ways]
    shares = (1.0, *[_STRAIGHT] * len(directions), _CROSSED)
    costs = [float(one) / share for one, share in zip(told, shares, strict=True)]
    best = int(np.argmin(costs))
    apart, along = ways[best], directions[best - 1] if 0 < best <= len(directions) else None
    under = _smoothed_over(colours, ground)
    # Ground that differs much within the border, or from cell to cell, is none.
    noise = max(float(np.median(under[ground])), 100 * float(np.median(spread[ground])))
    level = _divide(apart[inner])
    if level < max(_LEAST_CONTRAST, _DEVIATIONS * noise):
        return along, None
    core = ((apart > level) & inner).astype(np.uint8)
    core = cv2.morphologyEx(core, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    places = own.shape[0] / (2 * _REACH)  # of the grid, from one object to the next
    whole = _hull(_loose(core, own * places)) & inner
    share = float(whole.sum() / inner.sum())
    if not _LEAST_SHARE <= share <= _MOST_SHARE:
        return along, None
    # Where cells differ beside an object its edge slips.
    differs = np.maximum(apart, _SLIPPED * 100 * spread)
    seen = (differs > max(_JUST_SEEN, _SEEN_DEVIATIONS * noise)) & inner
    seen = cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_OPEN, _disc(1)) > 0
    seen &= cv2.dilate(whole.astype(np.uint8), _disc(_HANGS_ON * places)) > 0
    labels = cv2.connectedComponents((seen | whole).astype(np.uint8), connectivity=4)[1]
    with_it = np.isin(labels, np.unique(labels[whole])) & (labels > 0)
    soft = np.asarray(cv2.GaussianBlur(whole.astype(np.float32), (0, 0), 0.8), np.float32)
    return along, (soft, with_it)


def _smoothed_over(colours: Floats, ground: Mask) -> Array:
    """How far the ground's colours [side, side, 3] lie from their own smooth continuation: [side, side]."""
    under = cv2.GaussianBlur(filled(colours, ground), (0, 0), 0.06 * colours.shape[0] / (2 * _REACH))
    return np.sqrt(((colours - under) ** 2).sum(2))


def _disc(radius: float) -> NDArray[np.uint8]:
    """A disc of at least one place around its middle."""
    size = 2 * max(1, round(radius)) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


def _loose(core: NDArray, depth: Array) -> Mask:
    """The parts that do not run on over the border of the cell, `depth` places away; all, if none is left.

    What does run on, as the rim of a clock does behind its numbers, is no object of this cell alone.
    """
    count, labels = cv2.connectedComponents(core, connectivity=8)
    kept = np.zeros(core.shape, bool)
    for label in range(1, count):
        part = labels == label
        if depth[part].min() > 1.5 and part.sum() >= _LEAST_PART:
            kept |= part
    return kept if kept.sum() >= _LOOSE_SHARE * core.sum() else core > 0


def _hull(mask: Mask) -> Mask:
    """The convex hull of a mask: what lies in an object's bays and holes goes with it."""
    rows, columns = np.nonzero(mask)
    filled_hull = np.zeros(mask.shape, np.uint8)
    if len(rows):
        corners = cv2.convexHull(np.stack([columns, rows], 1).astype(np.int32))
        cv2.fillConvexPoly(filled_hull, corners, 1)
    return filled_hull > 0


def _divide(values: Array) -> float:
    """The level that splits values best in two (Otsu), pulled down to a third of the way between both."""
    ordered = np.sort(values.ravel().astype(float))
    sums, count = np.cumsum(ordered), len(ordered)
    below = np.arange(1, count)
    low, high = sums[:-1] / below, (sums[-1] - sums[:-1]) / (count - below)
    best = int(np.argmax(below * (count - below) * (high - low) ** 2))
    return float(low[best] + (high[best] - low[best]) / 3)

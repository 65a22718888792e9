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
from p3i.paint.fill.sampled import REACH, SIDE, sampled_cells
from p3i.paint.fill.through import continuations, through
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed
from p3i.vision.cells import median_cell
from p3i.vision.fill import filled
from p3i.vision.image import Image
from p3i.vision.lab import lab_of
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

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
# Ratios of colours are those of colours so much lighter: black has none. So many places of the grid and more
# must show the same thing twice to tell how light rises.
_DARK, _LEAST_SHARED = 0.02, 8
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
    sampled = sampled_cells(placed, photo)
    own, step = sampled.own, sampled.step
    cells, seen = sampled.cells.reshape(len(placed.index), -1, 3), sampled.seen.reshape(len(placed.index), -1)
    whole = seen[:, own.ravel() > 0].mean(1) > 0.98
    some = np.flatnonzero(whole)
    if not len(some):
        some = np.argsort(-seen.mean(1))[:1]
    chosen = some[np.linspace(0, len(some) - 1, min(len(some), _MOST_CELLS)).astype(int)]
    cells = _evened(cells, seen & (own.ravel() > 0), chosen)
    stacked = cells.transpose(0, 2, 1).reshape(-1, 3, SIDE, SIDE)
    middle, spread = median_cell(stacked, seen.reshape(-1, SIDE, SIDE), chosen)
    mean = np.ascontiguousarray(middle.transpose(1, 2, 0))
    apart = np.abs(cells - mean.reshape(-1, 3)).mean(2) * seen
    misfit = np.where(whole, apart[:, own.ravel() > 0].mean(1), np.inf)
    straight = Straight.of(placed, side=SIDE, step=step)
    flat, flat_own = straight.laid(_level(mean, placed, step)), straight.laid(own.astype(np.float32))
    along, found = _segmented(
        flat, straight.laid(spread.transpose(1, 2, 0)).mean(2), flat_own, straight.directions
    )
    clear = found is not None
    if found is None:
        y, x = (np.mgrid[:SIDE, :SIDE] - (SIDE - 1) // 2) * step
        reach = np.hypot(x, y)
        disc = np.clip((_ASSUMED * spacing - reach) / (0.05 * spacing) + 0.5, 0, 1).astype(np.float32)
        found = straight.laid(disc), straight.laid(disc) > 0
    thing, with_it = found
    slip = _disc(_SLIP * spacing / step)
    with_it = (cv2.dilate(with_it.astype(np.uint8), slip) > 0) & (flat_own > 0)
    known = (flat_own > -_BORDER) & ~with_it
    # Lines go on, and where all of the ground runs along one direction, it does so under the object.
    flat_ground = through(flat, known, with_it, straight.directions)
    if along is not None:
        flat_ground = np.where(with_it[:, :, None], continuations(flat, known, along[None])[1], flat_ground)
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


def _level(mean: Floats, placed: Placed, step: float) -> Floats:
    """The median cell without light that rises over the photo: what stands one step apart is the same.

    Only of a lattice; the light, linear in logarithms, is told by where the grid shows a place and its like.
    """
    if placed.basis is None:
        return mean
    middle = placed.index[np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T))]
    around = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2), -1).reshape(-1, 2)
    steps = (placed.at(middle + around) - placed.at(middle[None])) / step
    logs, slopes, rises = np.log(np.maximum(mean, 0) + np.float32(_DARK)), [], []
    for x, y in np.rint(steps).astype(int)[len(steps) // 2 + 1 :]:
        if max(abs(x), abs(y)) > SIDE - _LEAST_SHARED:
            continue
        here = logs[max(0, -y) : SIDE - max(0, y), max(0, -x) : SIDE - max(0, x)]
        there = logs[max(0, y) : SIDE + min(0, y), max(0, x) : SIDE + min(0, x)]
        slopes.append((x, y))
        rises.append(np.median((there - here).reshape(-1, 3), axis=0))
    if np.linalg.matrix_rank(np.array(slopes).reshape(-1, 2)) < 2:
        return mean
    slope = np.linalg.lstsq(np.array(slopes, float), np.array(rises), rcond=None)[0]
    y, x = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) // 2
    rise = np.stack([x, y], -1) @ slope
    return np.asarray((mean + _DARK) * np.exp(-rise) - _DARK, np.float32)


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
    ways = [np.sqrt(((colours - under) ** 2).sum(2)) for under in continuations(colours, ground, directions)]
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
    places = own.shape[0] / (2 * REACH)  # of the grid, from one object to the next
    whole = _hull(_loose(core, own * places)) & inner
    share = float(whole.sum() / inner.sum())
    if not _LEAST_SHARE <= share <= _MOST_SHARE:
        return along, None
    # Where cells differ beside an object more than their ground does, its edge slips.
    slips = np.sqrt(np.maximum(spread**2 - np.median(spread[ground]) ** 2, 0))
    differs = np.maximum(apart, _SLIPPED * 100 * slips)
    seen = (differs > max(_JUST_SEEN, _SEEN_DEVIATIONS * noise)) & inner
    seen = cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_OPEN, _disc(1)) > 0
    seen &= cv2.dilate(whole.astype(np.uint8), _disc(_HANGS_ON * places)) > 0
    labels = cv2.connectedComponents((seen | whole).astype(np.uint8), connectivity=4)[1]
    with_it = np.isin(labels, np.unique(labels[whole])) & (labels > 0)
    soft = np.asarray(cv2.GaussianBlur(whole.astype(np.float32), (0, 0), 0.8), np.float32)
    return along, (soft, with_it)


def _smoothed_over(colours: Floats, ground: Mask) -> Array:
    """How far the ground's colours [side, side, 3] lie from their own smooth continuation: [side, side]."""
    under = cv2.GaussianBlur(filled(colours, ground), (0, 0), 0.06 * colours.shape[0] / (2 * REACH))
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

"""Filling from aligned cells: each hidden cell becomes a mean of its sources, weighted by what they say
around it.

The plane is split by the program's objects, and each cell's hidden part has a stack of its own (sources.py):
other cells that show it, wholly or half of it each. The weights are those under which they together come
closest to the photo around the part, drawn towards trusting each by its own misfit. Deep in a hole, where
nothing is seen around, light and shift are told by all cells of the photo (survey.py), never by what was
filled before. Cells go over into each other softly; what still differs at the hole's rim is carried into it
smoothly.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W], True is to be filled.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.ground import Ground
from p3i.paint.fill.light import MOST_CARRIED, carried_into, rim_of
from p3i.paint.fill.matching import trusted
from p3i.paint.fill.mixing import GRAIN_REACH_PX, feathered, painted
from p3i.paint.fill.pieces import Labels, Piece, drawn_on, padded, pieces_of
from p3i.paint.fill.scattered import Scattered, near_rims
from p3i.paint.fill.sources import MOST_TRIED, Hole, Source, hole_of, shown_elsewhere, sources
from p3i.paint.fill.summed import summed
from p3i.paint.fill.survey import Survey, survey_of
from p3i.place.moves import nearest_px, pitch_px
from p3i.place.placed import Placed
from p3i.vision.fill import fill_in
from p3i.vision.planes import put, three
from p3i.vision.strips import Window, clipped, strips_of, wider_by, within
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# The rim at which the fill is compared with the photo, in pixels.
_RIM_PX = 4
# So far from what is known a bicubic sample of it reads.
_READ_PX = 2
# Cells go over into each other, and sources fade, within this share of the distance to the next object.
_FADING = 0.08
# So many pixels of a piece are painted at once, and so many such parts tell how much grain all of it needs.
_MOST_PX, _ASKED = 2_000_000, 3
# Beyond its drawn ground the pattern goes on where it is off, around the hole, by this share of what else is.
_GOES_ON = 0.6
# A pixel is shown where the weights of its sources come to this.
_SHOWN = 1e-6


def fill_by_stack(
    pixels: Floats,
    known: Mask,
    hole: Mask,
    placed: Placed,
    *,
    most_tried: int = MOST_TRIED,
    progress: Progress | None = None,
) -> tuple[Floats, Mask]:
    """The photo with its hole filled, and where nothing like the hole was found [H, W].

    What is not `known` is no source, and is not filled either unless the hole holds it. Where no source shows
    a pixel, the surroundings are continued smoothly. Fewer objects tried for each piece is faster.
    """
    result = pixels.copy()
    return result, fill_in_place(result, known, hole, placed, most_tried=most_tried, progress=progress)


def fill_in_place(
    pixels: Floats,
    known: Mask,
    hole: Mask,
    placed: Placed,
    *,
    most_tried: int = MOST_TRIED,
    progress: Progress | None = None,
) -> Mask:
    """Do as `fill_by_stack` with the `pixels` [H, W, 3] themselves; `known` and `hole` are [H, W].

    Returns where nothing like the hole was found [H, W].
    """
    known = known & ~hole
    pixels[hole] = 0  # what is hidden leaves no trace in what is mixed with its neighbours
    shown, rim = _filled(pixels, known, hole, placed, most_tried, progress)
    _carry_rim(pixels, rim, hole, placed)
    filled = hole & shown
    for rows in strips_of(len(hole)):
        put(np.clip(pixels[rows], 0, 1), pixels[rows], filled[rows])
    bare = hole & ~shown
    if bare.any():
        fill_in(pixels, known | filled, bare)
    return bare


def unlike(pixels: Floats, known: Mask, hole: Mask, placed: Placed) -> Mask:
    """Where a hole [H, W] is like nothing that the program shows elsewhere on the photo: [H, W]."""
    known = known & ~hole
    ground = Ground.of(pixels, known)
    found = np.zeros_like(hole)
    pieces, labels = pieces_of(hole, drawn_on(placed), placed)
    for piece in pieces:
        points = _points(piece, labels, hole)
        columns, rows = points.astype(int).T
        one = hole_of(points, pixels, known, placed, target=piece.target)
        found[rows, columns] = ~shown_elsewhere(one, ground, placed)
    return found


def _points(piece: Piece, labels: Labels, hole: Mask) -> Array:
    """The pixels [L, 2] of a piece."""
    left, top, right, bottom = piece.box
    here = (labels[top:bottom, left:right] == piece.number) & hole[top:bottom, left:right]
    return (np.argwhere(here)[:, ::-1] + np.array([left, top])).astype(float)


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """A piece, the sources that it is filled from and how much each counts, [S].

    They show what lies on `allowed` ground [H, W], None is all, and fade over `fading_px`; the piece's
    `window` holds as much around it.
    """

    piece: Piece
    found: list[Source]
    weights: Array
    allowed: NDArray[np.uint8] | None
    window: Window
    fading_px: int


def _filled(
    pixels: Floats, known: Mask, hole: Mask, placed: Placed, most: int, progress: Progress | None
) -> tuple[Mask, Scattered]:
    """Fill the hole of `pixels`, 0 in it, and say what was shown at all [H, W], and what would be on its rim.

    First all pieces are planned, then they are painted: so none reads what another was filled with.
    """
    ground, drawn = Ground.of(pixels, known), drawn_on(placed)
    pieces, labels = pieces_of(hole, drawn, placed)
    allowed = drawn, 1 - drawn if any(piece.beyond for piece in pieces) else drawn
    survey = survey_of(pixels, known, placed)

    def told(done: float, of: int) -> None:
        if progress is not None:
            progress("filling", done / (2 * of))

    plans: list[_Plan] = []
    for done, piece in enumerate(pieces):
        told(done, len(pieces))
        one = hole_of(_points(piece, labels, hole), pixels, known, placed, target=piece.target)
        plan = _planned(piece, one, ground, allowed[piece.beyond], placed, survey, most=most)
        if plan is not None:
            plans.append(plan)

    def added() -> Iterator[tuple[Window, tuple[Floats, Floats]]]:
        grains = [_grain(plan, labels, ground, hole) for plan in plans]
        parts = [(part, number) for number, plan in enumerate(plans) for part in _parts(plan)]
        for done, (part, number) in enumerate(sorted(parts, key=lambda one: one[0][0].start)):
            told(len(parts) + done, len(parts))
            colours, share, _ = _painted(plans[number], part, labels, ground, hole, grains[number])
            yield part, (colours, share)

    shown, edges = np.zeros_like(hole), list[Scattered]()
    for strip in summed(hole.shape, added()):
        shown[strip.rows] = found = strip.weight > _SHOWN
        strip.total[...] /= three(np.maximum(strip.weight, _SHOWN))
        # What sources are read with where known ground ends stays 0 until all pieces are painted.
        edge = near_rims(hole, strip.rows, outwards=_RIM_PX, inwards=_READ_PX)
        edges.append(Scattered.of(strip.total, edge & found, top=strip.rows.start))
        inner = hole[strip.rows] & found & ~edge
        put(strip.total, pixels[strip.rows], inner)
    edge = Scattered.joined(edges)
    edge.part(hole).write_to(pixels)
    return shown, edge.part(~hole & (ground.sure > 0))


def _planned(
    piece: Piece,
    one: Hole,
    ground: Ground,
    allowed: NDArray[np.uint8] | None,
    placed: Placed,
    survey: Survey | None,
    *,
    most: int,
) -> _Plan | None:
    """How a piece is to be filled; None where nothing is like it."""
    if piece.beyond and not one.weights.any():
        return None
    found = sources(one, ground, placed, most=most, survey=survey, allowed=allowed)
    weights = weighed(one, ground, found)
    if piece.beyond:
        # A program may end before its pattern does: what lies around decides.
        either = sources(one, ground, placed, most=most, survey=survey)
        either_weights = weighed(one, ground, either)
        if _off(one, ground, either, either_weights) < _GOES_ON * _off(one, ground, found, weights):
            found, weights, allowed = either, either_weights, None
    if not found:
        return None
    radius = max(1, round(_FADING * one.spacing_px))
    left, top, right, bottom = piece.box
    window = wider_by((slice(top, bottom), slice(left, right)), radius + _RIM_PX + 1, ground.sure.shape)
    return _Plan(piece, found, weights, allowed, window, radius)


def _parts(plan: _Plan) -> list[Window]:
    """The window of a plan in strips of no more pixels than are painted at once."""
    rows, columns = plan.window
    most = max(1, _MOST_PX // (columns.stop - columns.start))
    count = -(-(rows.stop - rows.start) // most)
    ends = np.linspace(rows.start, rows.stop, count + 1).astype(int).tolist()
    return [(slice(*part), columns) for part in pairwise(ends)]


def _grain(plan: _Plan, labels: Labels, ground: Ground, hole: Mask) -> float | None:
    """How much grain a piece needs that is painted in parts, told by some of them; None for one part."""
    parts = _parts(plan)
    if len(parts) == 1:
        return None
    some = [parts[place] for place in np.linspace(0, len(parts) - 1, min(len(parts), _ASKED)).astype(int)]
    return float(np.median([_painted(plan, part, labels, ground, hole)[2] for part in some]))


def _painted(
    plan: _Plan, part: Window, labels: Labels, ground: Ground, hole: Mask, grain: float | None = None
) -> tuple[Floats, Floats, float]:
    """A piece's colours [h, w, 3] in a part of its window, their weight [h, w], and how much grain it is."""
    rows, columns = wider = clipped(
        wider_by(part, max(GRAIN_REACH_PX, plan.fading_px), hole.shape), plan.window
    )
    own = labels[wider] == plan.piece.number
    colours, sure, given = painted(
        ground,
        plan.found,
        plan.weights,
        own & hole[wider],
        corner=(columns.start, rows.start),
        drawn=plan.allowed,
        fading_px=plan.fading_px,
        grain=grain,
    )
    inner = within(part, wider)
    share = feathered(own, plan.fading_px) * (sure > _SHOWN)
    return colours[inner], share[inner], given


def weighed(hole: Hole, ground: Ground, found: list[Source]) -> Array:
    """How much each source counts, [S], together 1: least squares on the surroundings, drawn to a prior."""
    misfits = np.array([source.misfit for source in found])
    if not found:
        return misfits
    if not hole.weights.any():
        return trusted(np.zeros((len(found), 0, 3)), hole.weights, misfits)
    residuals, _ = _around(hole, ground, found)
    return trusted(residuals, hole.weights, misfits, share=hole.share)


def _off(hole: Hole, ground: Ground, found: list[Source], weights: Array) -> float:
    """How much the mean of sources differs from what lies around a hole; inf where they show none of it."""
    if not found:
        return np.inf
    residuals, shown = _around(hole, ground, found)
    counts = (weights[:, None] * shown).sum(0)
    off = np.abs((weights[:, None, None] * residuals).sum(0) / np.maximum(counts, _SHOWN)[:, None]).mean(1)
    told = hole.weights * (counts > _SHOWN)
    return float((told * off).sum() / told.sum()) if told.any() else np.inf


def _around(hole: Hole, ground: Ground, found: list[Source]) -> tuple[Array, Mask]:
    """What sources differ by from what lies around a hole [S, K, 3], 0 where they show none, and where they
    do [S, K].
    """
    residuals, shown = [], []
    for source in found:
        at, front = source.where(hole.around)
        colours = source.gain * taken(ground.pixels, at) + source.offset
        shown.append(front & ground.known(at))
        residuals.append(np.where(shown[-1][:, None], colours - hole.colours, 0))
    return np.stack(residuals), np.stack(shown)


def _carry_rim(pixels: Floats, rim: Scattered, hole: Mask, placed: Placed) -> None:
    """Add to the fill of each hole what the photo differs by from it at its rim, carried inwards.

    `rim` has what the fill would be there.
    """
    rim = Scattered(
        rim.rows, rim.columns, np.clip(rim.shown_by(pixels) - rim.colours, -MOST_CARRIED, MOST_CARRIED)
    )
    _, parts, boxes, middles = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)
    for number in range(1, len(boxes)):
        left, top, right, bottom = padded(boxes[number], hole.shape, by_px=_RIM_PX + 1)
        own = parts[top:bottom, left:right] == number
        read = partial(_rim_in, own=own, rim=rim, corner=(left, top))
        spacing = pitch_px(placed, nearest_px(placed, middles[number]))
        for window, lift in carried_into(read, own, spacing_px=spacing):
            here = pixels[top:bottom, left:right][window]
            lift += here
            put(lift, here, own[window])


def _rim_in(window: Window, own: Mask, rim: Scattered, corner: tuple[int, int]) -> tuple[Floats, Mask]:
    """What the rim of one hole lacks in a window of a larger one, [h, w, 3], and where that rim is [h, w].

    The larger one lies at `corner`; `own` [H, W] is the hole there.
    """
    wider = wider_by(window, _RIM_PX + 1, own.shape)
    off, told = rim.read(wider, corner)
    inner = within(window, wider)
    if told.any():
        rim_here = rim_of(own[wider], told, reach_px=_RIM_PX)
        off[told & ~rim_here] = 0
        told = rim_here
    return off[inner], told[inner]

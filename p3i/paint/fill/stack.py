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

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.ground import Ground
from p3i.paint.fill.light import MOST_CARRIED, carried, rim_of
from p3i.paint.fill.matching import trusted
from p3i.paint.fill.mixing import feathered, painted
from p3i.paint.fill.pieces import Piece, drawn_on, padded, pieces_of
from p3i.paint.fill.sources import MOST_TRIED, Hole, Source, hole_of, shown_elsewhere, sources
from p3i.paint.fill.survey import Survey, survey_of
from p3i.place.moves import nearest_px, pitch_px
from p3i.place.placed import Placed
from p3i.vision.fill import fill_in
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# The rim at which the fill is compared with the photo, in pixels.
_RIM_PX = 4
# Cells go over into each other, and sources fade, within this share of the distance to the next object.
_FADING = 0.08
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
    known = known & ~hole
    result = pixels.copy()
    result[hole] = 0  # nor does what is hidden leave a trace in rounding
    ground = Ground.of(result, known)
    drawn = drawn_on(placed)
    pieces, labels = pieces_of(hole, drawn, placed)
    survey = survey_of(result, known, placed)
    total, weight = np.zeros_like(result), np.zeros(hole.shape, np.float32)
    for done, piece in enumerate(pieces):
        if progress is not None:
            progress("filling", done / len(pieces))
        _fill(piece, labels, ground, known, hole, drawn, placed, survey, total, weight, most=most_tried)
    shown = weight > _SHOWN
    total /= np.maximum(weight, _SHOWN)[:, :, None]
    sure = ground.sure
    del ground, labels, drawn, weight  # a large photo's are much
    _carry_rim(total, shown, result, sure, hole, placed)
    filled = hole & shown
    np.copyto(result, np.clip(total, 0, 1, out=total), where=filled[:, :, None])
    bare = hole & ~shown
    if bare.any():
        fill_in(result, known | filled, bare)
    return result, bare


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


def _points(piece: Piece, labels: NDArray[np.int32], hole: Mask) -> Array:
    """The pixels [L, 2] of a piece."""
    left, top, right, bottom = piece.box
    here = (labels[top:bottom, left:right] == piece.number) & hole[top:bottom, left:right]
    return (np.argwhere(here)[:, ::-1] + np.array([left, top])).astype(float)


def _fill(
    piece: Piece,
    labels: NDArray[np.int32],
    ground: Ground,
    known: Mask,
    hole: Mask,
    drawn: NDArray[np.uint8],
    placed: Placed,
    survey: Survey | None,
    total: Floats,
    weight: Floats,
    *,
    most: int,
) -> None:
    """Add a piece's colours to the total [H, W, 3], times its weight, which is added to the weight [H, W]."""
    points = _points(piece, labels, hole)
    one = hole_of(points, ground.pixels, known, placed, target=piece.target)
    if piece.beyond and not one.weights.any():
        return
    allowed = 1 - drawn if piece.beyond else drawn
    found = sources(one, ground, placed, most=most, survey=survey, allowed=allowed)
    weights = weighed(one, ground, found)
    if piece.beyond:
        # A program may end before its pattern does: what lies around decides.
        either = sources(one, ground, placed, most=most, survey=survey)
        either_weights = weighed(one, ground, either)
        if _off(one, ground, either, either_weights) < _GOES_ON * _off(one, ground, found, weights):
            found, weights, allowed = either, either_weights, None
    if not found:
        return
    radius = max(1, round(_FADING * one.spacing_px))
    margin = radius + _RIM_PX + 1
    height, width = hole.shape
    left, top = max(0, piece.box[0] - margin), max(0, piece.box[1] - margin)
    right, bottom = min(width, piece.box[2] + margin), min(height, piece.box[3] + margin)
    window = (slice(top, bottom), slice(left, right))
    own = labels[window] == piece.number
    colours, sure = painted(
        ground,
        found,
        weights,
        own & hole[window],
        corner=(left, top),
        drawn=allowed,
        fading_px=radius,
    )
    share = feathered(own, radius) * (sure > _SHOWN)
    total[window] += colours * share[..., None]
    weight[window] += share


def weighed(hole: Hole, ground: Ground, found: list[Source]) -> Array:
    """How much each source counts, [S], together 1: least squares on the surroundings, drawn to a prior."""
    misfits = np.array([source.misfit for source in found])
    if not found:
        return misfits
    if not hole.weights.any():
        return trusted(np.zeros((len(found), 0, 3)), hole.weights, misfits)
    residuals = []
    for source in found:
        at, front = source.where(hole.around)
        colours = source.gain * taken(ground.pixels, at) + source.offset
        shown = (front & ground.known(at))[:, None]
        residuals.append(np.where(shown, colours - hole.colours, 0))
    return trusted(np.stack(residuals), hole.weights, misfits, share=hole.share)


def _off(hole: Hole, ground: Ground, found: list[Source], weights: Array) -> float:
    """How much the mean of sources differs from what lies around a hole; inf where they show none of it."""
    total, shown = np.zeros_like(hole.around, shape=hole.colours.shape), np.zeros(len(hole.around))
    for source, weight in zip(found, weights, strict=True):
        at, front = source.where(hole.around)
        counts = weight * (front & ground.known(at))
        total += counts[:, None] * (source.gain * taken(ground.pixels, at) + source.offset)
        shown += counts
    off = np.abs(total / np.maximum(shown, _SHOWN)[:, None] - hole.colours).mean(1)
    told = hole.weights * (shown > _SHOWN)
    return float((told * off).sum() / told.sum()) if told.any() else np.inf


def _carry_rim(total: Floats, shown: Mask, pixels: Floats, sure: Floats, hole: Mask, placed: Placed) -> None:
    """Add to the fill `total` what the photo differs by from it at the hole's rim, carried inwards."""
    _, parts, boxes, middles = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)
    for number in range(1, len(boxes)):
        left, top, right, bottom = padded(boxes[number], hole.shape, by_px=_RIM_PX + 1)
        window = (slice(top, bottom), slice(left, right))
        inside = (parts[window] == number).astype(np.uint8)
        rim = rim_of(inside, (sure[window] > 0) & shown[window], reach_px=_RIM_PX)
        if not rim.any():
            continue
        spacing = pitch_px(placed, nearest_px(placed, middles[number]))
        off = np.zeros((*rim.shape, 3), np.float32)
        off[rim] = np.clip(pixels[window][rim] - total[window][rim], -MOST_CARRIED, MOST_CARRIED)
        lift = carried(off, rim.astype(np.float32), spacing_px=spacing)
        del off
        np.add(total[window], lift, out=total[window], where=inside[..., None] > 0)

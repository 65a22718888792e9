"""Where else on the photo the same is to be seen: a hole's sources, laid upon it by the program.

A source is the ground of another object, brought over by the program's own move (place/moves.py). Around the
hole source and photo show the same, so there the source is shifted by the little that the program is off
(Lucas and Kanade, IJCAI 1981), its light is matched, and its misfit tells how far to believe it inside.

Convention: points are pixels of the photo [L, 2]; colours RGB in 0..1.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.ground import DEEPEST_PX, Ground
from p3i.paint.fill.light import matched_light
from p3i.paint.fill.matching import aligned
from p3i.paint.fill.survey import Survey
from p3i.place.moves import moves, nearest, nearest_px, pitch_px
from p3i.place.placed import Placed
from p3i.vision.sheet import project
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# The surroundings that a hole is judged by reach this far, in distances to the next object.
_MARGIN = 0.4
_MOST_SURROUNDING = 2000
# What all cells tell counts as much as this share of the surroundings.
_ALL_CELLS = 0.1
# The nearer to the hole, the more a place tells: weights fall to 1/e over this share of the margin.
_FADING = 0.4
# So many of the nearest objects are tried, and so many of the best kept, ...
MOST_TRIED = 80
_MOST_KEPT = 12
# ... none with a misfit above this many times the best's; a source shows this much of hole and surroundings.
_WORSE = 1.6
_WORSE_ANYWAY = 0.002
_LEAST_OF_HOLE, _LEAST_AROUND = 0.05, 0.25
# So many of those that are likest as the program lays them are shifted and lit.
_TRIED_FINELY = 24
# A source lies on drawn ground where an object is as near as this, in distances; so must this share of it.
_GROUND = 0.75
_LEAST_ON_GROUND = 0.6
_PROBES = 256
# Shifts reach this far, in distances to the next object.
_MOST_SHIFT = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class Hole:
    """One piece of what is to be filled, seen from the object `target` in its middle.

    `points` [L, 2] are its pixels; `around` [K, 2] pixels beside it, with `weights` [K] by nearness and the
    `colours` [K, 3] that the photo has there. `spacing_px` is how far the next object lies, `surrounded`
    (0..1) how much of the surroundings is known.
    """

    target: int
    points: Array
    around: Array
    weights: Floats
    colours: Floats
    spacing_px: float
    surrounded: float = 1.0

    @property
    def share(self) -> float:
        """How much what lies around counts beside what all cells tell: half where a tenth of it is known."""
        return _beside_all_cells(self.surrounded)


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A source of a hole: the photo's matrix `from_hole` [3, 3] and `shift_px` [2] take a pixel to its like.

    `gain` and `offset` [3] bring its colours to the hole's light; `misfit` is the mean difference around.
    `number` is the object whose ground it is.
    """

    from_hole: Array
    shift_px: Array
    gain: Array
    offset: Array
    misfit: float
    number: int = -1

    def where(self, points: Array) -> tuple[Array, Mask]:
        """The points [L, 2] like these, and which lie in front of the camera."""
        at, front = project(self.from_hole, points)
        return at + self.shift_px, front

    def window(
        self,
        ground: Ground,
        corner: tuple[int, int],
        size: tuple[int, int],
        *,
        drawn: NDArray[np.uint8] | None,
        fading_px: float,
    ) -> tuple[Floats, Floats] | None:
        """What it shows in a window at `corner` of `size` (width, height), in the hole's light: [h, w, 3].

        And how far that is known, [h, w] in 0..1: it fades over `fading_px` where known ground ends, and is 0
        where `drawn` [H, W] is. None where nothing is known.
        """
        matrix = np.eye(3)
        matrix[:2, 2] = self.shift_px
        matrix = matrix @ self.from_hole
        matrix[:, 2] += matrix[:, :2] @ corner
        ends = np.array([(0, 0), (size[0], 0), (0, size[1]), size], float)
        if not project(matrix, ends)[1].all():
            return None

        def read(plane: NDArray, how: int, border: int) -> NDArray:
            flags = how | cv2.WARP_INVERSE_MAP
            return np.asarray(cv2.warpPerspective(plane, matrix, size, flags=flags, borderMode=border))

        known = read(ground.inwards, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT).astype(np.float32)
        np.minimum(known / np.float32(max(1.0, min(fading_px, DEEPEST_PX))), 1, out=known)
        if drawn is not None:
            known *= read(drawn, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT)
        if not known.any():
            return None
        colours = read(ground.pixels, cv2.INTER_CUBIC, cv2.BORDER_REPLICATE)
        lit = cv2.transform(colours, np.column_stack([np.diag(self.gain), self.offset]))
        return np.asarray(lit, np.float32), known


def hole_of(points: Array, shown: Floats, known: Mask, placed: Placed, *, target: int | None = None) -> Hole:
    """A piece of the hole, its pixels [L, 2], with its surroundings: what is `known` [H, W] of `shown`.

    It is seen from the object `target`, without one from that nearest to its middle.
    """
    if target is None:
        target = nearest_px(placed, points.mean(0))
    spacing = pitch_px(placed, target)
    margin = max(4, round(_MARGIN * spacing))
    low = np.maximum(points.min(0).astype(int) - margin, 0)
    high = points.max(0).astype(int) + margin + 1
    free = known[low[1] : high[1], low[0] : high[0]]
    outside = np.ones(free.shape, np.uint8)
    columns, rows = (points - low).astype(np.int32).T
    outside[rows, columns] = 0
    distance = cv2.distanceTransform(outside, cv2.DIST_L2, 5)
    near = (distance <= margin) & (outside > 0)
    surroundings = np.exp(-distance[near] / (_FADING * margin))
    surrounded = float(surroundings[free[near]].sum() / max(float(surroundings.sum()), 1e-9))
    near_rows, near_columns = np.nonzero(near & free)
    spread = np.linspace(0, len(near_rows) - 1, min(len(near_rows), _MOST_SURROUNDING)).astype(int)
    near_rows, near_columns = near_rows[spread], near_columns[spread]
    weights = np.exp(-distance[near_rows, near_columns] / (_FADING * margin)).astype(np.float32)
    around = np.stack([near_columns, near_rows], 1) + low
    colours = shown[around[:, 1], around[:, 0]]
    return Hole(target, points, around.astype(float), weights, colours, spacing, surrounded)


def sources(
    hole: Hole,
    ground: Ground,
    placed: Placed,
    *,
    most: int = MOST_TRIED,
    kept: int = _MOST_KEPT,
    survey: Survey | None = None,
    allowed: NDArray[np.uint8] | None = None,
) -> list[Source]:
    """The sources of a hole among the `most` nearest objects, the likest first, so many as are `kept`.

    What the hole's surroundings do not tell of light, shift and likeness, the `survey` does; without either
    there are none, as where the program draws nothing like the hole in sight. Where none of those kept
    shows a part of the hole, further ones do. What they show lies on `allowed` ground, 1 [H, W]; without it
    those that would bring in ground where nothing is drawn are left out.
    """
    if not len(hole.around) and survey is None:
        return []
    asked = hole.points[:: max(1, len(hole.points) // _PROBES)]
    misfits = np.full(len(placed.points), np.inf) if survey is None else survey.misfits(hole.target)
    tried: list[_Tried] = []
    for number, matrix in _laid_on(hole, ground, placed, most=most, survey=survey, checked=allowed is None):
        at, front = project(matrix, asked)
        shown = front & ground.known(at)
        if allowed is not None:
            columns, rows = np.rint(np.clip(at, 0, np.array(allowed.shape[::-1]) - 1)).astype(int).T
            shown &= allowed[rows, columns] > 0
        if shown.mean() < _LEAST_OF_HOLE:
            continue
        expected = _expected_misfit(hole, matrix, float(misfits[number]))
        around, share = _first_misfit(hole, ground, matrix, number, survey)
        if np.isfinite(expected) or share:
            tried.append(_Tried(number, matrix, shown, around, share, expected))
    found = sorted(_on_one_scale(tried), key=_Tried.misfit)
    finely = max(_TRIED_FINELY, kept)

    def fine(one: _Tried) -> Source:
        return _aligned(hole, ground, one, survey)

    alike = sorted(((fine(one), one.shown) for one in found[:finely]), key=lambda one: one[0].misfit)
    result: list[Source] = []
    covered = np.zeros(len(asked), bool)
    for source, shown in alike:
        if source.misfit <= _WORSE * alike[0][0].misfit + _WORSE_ANYWAY and len(result) < kept:
            result.append(source)
            covered |= shown
    for source, shown in alike:
        if (shown & ~covered).any():
            result.append(source)
            covered |= shown
    for one in found[finely:]:
        if (one.shown & ~covered).any():
            result.append(fine(one))
            covered |= one.shown
    return result


def shown_elsewhere(hole: Hole, ground: Ground, placed: Placed, *, most: int = MOST_TRIED) -> Mask:
    """Which of a hole's pixels [L] the photo knows on the ground of one of the `most` nearest objects."""
    shown = np.zeros(len(hole.points), bool)
    for matrix in laid_on(hole, ground, placed, most=most):
        at, front = project(matrix, hole.points)
        shown |= front & ground.known(at)
        if shown.all():
            break
    return shown


def laid_on(hole: Hole, ground: Ground, placed: Placed, *, most: int) -> Iterator[Array]:
    """The photo's matrices [3, 3] that take the hole to its like on other drawn ground, the nearest first."""
    for _, matrix in _laid_on(hole, ground, placed, most=most, survey=None):
        yield matrix


def _laid_on(
    hole: Hole, ground: Ground, placed: Placed, *, most: int, survey: Survey | None, checked: bool = True
) -> Iterator[tuple[int, Array]]:
    """The objects and matrices of `laid_on`, with the shift that a survey tells."""
    pixels, _ = placed.centers_px()
    away = np.hypot(*(pixels - pixels[hole.target]).T)
    plane_moves = moves(placed, hole.target)
    usable = placed.in_sight() & np.isfinite(plane_moves).all((1, 2))
    if survey is not None:
        usable |= (survey.seen > 0) & np.isfinite(plane_moves).all((1, 2))
    usable[hole.target] = False
    # What is itself to be filled in its middle comes last: around a picture that grows there is much of it.
    order = np.lexsort((away, ~ground.known(pixels)))
    tried = [int(number) for number in order if usable[number]][:most]
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    probes = hole.points[:: max(1, len(hole.points) // _PROBES)]
    probes, _ = project(plane_from_image, probes)
    spacing = _spacing(placed, hole.target)
    drawn = _apart(placed, probes) <= _GROUND * spacing if checked else np.zeros(len(probes), bool)
    for number in tried:
        if drawn.any():
            moved, _ = project(plane_moves[number], probes[drawn])
            scale = np.sqrt(abs(np.linalg.det(plane_moves[number][:2, :2])))
            on_ground = int((_apart(placed, moved) <= _GROUND * spacing * scale).sum())
            if on_ground + int((~drawn).sum()) < _LEAST_ON_GROUND * len(probes):
                continue
        move = plane_moves[number]
        if survey is not None:
            shift = np.eye(3)
            shift[:2, 2] = survey.between(hole.target, number)
            move = move @ shift
        yield number, placed.image_from_plane @ move @ plane_from_image


@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    """An object that may be a source, by its matrix [3, 3], and what of the probes it shows.

    `around` is how much it differs around the hole, which counts by its `share`; `expected` how much it does
    from what is expected in the hole, or inf.
    """

    number: int
    from_hole: Array
    shown: Mask
    around: float
    share: float
    expected: float

    def misfit(self, around: float | None = None) -> float:
        """Both as one, each as far as it tells."""
        around = self.around if around is None else around
        if not np.isfinite(self.expected):
            return around
        return float(np.sqrt(self.share * around**2 + (1 - self.share) * self.expected**2))


def _on_one_scale(tried: list[_Tried]) -> list[_Tried]:
    """Those tried with what they are expected to be off by in the measure of what they are off by around.

    Else one that shows nothing of the surroundings would be ranked by another measure than the rest.
    """
    both = [one for one in tried if one.share > 0 and np.isfinite(one.expected)]
    if not both:
        return tried
    scale = float(
        np.median([one.around for one in both]) / max(np.median([one.expected for one in both]), 1e-6)
    )
    return [replace(one, expected=scale * one.expected) for one in tried]


def _first_misfit(
    hole: Hole, ground: Ground, from_hole: Array, number: int, survey: Survey | None
) -> tuple[float, float]:
    """How unlike a source is around the hole before it is shifted, and how much that tells (0..1)."""
    light = None if survey is None else survey.light(hole.target, number)
    at, weights = _around(hole, ground, from_hole)
    if not weights.any():
        return 0.0, 0.0
    colours = taken(ground.pixels, at)
    share = _share(hole, weights)
    gain, offset = matched_light(
        colours, hole.colours, weights, light=light, share=1.0 if survey is None else share
    )
    off = np.abs(hole.colours - gain * colours - offset)
    return float((weights[:, None] * off).sum() / weights.sum() / 3), share


def _expected_misfit(hole: Hole, from_hole: Array, misfit: float) -> float:
    """How much a source differs from what is expected in the hole: the more, the smaller it is seen."""
    if not np.isfinite(misfit):
        return misfit
    middle = hole.points.mean(0)
    at, _ = project(from_hole, middle + np.array([(-1.0, 0), (1, 0), (0, -1), (0, 1)]))
    slopes = np.stack([at[1] - at[0], at[3] - at[2]]) / 2
    smaller = 1 / max(float(np.linalg.svd(slopes, compute_uv=False)[1]), 1e-3)
    return misfit * max(1.0, smaller)


def _around(hole: Hole, ground: Ground, from_hole: Array) -> tuple[Array, Floats]:
    """Where a source shows the surroundings of a hole [K, 2], and how much each place counts [K]."""
    if not len(hole.around):
        return hole.around, hole.weights
    at, front = project(from_hole, hole.around)
    weights = hole.weights * (front & ground.known(at))
    if (weights > 0).mean() < _LEAST_AROUND:
        weights = np.zeros_like(weights)
    return at, weights


def _share(hole: Hole, weights: Floats) -> float:
    """How much the surroundings that a source shows tell."""
    shown = hole.surrounded * float(weights.sum()) / max(float(hole.weights.sum()), 1e-9)
    return _beside_all_cells(shown)


def _beside_all_cells(shown: float) -> float:
    """How much surroundings of which this share is known count beside what all cells tell."""
    return shown / (shown + _ALL_CELLS)


def _aligned(hole: Hole, ground: Ground, one: _Tried, survey: Survey | None) -> Source:
    """The source that was tried, shifted and in the hole's light."""
    light = None if survey is None else survey.light(hole.target, one.number)
    at, weights = _around(hole, ground, one.from_hole)
    if not weights.any():
        gain, offset = light if light is not None else (np.ones(3), np.zeros(3))
        return Source(one.from_hole, np.zeros(2), gain, offset, one.misfit(), one.number)

    def read(shift: Array) -> Floats:
        return taken(ground.pixels, at + shift)

    shift, gain, offset, misfit = aligned(
        read,
        hole.colours,
        weights=weights,
        most_px=_MOST_SHIFT * hole.spacing_px,
        light=light,
        share=1.0 if survey is None else one.share,
        likely_px=np.inf if survey is None else survey.likely_off * hole.spacing_px,
    )
    return Source(one.from_hole, shift, gain, offset, one.misfit(misfit), one.number)


def _spacing(placed: Placed, target: int) -> float:
    """How far the next object lies on the plane, in program units."""
    apart = np.hypot(*(placed.points - placed.points[target]).T)
    apart[target] = np.inf
    return float(apart.min()) if len(apart) > 1 else np.inf


def _apart(placed: Placed, points: Array) -> Array:
    """How far the nearest object lies from points [K, 2] of the plane: [K]."""
    return np.hypot(*(points - placed.points[nearest(placed, points)]).T)

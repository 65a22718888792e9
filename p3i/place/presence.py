"""Is the object there? Each object's cell compared with the common cell of all of them.

The cells are read off the photo side by side, in the program's own coordinates: parallelograms of a lattice
and sectors of rings become squares. What most of them share is the common cell. An object is there where its
cell agrees with that more than half a step away, as a typical object does; it is not where the place is
empty, covered by something else, or looks like the ground between objects.

Convention: pixels of the photo, pixel centres at whole numbers; `index` [K, 2] holds (i, j).
"""

import numpy as np
from numpy.typing import NDArray

from p3i.place.outlines import Chart, chart_of
from p3i.place.placed import Placed
from p3i.vision.cells import agreement, cut, sheet_features, shifted, weighted_mean
from p3i.vision.image import Image, resized
from p3i.vision.sheet import Box, Sheet, project, sampled, sheet_points

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_SIDES = (8, 24)
"""Samples along the side of a cell: at least, at most."""
_SAMPLES = 3_000_000
"""Of a sheet, at most about this many."""
_FEWEST = 3
"""With fewer objects than this there is no telling what is common to them."""
_LEAST_KNOWN = 0.5
"""The share of a cell, its middle before its border, that must be known for its object to be judged."""
_SLACK = 0.09
"""Of a step: how far an object may lie from its place."""
_ROUNDS = 8
_MIDDLE, _BORDER = 0.25, 0.3
"""A cell counts fully up to this far from its middle, in steps, and by this much at its border."""
_LEAST_LEAD = 0.05
"""A typical lead below this is noise: then no object stands out enough to be there."""
_DIVIDE, _SLOPE = 0.5, 10.0
"""A typical object's lead over half a step away is 1; at `_DIVIDE` of it the score is 0.5."""


def presence_of(placed: Placed, photo: Image, index: np.ndarray) -> Array:
    """How surely the photo shows each object of `index` [K, 2]: [K] in 0..1, nan where it cannot be judged.

    `photo` is flat, as `placed` is (flat.py).
    """
    unknown = np.full(len(index), np.nan)
    chart = chart_of(placed.pattern)
    if len(index) < _FEWEST or not chart.directions:
        return unknown
    sheet = sheet_of(placed, photo, chart, index)
    if sheet is None:
        return unknown
    features, known = sheet_features(sheet)
    cells, seen = cut(features, sheet.side), cut(known, sheet.side)
    place = _position(chart, sheet.box, index)
    cells, seen = cells[place], seen[place]
    visible = (seen * _window(sheet.side)).mean(axis=(1, 2)) / _window(sheet.side).mean()
    judged = visible >= _LEAST_KNOWN
    if judged.sum() < _FEWEST:
        return unknown
    lead = _lead(cells, seen, judged, both=len(chart.directions) == 2)
    scaled = lead / max(_typical(lead[judged]), _LEAST_LEAD)
    score = 1 / (1 + np.exp(-_SLOPE * (scaled - _DIVIDE)))
    return np.where(judged, score, np.nan)


def sheet_of(placed: Placed, photo: Image, chart: Chart, index: np.ndarray) -> Sheet | None:
    """The cells at `index` [N, 2], those between and around too, side by side; None for too many."""
    box = _box(chart, index)
    side = int(np.clip(np.sqrt(_SAMPLES / box.count) // 2 * 2, 0, _SIDES[1]))
    if side < _SIDES[0]:
        return None
    pixels, valid, matrix = _reduced(placed, photo, chart, index, side)
    at, front = _seen_at(chart, matrix, sheet_points(box, side))
    steps = [np.linalg.norm(np.gradient(at, axis=axis), axis=-1) for axis in (0, 1)]
    spacing = np.where(front, np.maximum(*steps), 1.0)
    return sampled(pixels, valid, at, front, spacing, box=box, side=side)


def _box(chart: Chart, index: np.ndarray) -> Box:
    """The box of the cells of `index` and one more all around; one row where there is one direction only."""
    low, high = index.min(axis=0) - 1, index.max(axis=0) + 2
    if len(chart.directions) == 2:
        return Box(int(low[0]), int(high[0]), int(low[1]), int(high[1]))
    variable = chart.directions[0]
    return Box(int(low[variable]), int(high[variable]), 0, 1)


def _position(chart: Chart, box: Box, index: np.ndarray) -> NDArray[np.int64]:
    """The cell of the box [K] of each (i, j)."""
    if len(chart.directions) == 2:
        return (index[:, 1] - box.j_start) * box.columns + index[:, 0] - box.i_start
    return index[:, chart.directions[0]] - box.i_start


def _seen_at(chart: Chart, matrix: Array, points: Array) -> tuple[Array, Mask]:
    """Places of the sheet [..., 2] on the photo."""
    flat = points.reshape(-1, 2)
    place = np.zeros((len(flat), 4))
    place[:, chart.axes] = flat
    at, front = project(matrix, chart.at(place))
    return at.reshape(points.shape), front.reshape(points.shape[:-1])


def _reduced(
    placed: Placed, photo: Image, chart: Chart, index: np.ndarray, side: int
) -> tuple[Floats, Mask, Array]:
    """The photo no larger than the sheet can use, and the matrix from the plane to its pixels."""
    place = np.zeros((len(index), 4))
    place[:, :2] = index
    ends = []
    for axis in chart.axes:
        move = np.zeros(4)
        move[axis] = 0.25
        (before, front), (after, ahead) = (
            project(placed.image_from_plane, chart.at(place + sign * move)) for sign in (-1, 1)
        )
        ends.append(np.where(front & ahead, np.linalg.norm(after - before, axis=1) * 2, np.nan))
    # The largest cells decide: the smaller ones keep what they have.
    largest = float(np.nanquantile(np.stack(ends), 0.9)) if np.isfinite(ends).any() else 1.0
    scale = max(1.0, largest / (1.5 * side))
    small = resized(photo, max(1, round(photo.size.longer / scale)))
    scale = photo.size.longer / small.size.longer
    shift = (1 / scale - 1) / 2
    small_from_photo = np.array([[1 / scale, 0, shift], [0, 1 / scale, shift], [0, 0, 1.0]])
    return small.pixels, small.valid, small_from_photo @ placed.image_from_plane


def _lead(cells: Floats, seen: Mask, judged: Mask, *, both: bool) -> Array:
    """By how much each cell [K] agrees more with the common cell than with that half a step away."""
    template = _common_cell(cells, seen, judged)
    side = cells.shape[2]
    slack, half = max(1, round(_SLACK * side)), side // 2
    near = np.array([(x, y) for x in (-slack, 0, slack) for y in (-slack, 0, slack)])
    away = np.array([(half, 0), (0, half), (half, half)] if both else [(half, 0)])
    window = np.sqrt(_window(side))
    here, there = (
        agreement(cells * window, seen, shifted(template, shifts) * window).max(axis=1)
        for shifts in (near, away)
    )
    return (here - np.maximum(there, 0)).astype(float)


def _window(side: int) -> Floats:
    """The weight of each sample of a cell [side, side]: neighbours reach into its border."""
    line = (np.arange(side) + 0.5) / side - 0.5
    falls = 0.5 + 0.5 * np.cos(np.clip((np.abs(line) - _MIDDLE) / (0.5 - _MIDDLE), 0, 1) * np.pi)
    across = _BORDER + (1 - _BORDER) * falls
    return (across[:, None] * across).astype(np.float32)


def _common_cell(cells: Floats, seen: Mask, judged: Mask) -> Floats:
    """What most cells share: a mean in which each counts by its agreement with it."""
    visible = seen.mean(axis=(1, 2)) * judged
    weights = visible.astype(np.float32)
    template = weighted_mean(cells, seen, weights)
    for _ in range(_ROUNDS):
        fit = agreement(cells, seen, template[None])[:, 0]
        level = float((weights * fit).sum() / max(float(weights.sum()), 1e-6))
        if level <= 0:
            break
        weights = (np.clip((fit / level - 0.4) / 0.6, 0, 1) * visible).astype(np.float32)
        template = weighted_mean(cells, seen, weights)
    return template


def _typical(lead: Array) -> float:
    """The lead of an object that is there: the median of the upper half, which few empty places can move."""
    return float(np.median(lead[lead >= np.median(lead)]))

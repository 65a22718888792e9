"""The phase of a lattice: where in the cell the middle of its object may be, and how likely it is there.

That a pattern repeats says nothing about where its objects are: every shift repeats as well. What does
is looked at in the common cell of the pattern (p3i.vision.motif): half-turn symmetry, a middle that
differs from a plain border, parts that end within the cell, texture and change from cell to cell gathered
at one place. At the pattern's rim there is one more witness: true objects are whole there, whereas cells
of a wrong phase hold halves. The weights with which these speak come from a conditional logit over
photographs of many kinds; where thin lines cross on a plain ground, they take the crossing, not the hole
between the lines, for the object (a Go board and a fence, but alas also the ruled cells of a sudoku). What
"the object" is there is a matter of taste, so the other places are told too, each by the name that it has.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.alike import look_alike, working_size
from p3i.vision.alike import Alike, between
from p3i.vision.cells import cut, lab, median_cell
from p3i.vision.motif import concentration, contrast, named_places, offsets, parts, symmetry

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

WEIGHTS = {"symmetry": 5.0, "contrast": 3.8, "parts": 1.4, "texture": 5.5, "change": 2.0, "whole": 3.0}
"""How much each cue of worth_of_middles speaks."""
_STEP = 2  # samples between the phases that the rim is asked about
_NEAR = 0.2  # of a period: phases closer than this are one place of the cell
_MOST_PLACES = 6  # of a cell are told


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """A place of the cell that may be the middle of its object.

    `origin` [2] is such a place on the plane, next to the middle of the pattern; `name` what is there
    (p3i.vision.motif.named_places), None where that is not plain; `probability` that it is the object.
    """

    origin: Array
    name: str | None
    probability: float


def find_phases(
    pixels: Floats,
    valid: Mask,
    image_from_plane: Array,
    basis: Array,
    support: NDArray | None = None,
) -> list[Phase]:
    """The places of a known lattice's cell that may be its object, the likeliest first.

    Empty where no cell shows.

    Shapes and convention as in p3i.search.extent.presence.cells_that_hold: pixels [H, W, 3], valid [H, W],
    support [H, W]; the plane may have any origin.
    """
    small, mask, matrix = working_size(pixels, valid, image_from_plane)
    origin = _middle(mask, matrix)
    alike = look_alike(small, mask, matrix, basis, origin, support)
    if alike is None or alike.level <= 0 or not (alike.weights > 0).any():
        return []
    side, box = alike.sheet.side, alike.sheet.box
    colours, seen = cut(lab(alike.sheet.values), side), cut(alike.sheet.seen, side)
    typical = alike.weights > (0.3 if (alike.weights > 0.3).any() else 0)
    median, _ = median_cell(colours, seen, np.flatnonzero(typical))
    inside = typical | between(typical.reshape(box.rows, box.columns)).ravel()
    region = np.flatnonzero(inside & (alike.visible > 0.9))
    if len(region) < 3:
        region = np.flatnonzero(typical)
    appearance = _appearance(alike, median)
    worth = worth_of_middles(
        alike.template,
        colours=median if alike.colour_share > 0.1 else appearance,
        appearance=appearance,
        change=concentration(_change(colours[region], seen[region], median)),
        whole=_whole(alike),
    )
    return _phases(alike, basis, origin, worth, named_places(median[0]))


def worth_of_middles(template: Floats, *, colours: Floats, appearance: Floats, **more: Array) -> Array:
    """How much speaks for an object's middle at each sample of a cell: [side, side].

    The cell is told by what repeats in it, its `template`, by its colours, and by how it looks, each
    [C, side, side]; `more` are further cues, by their names in WEIGHTS.
    """
    cues = {
        "symmetry": symmetry(template),
        "contrast": contrast(colours),
        "parts": parts(appearance),
        "texture": concentration((template**2).sum(axis=0)),
        **more,
    }
    return np.asarray(sum(WEIGHTS[name] * cue for name, cue in cues.items()))


def _middle(mask: Mask, image_from_plane: Array) -> Array:
    """A plane point in sight, as the origin to start from."""
    height, width = mask.shape
    for y in (0.5, 0.8, 0.2):  # the middle of a photo may lie beyond the horizon
        point = np.linalg.inv(image_from_plane) @ np.array([(width - 1) / 2, y * (height - 1), 1.0])
        if point[2] > 0:
            return point[:2] / point[2]
    return np.zeros(2)


def _appearance(alike: Alike, median: Floats) -> Floats:
    """The common cell as it looks [4, side, side]: its colours as far as they repeat, else its texture."""
    n = alike.sheet.side
    texture = np.tile(alike.template[0], (3, 3))
    texture = cv2.GaussianBlur(texture, (0, 0), 0.7)[n : 2 * n, n : 2 * n]
    colour_range = max(float(np.ptp(channel)) for channel in median)
    share = alike.colour_share
    return np.concatenate(
        [
            median * (share / max(colour_range, 1e-6)),
            texture[None] * ((1 - share) / max(float(np.ptp(texture)), 1e-6)),
        ]
    ).astype(np.float32)


def _change(colours: Floats, seen: Mask, median: Floats) -> Array:
    """How much the cells [N, 3, side, side] differ from their median, sample by sample: [side, side].

    Objects of one kind differ (stones, digits, what a window reflects); the ground between them does not.
    """
    off = (colours - median) * seen[:, None]
    off = off - np.median(off.reshape(len(off), 3, -1), axis=2)[:, :, None, None]
    change = np.minimum((off**2).sum(axis=1), 0.5).mean(axis=0)
    return change + 0.02 * change.mean() + 1e-9


def _whole(alike: Alike) -> Array:
    """For an object's middle at each sample: how few of the cells are half there, -1 to 0.

    The quarters of each cell are compared with those of the common cell; a cell that is partly there
    counts against the phase.
    """
    box, n = alike.sheet.box, alike.sheet.side
    half = n // 2
    tiled = np.tile(alike.template, (1, box.rows, box.columns))
    size = (half, half)

    def quarter(values: NDArray) -> Floats:
        """Sums over the quarter of a cell that starts at each sample."""
        taken = values.astype(np.float32)
        sums = cv2.boxFilter(taken, -1, size, anchor=(0, 0), normalize=False, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(sums, np.float32)

    expected = quarter((tiled**2).sum(axis=0) * alike.known)
    energy = quarter((alike.features**2).sum(axis=0))
    product = quarter((tiled * alike.features).sum(axis=0))
    known = quarter(alike.known) / half**2
    fit = product / np.maximum(np.sqrt(np.maximum(energy, 0.16 * expected) * expected), 1e-6)
    there = np.clip((fit / max(alike.level, 0.2) - 0.35) / 0.35, 0, 1) * expected
    result = np.zeros((n, n))
    for y in range(0, n, _STEP):
        for x in range(0, n, _STEP):
            starts = [((y - half) % n + dy, (x - half) % n + dx) for dy in (0, half) for dx in (0, half)]
            at = [
                np.s_[top : top + (box.rows - 1) * n : n, left : left + (box.columns - 1) * n : n]
                for top, left in starts
            ]
            share = sum(there[k] for k in at) / np.maximum(sum(expected[k] for k in at), 1e-6)
            share = share * (np.minimum.reduce([known[k] for k in at]) > 0.85)
            wasted = -4 * float((share * (1 - share)).sum()) / max(float(share.sum()), 1.0)
            result[y : y + _STEP, x : x + _STEP] = wasted
    return result


def _phases(
    alike: Alike, basis: Array, origin: Array, worth: Array, names: dict[str, tuple[int, int]]
) -> list[Phase]:
    """The tops of worth [side, side], each with the probability of what lies nearest to it, as plane points.

    `names` says at which sample (row, column) what lies.
    """
    n, box = alike.sheet.side, alike.sheet.box
    odds = np.exp(worth - worth.max())
    odds /= odds.sum()
    i, j = np.meshgrid(np.arange(box.i_start, box.i_stop), np.arange(box.j_start, box.j_stop))
    weight = alike.weights / max(float(alike.weights.sum()), 1e-9)
    middle = np.round([float((i.ravel() * weight).sum()), float((j.ravel() * weight).sum())])
    tops = _tops(worth)
    away = np.stack([_away(n, top) for top in tops])
    nearest = away.argmin(axis=0)
    found = []
    for place, (row, column) in enumerate(tops):
        step = np.array([_peak(worth[row], column), _peak(worth[:, column], row)])
        cell = (np.array([column, row]) + step + 0.5) / n - 0.5
        near = [name for name, at in names.items() if away[place][at] < _NEAR and nearest[at] == place]
        mass = float(odds[nearest == place].sum())
        found.append(Phase(origin + (middle + cell) @ basis, near[0] if near else None, mass))
    return sorted(found, key=lambda phase: -phase.probability)


def _tops(worth: Array) -> list[tuple[int, int]]:
    """The highest samples (row, column) of worth [side, side] on the torus, none near a higher one."""
    n = len(worth)
    around = np.max([np.roll(worth, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1)], axis=0)
    at = [divmod(int(k), n) for k in np.argsort(-worth, axis=None, kind="stable")]
    tops: list[tuple[int, int]] = []
    for row, column in at:
        if worth[row, column] < around[row, column]:
            continue
        if all(_away(n, top)[row, column] > _NEAR for top in tops):
            tops.append((row, column))
        if len(tops) == _MOST_PLACES:
            break
    return tops


def _away(n: int, place: tuple[int, int]) -> Array:
    """How far each sample of a cell [n, n] lies from one (row, column), along u or v, in periods."""
    x, y = offsets(n)
    return np.maximum(np.abs(np.roll(x, place, (0, 1))), np.abs(np.roll(y, place, (0, 1))))


def _peak(line: Array, at: int) -> float:
    """Offset of a parabola's top from sample `at` of a periodic line, -0.5 to 0.5."""
    before, here, after = line[at - 1], line[at], line[(at + 1) % len(line)]
    bend = before - 2 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < -1e-9 else 0.0

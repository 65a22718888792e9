"""The phase of a lattice: where in the cell the middle of its object is.

That a pattern repeats says nothing about where its objects are: every shift repeats as well. What does
is looked at in the common cell of the pattern (p3i.vision.motif): half-turn symmetry, a middle that
differs from a plain border, parts that end within the cell, texture and change from cell to cell gathered
at one place. At the pattern's rim there is one more witness: true objects are whole there, whereas cells
of a wrong phase hold halves. The weights with which these speak come from a conditional logit over
photographs of many kinds; where thin lines cross on a plain ground, they take the crossing, not the hole
between the lines, for the object (a Go board and a fence, but alas also the ruled cells of a sudoku).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.alike import Alike, between, look_alike, working_size
from p3i.vision.cells import cut, lab, median_cell
from p3i.vision.motif import concentration, contrast, offsets, parts, symmetry

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

WEIGHTS = {"symmetry": 5.0, "contrast": 3.8, "parts": 1.4, "texture": 5.5, "change": 2.0, "whole": 3.0}
"""How much each cue of phase_cues speaks."""
_STEP = 2  # samples between the phases that the rim is asked about
_LEAST_CHANCE = 0.003  # probability of another phase worth a look
_NEAR = 0.13  # of a period: phases closer than this are the same answer


def find_phase(
    pixels: Floats,
    valid: Mask,
    image_from_plane: Array,
    basis: Array,
    support: NDArray | None = None,
) -> Array | None:
    """The middle of an object of a known lattice, near the middle of the pattern: a plane point [2].

    None where no cell of it shows.

    Convention: as in p3i.search.extent.presence.cells_that_hold; the plane may have any origin.
    """
    small, mask, matrix = working_size(pixels, valid, image_from_plane)
    if support is not None and support.shape != mask.shape:
        support = cv2.resize(np.asarray(support, np.float32), mask.shape[::-1], interpolation=cv2.INTER_AREA)
    alike = look_alike(small, mask, matrix, basis, _middle(mask, matrix), support)
    if alike is None or alike.level <= 0 or not (alike.weights > 0).any():
        return None
    worth = sum(WEIGHTS[name] * cue for name, cue in phase_cues(alike).items())
    return _phase(alike, basis, _middle(mask, matrix), np.asarray(worth))


def _middle(mask: Mask, image_from_plane: Array) -> Array:
    """A plane point in sight, as the origin to start from."""
    height, width = mask.shape
    for y in (0.5, 0.8, 0.2):  # the middle of a photo may lie beyond the horizon
        point = np.linalg.inv(image_from_plane) @ np.array([(width - 1) / 2, y * (height - 1), 1.0])
        if point[2] > 0:
            return point[:2] / point[2]
    return np.zeros(2)


def phase_cues(alike: Alike) -> dict[str, Array]:
    """What each witness says about an object's middle at each sample of the cell: arrays [side, side]."""
    side, box = alike.sheet.side, alike.sheet.box
    colours, seen = cut(lab(alike.sheet.values), side), cut(alike.sheet.seen, side)
    typical = alike.weights > 0.3 if (alike.weights > 0.3).any() else alike.weights > 0
    median, _ = median_cell(colours, seen, np.flatnonzero(typical))
    inside = typical | between(typical.reshape(box.rows, box.columns)).ravel()
    region = np.flatnonzero(inside & (alike.visible > 0.9))
    if len(region) < 3:
        region = np.flatnonzero(typical)
    appearance = _appearance(alike, median)
    return {
        "symmetry": symmetry(alike.template),
        "contrast": contrast(median if alike.colour_share > 0.1 else appearance),
        "parts": parts(appearance),
        "texture": concentration((alike.template**2).sum(axis=0)),
        "change": concentration(_change(colours[region], seen[region], median)),
        "whole": _whole(alike),
    }


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


def _phase(alike: Alike, basis: Array, origin: Array, worth: Array) -> Array:
    """The most probable phase by worth [side, side], as a plane point next to the middle of the pattern."""
    n, box = alike.sheet.side, alike.sheet.box
    odds = np.exp(worth - worth.max())
    odds /= odds.sum()
    i, j = np.meshgrid(np.arange(box.i_start, box.i_stop), np.arange(box.j_start, box.j_stop))
    weight = alike.weights / max(float(alike.weights.sum()), 1e-9)
    middle = np.round([float((i.ravel() * weight).sum()), float((j.ravel() * weight).sum())])
    x, y = offsets(n)
    found: list[tuple[Array, float]] = []
    left = odds.copy()
    for _ in range(4):
        row, column = divmod(int(left.argmax()), n)
        close = np.maximum(
            np.abs(np.roll(x, (row, column), (0, 1))), np.abs(np.roll(y, (row, column), (0, 1)))
        ) <= _NEAR  # fmt: skip
        mass = float(left[close].sum())
        if found and mass < _LEAST_CHANCE:
            break
        step = np.array([_peak(worth[row], column), _peak(worth[:, column], row)])
        cell = (np.array([column, row]) + step + 0.5) / n - 0.5
        found.append((origin + (middle + cell) @ basis, mass))
        left[close] = 0
    return max(found, key=lambda phase: phase[1])[0]


def _peak(line: Array, at: int) -> float:
    """Offset of a parabola's top from sample `at` of a periodic line, -0.5 to 0.5."""
    before, here, after = line[at - 1], line[at], line[(at + 1) % len(line)]
    bend = before - 2 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < -1e-9 else 0.0

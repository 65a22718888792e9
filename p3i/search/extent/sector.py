"""Where on its ring an object sits: the common sector of a ring, and the place in it that stands out.

That a ring repeats says nothing of the radius and the angle at which its objects lie: every circle about the
centre repeats as well. As with lattices (phase.py), what tells is looked at in the common cell: here a
sector, unrolled so that it is as wide as it is high. First the radius at which most of the drawing repeats,
then the middle of what is drawn there.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.search.extent.phase import worth_of_middles
from p3i.search.look.evidence import Evidence
from p3i.search.look.unrolled import colours_at, gradients, polar_points
from p3i.search.result import NEEDED_BITS
from p3i.vision.cells import median_cell

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Samples along the sector's arc, and as many to a like distance along the radius.
_SIDE = 24
# The object's radius is looked for this far to both sides of the fit's, as a factor.
_REACH = 1.55
# The profile is smoothed by this share of a sector's side.
_SMOOTH = 0.12
# Kinds whose means differ by less than this share of what varies along the ring are one.
_UNTOLD = 0.03
# The object's middle lies this close to the radius where most repeats, in sector sides.
_NEAR = 0.17


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A circle of objects on the plane: `center` [2] and `radius` in program units, angles in degrees.

    `index` [N] are the objects to look at, of which each stands at first_deg + step_deg * index; `weights`
    [N] say how sure each is. `image_from_plane` [3, 3] takes program units to photo pixels.
    """

    center: Array
    radius: float
    first_deg: float
    step_deg: float
    index: Array
    weights: Array
    image_from_plane: Array


@dataclass(frozen=True, slots=True)
class Place:
    """A radius (program units) and a turn (degrees, to be added to first_deg) at which objects may lie."""

    radius: float
    turn_deg: float


@dataclass(frozen=True, slots=True, eq=False)
class Sectors:
    """The sectors of a ring side by side: Lab [R, N * _SIDE, 3], known [R, N * _SIDE], radii [R]."""

    lab: Floats
    known: Mask
    radii: Array

    def cut(self, values: NDArray, rows: slice) -> NDArray:
        """Rows of values [..., R, N * _SIDE] sector by sector: [N, ..., rows, _SIDE]."""
        part = values[..., rows, :]
        return np.moveaxis(part.reshape(*part.shape[:-1], -1, _SIDE), -2, 0)


def places(evidence: Evidence, ring: Ring) -> list[Place]:
    """The radii at which most repeats, the best first, each with the turn that puts draws on objects."""
    sectors = _sectors(evidence, ring)
    everything = slice(0, len(sectors.radii))
    known = sectors.cut(sectors.known, everything)
    cells = sectors.cut(gradients(sectors.lab), everything)
    weight = ring.weights.clip(0.02)[:, None, None] * known
    template = (cells * weight[:, None]).sum(0) / np.maximum(weight.sum(0), 1e-6)
    template -= template.mean(2, keepdims=True)
    energy = (template**2).sum(0).mean(1) * (known.mean((0, 2)) > 0.5)
    profile = cv2.GaussianBlur(energy[:, None], (1, 0), 1.0, sigmaY=_SMOOTH * _SIDE)[:, 0]
    widened = cv2.dilate(profile[:, None], np.ones((_SIDE // 2 + 1, 1)))[:, 0]
    half = _SIDE // 2
    peaks = np.flatnonzero((profile == widened) & (profile > 0))
    peaks = peaks[(peaks >= half) & (peaks < len(profile) - half)]
    found = []
    for row in sorted(peaks, key=lambda row: -profile[row]):
        rows = slice(row - half, row + half)
        cell = np.asarray(template[:, rows], np.float32)
        down, turn = _middle(sectors, ring, cell, rows)
        radius = float(np.interp(row + down, np.arange(len(profile)), sectors.radii))
        found.append(Place(radius, turn * ring.step_deg))
    return found


def _within_one_kind(sectors: Sectors, rows: slice) -> Mask:
    """Which columns [_SIDE] of a sector may be an object's middle, by how far objects differ from each other.

    Where objects are of several kinds, as a dartboard's fields, a step about a middle holds one kind,
    and its mean colour is that object's own; a step about a border holds half of each neighbour, and all are
    alike. Means that vary V times as much in n objects save (n - 1) / 2 * log2 V bits.
    """
    lab, known = sectors.lab[rows], sectors.known[rows][..., None]
    sums = (np.where(known, lab, 0)).sum(0), np.broadcast_to(known, lab.shape).sum(0)  # [N * _SIDE, 3] each
    spread = np.empty(_SIDE)
    for column in range(_SIDE):
        # About the middle of this column; the seam of an open ring spoils one object of many.
        colour, count = (
            np.roll(table, _SIDE // 2 - column, 0).reshape(-1, _SIDE, 3).sum(1) for table in sums
        )
        spread[column] = (colour / np.maximum(count, 1)).var(0).sum()
    spread += _UNTOLD * float(np.where(known, lab - lab.mean(1, keepdims=True), 0).var((0, 1)).sum()) + 1e-9
    lost = 0.5 * (lab.shape[1] // _SIDE - 1) * np.log2(spread.max() / spread)
    return lost <= NEEDED_BITS


def _sectors(evidence: Evidence, ring: Ring) -> Sectors:
    """The photo about each object, unrolled: angle to the right, log radius down, alike in scale."""
    step = math.radians(ring.step_deg)
    inside = (np.arange(_SIDE) + 0.5) / _SIDE - 0.5
    angles = (math.radians(ring.first_deg) + (ring.index[:, None] + inside) * step).reshape(-1)
    reach = math.log(_REACH) + abs(step) / 2
    radii = ring.radius * np.exp(np.arange(-reach, reach, abs(step) / _SIDE))
    colours = evidence.colours_for(ring.radius * abs(step) / _SIDE * evidence.image.size.unit_px)
    matrix = colours.map_from_photo.numpy() @ ring.image_from_plane
    at, known = polar_points(colours, matrix, ring.center, radii, angles)
    return Sectors(colours_at(colours, at), known, radii)


def _middle(sectors: Sectors, ring: Ring, template: Floats, rows: slice) -> tuple[float, float]:
    """The object's middle in a sector: samples down from the middle row, and turn in steps (-1/2 to 1/2).

    The cues take the cell for a torus, which it is along the arc; so only rows near the middle are asked.
    """
    colours = np.stack([sectors.cut(plane, rows) for plane in np.moveaxis(sectors.lab, -1, 0) / 100], 1)
    weights = ring.weights.clip(0)  # where none is sure, all are asked
    sure = np.flatnonzero(weights >= 0.5 * weights.max())
    median, _ = median_cell(np.asarray(colours, np.float32), sectors.cut(sectors.known, rows), sure)
    down = (np.arange(_SIDE) + 0.5) / _SIDE - 0.5
    allowed = (np.abs(down) < _NEAR)[:, None] & _within_one_kind(sectors, rows)
    # What is alike at every turn, a rim, is no object: without it objects and gaps are told apart. With it
    # the middle of what was told is found, if the rim is the object's own: both have a say.
    told, apart_from_rim = (
        worth_of_middles(template, colours=colours, appearance=colours)
        for colours in (median, median - np.median(median, 2, keepdims=True))
    )
    column = int(np.where(allowed, apart_from_rim, -np.inf).max(0).argmax())
    apart = np.abs((np.arange(_SIDE) - column + _SIDE // 2) % _SIDE - _SIDE // 2)
    found = np.where(allowed & (apart < _SIDE // 4), told + apart_from_rim, -np.inf)
    y, x = divmod(int(np.argmax(found)), _SIDE)
    return float(down[y] * _SIDE), float((x + 0.5) / _SIDE - 0.5)

"""The cells of a program on its plane: how far apart the objects stand, and where one's ground ends.

A program's closed form also tells where (i, j) between the draws would lie. The cell of the object (i, j)
is the image of the square [i - 1/2, i + 1/2] x [j - 1/2, j + 1/2]: a parallelogram in a lattice, a sector
of an annulus in rings. Where there is one direction only, the cell is as wide across it as it is long.

Convention: program units, arrays of float64; `index` [M, 2] holds (i, j).
"""

from dataclasses import dataclass

import numpy as np
import torch

from p3i.grammar.ast import Polar
from p3i.interp.degenerate import FAR
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import nest

DEFAULT_PITCH = 10.0
"""The spacing, in program units, that is assumed for an object that stands alone."""

_BEND_DEG = 4.0
"""The angle that a straight part of a bent side covers."""


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """The plane in coordinates of the program.

    A place has four coordinates: i, j, and the steps s and t sideways, for programs that run in less than
    two directions. `axes` are the two of them that span a cell. `upright`: cells about the objects of one
    ring do not turn with it, and do not meet.
    """

    pattern: Pattern
    axes: tuple[int, int]
    upright: bool = False

    def at(self, place: np.ndarray) -> np.ndarray:
        """The points [K, 2] at `place` [K, 4]."""
        middle, sideways = _points(self.pattern, place[:, :2]), place[:, 2:]
        match self.axes:
            case (0, 1):
                return middle
            case (2, 3):
                return middle + DEFAULT_PITCH * sideways
            case (variable, _) if self.upright:
                nearest = place[:, :2].copy()
                nearest[:, variable] = np.round(nearest[:, variable])
                length = np.linalg.norm(_step(self.pattern, nearest, variable), axis=1)[:, None]
                beside = np.stack([place[:, variable] - nearest[:, variable], sideways[:, 1]], axis=1)
                return _points(self.pattern, nearest) + length * beside
            case (variable, _):
                along = _step(self.pattern, place[:, :2], variable)
                return middle + sideways[:, 1:] * np.stack([-along[:, 1], along[:, 0]], axis=1)

    @property
    def directions(self) -> tuple[int, ...]:
        """The loop variables that span a cell: 0 for i, 1 for j."""
        return tuple(axis for axis in self.axes if axis < 2)


def chart_of(pattern: Pattern) -> Chart:
    """The chart of a program, by the loops that it has and that move its points."""
    index = pattern.index.numpy().astype(float)
    parts = nest(pattern.program)
    steps = [(0, parts.for_i), (1, parts.for_j)]
    along = [variable for variable, loop in steps if loop is not None]
    lengths = {
        variable: _typical(np.linalg.norm(_step(pattern, index, variable), axis=1)) for variable in along
    }
    along = [variable for variable in along if lengths[variable] > 0]
    if len(along) == 2 and len(np.unique(_orientations(pattern, index)[1])) != 1:
        # Two loops along one line, or a row of circles, where the squares of (i, j) would overlap.
        along = [min(along, key=lambda variable: lengths[variable])]
    axes = (*along, 2, 3)[:2] if len(along) != 1 else (along[0], 3)
    return Chart(pattern, (axes[0], axes[1]))


def pitch(chart: Chart) -> float:
    """How close the objects stand, in program units: nine in ten have no neighbour closer than this.

    At most 1000: ten canvases.
    """
    index = chart.pattern.index.numpy().astype(float)
    if not chart.directions or not len(index):
        return DEFAULT_PITCH
    here = _points(chart.pattern, index)
    moves = [np.eye(2)[variable] for variable in chart.directions]
    if len(moves) == 2:
        moves += [moves[0] + moves[1], moves[0] - moves[1]]
    apart = np.stack([np.linalg.norm(_points(chart.pattern, index + move) - here, axis=1) for move in moves])
    apart = np.where(apart > 1e-6, apart, np.inf).min(axis=0)
    apart = apart[np.isfinite(apart)]
    return min(float(np.quantile(apart, 0.1)), 1000.0) if len(apart) else DEFAULT_PITCH


def surroundings(chart: Chart, index: np.ndarray) -> np.ndarray:
    """Points around the objects `index` [M, 2], a whole cell away from them: [K, 2]."""
    around = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    found = []
    for turn in around:
        place = _places(index)
        place[:, chart.axes] += turn
        found.append(chart.at(place))
    middle, apart = _points(chart.pattern, index), pitch(chart)
    found += [middle + apart * turn for turn in around[::2]]
    points = np.concatenate(found)
    return points[(np.abs(points) < FAR).all(axis=1)]


def sides(chart: Chart, index: np.ndarray) -> np.ndarray:
    """The cells' outlines as straight segments [S, 2, 2]; a side that two cells share comes once.

    Cells that fold over (around the centre of rings) have no outline.
    """
    if chart.axes == (0, 1):
        index = index[_orientations(chart.pattern, index)[0]]
    if not len(index):
        return np.zeros((0, 2, 2))
    cuts = np.linspace(-0.5, 0.5, _parts(chart) + 1)
    segments = []
    for across, along in (chart.axes, chart.axes[::-1]):
        middles = np.concatenate([_places(index), _places(index)])
        middles[:, across] += np.repeat((-0.5, 0.5), len(index))
        middles = np.unique(middles, axis=0)  # halves are exact, so equal sides are equal numbers
        lines = []
        for cut in cuts:
            place = middles.copy()
            place[:, along] += cut
            lines.append(chart.at(place))
        line = np.stack(lines, axis=1)
        segments.append(np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2, 2))
    found = np.concatenate(segments)
    return found[(np.abs(found) < FAR).all(axis=(1, 2))]


def polygons(chart: Chart, index: np.ndarray) -> np.ndarray:
    """The cell around each object `index` [M, 2], corner by corner: [M, K, 2], all with as many corners.

    A cell that folds over (the middle of rings) is a disc that reaches half way to the nearest objects.
    """
    cuts = np.linspace(-0.5, 0.5, _parts(chart) + 1)[:-1]
    ends = np.full(len(cuts), 0.5)
    # Once round the square of the cell's two coordinates.
    around = np.concatenate(
        [np.stack(pair, axis=1) for pair in ((cuts, -ends), (ends, cuts), (-cuts, ends), (-ends, -cuts))]
    )
    place = np.repeat(_places(index)[:, None], len(around), axis=1)
    place[:, :, chart.axes] += around
    corners = chart.at(place.reshape(-1, 4)).reshape(len(index), len(around), 2)
    if chart.axes == (0, 1) and len(index):
        folded = ~_orientations(chart.pattern, index)[0]
        turn = 2 * np.pi * (np.arange(len(around)) / len(around) + 0.125)
        disc = pitch(chart) / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        corners[folded] = _points(chart.pattern, index[folded].astype(float))[:, None] + disc
    return corners


def _places(index: np.ndarray) -> np.ndarray:
    return np.concatenate([index.astype(np.float64), np.zeros((len(index), 2))], axis=1)


def _parts(chart: Chart) -> int:
    """The straight parts that a side is drawn with: one, or as many as its bend needs."""
    draw = nest(chart.pattern.program).draw
    turns = [form.angle for form in (draw.x, draw.y) if isinstance(form, Polar)]
    if not chart.directions or not turns:
        return 1
    most = max(max(abs(turn.i), abs(turn.j)) for turn in turns)
    return int(np.clip(np.ceil(min(most, 180) / _BEND_DEG), 2, 45))


def _orientations(pattern: Pattern, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which cells [M] keep one orientation and have an area, and the orientations (1 or -1) of those."""
    turns = []
    for move in ((0, 0), (-0.5, 0), (0.5, 0)):
        at = index + np.array(move)
        along_i, along_j = _step(pattern, at, 0), _step(pattern, at, 1)
        area = along_i[:, 0] * along_j[:, 1] - along_i[:, 1] * along_j[:, 0]
        lengths = np.linalg.norm(along_i, axis=1) * np.linalg.norm(along_j, axis=1)
        turns.append(np.where(np.abs(area) > 1e-6 * lengths + 1e-12, np.sign(area), 0))
    middle, before, after = turns
    sound = (middle != 0) & (before != -middle) & (after != -middle)
    return sound, middle[sound]


def _step(pattern: Pattern, index: np.ndarray, variable: int) -> np.ndarray:
    """How far the point moves from half a step before to half a step after: [K, 2]."""
    half = np.zeros(2)
    half[variable] = 0.5
    return _points(pattern, index + half) - _points(pattern, index - half)


def _points(pattern: Pattern, index: np.ndarray) -> np.ndarray:
    return pattern.points_at(torch.from_numpy(np.ascontiguousarray(index, dtype=np.float64))).numpy()


def _typical(lengths: np.ndarray) -> float:
    lengths = lengths[lengths > 1e-6]
    return float(np.median(lengths)) if len(lengths) else 0.0

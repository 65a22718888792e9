"""The smallest rectangle that a lattice repeats in.

Convention: a lattice's basis is [2, 2], rows u and v; a super-cell's sides are whole combinations of them,
the first running most nearly to the right (x), the second down (y).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from p3i.place.upright import reduced, row_of

MOST = 4
"""Sides reach up to this many steps of u and of v."""

MOST_CELLS = 8
"""A rectangle of more cells than this is no texture that anyone would want."""

TOLERANCE_DEG = 3.0
"""Sides that are this near to a right angle count as rectangular, and nobody is told."""

_MOST_DEG = 20.0
"""An assumed focal skews a plane that is seen aslant by up to this; farther off is another lattice."""

_SKEW_DEG, _LEAN_DEG = 1.0, 10.0
"""How far off a right angle is usual, and how far photos are turned; tails are long, as of Cauchy's law."""

_FEWEST = 0.3
"""Fewer edges than this share of the usual number along the sides tell no more against them."""

_CELL_NATS = 2.5
"""What each further cell must be worth: a large rectangle comes near to a right angle by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class SuperCell:
    """`steps` [2, 2] int, rows the two sides in steps of (u, v); `sides` [2, 2] the same in program units.

    `cells` is how many of the lattice's cells it holds. `shear_deg` is how far the sides are from a right
    angle, which a rectangular texture straightens.
    """

    steps: np.ndarray
    sides: np.ndarray
    cells: int
    shear_deg: float

    @property
    def rectangular(self) -> bool:
        """Whether the sides are at right angles, up to the tolerance."""
        return abs(self.shear_deg) <= TOLERANCE_DEG


def supercell(basis: np.ndarray, runs: Callable[[float], float] | None = None) -> SuperCell:
    """The likeliest rectangle; where none is near to one, the nearest to it of up to four cells.

    Likely is a right angle, as far as a lens may be mistaken, few cells, sides that stand upright, and sides
    along which the pattern's edges run: `runs` says for a direction (degrees) how many do, 1 where they run
    all ways alike. Where rows are shifted by half, of bricks or along the fields of a chessboard, it stands
    on them.

    `basis` [2, 2] has rows u and v, not parallel.
    """
    shortest, row = reduced(basis), row_of(basis)
    steps = [np.array(pair) @ shortest for pair in product(range(-MOST, MOST + 1), repeat=2) if any(pair)]
    vectors = [(pair, pair @ basis) for pair in steps if math.gcd(*pair.tolist()) == 1]
    for widest_deg in (45.0, 90.0):
        rights = [(pair, p) for pair, p in vectors if abs(_angle_deg(p)) <= widest_deg + 1e-9]
        found = [
            (_rank(cell, row, runs), cell)
            for first in rights
            for second in vectors
            if (cell := _cell(first, second)) is not None
        ]
        if found:
            break
    return min(found, key=lambda ranked: ranked[0])[1]


def _cell(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> SuperCell | None:
    """The super-cell of two sides (steps, vector); None where it is too large, or turns the wrong way."""
    (across, p), (down, q) = first, second
    cells = abs(int(across[0] * down[1] - across[1] * down[0]))
    turn = float(p[0] * q[1] - p[1] * q[0])
    if not 1 <= cells <= MOST_CELLS or turn <= 0:
        return None
    shear_deg = 90.0 - math.degrees(math.atan2(turn, float(p @ q)))
    if abs(shear_deg) > _MOST_DEG and cells > 4:
        return None
    return SuperCell(np.array([across, down]), np.array([p, q]), cells, shear_deg)


def _rank(cell: SuperCell, row: int | None, runs: Callable[[float], float] | None) -> tuple[float, ...]:
    """Less is better; no two super-cells of a lattice rank alike.

    In a honeycomb three rectangles are as large as each other, turned by 60 degrees, and which is the most
    exact is chance: the one that is turned least counts.
    """
    off, lean = abs(cell.shear_deg), abs(_angle_deg(cell.sides[0]))
    astray = 0.0 if row is None or (np.abs(cell.steps) == np.eye(2)[row]).all(axis=1).any() else 1.0
    if off <= _MOST_DEG:
        nats = _CELL_NATS * (cell.cells - 1) + math.log1p((off / _SKEW_DEG) ** 2)
        nats += math.log1p((lean / _LEAN_DEG) ** 2)
        if runs is not None:
            nats -= math.log(max(_FEWEST, sum(runs(_angle_deg(side)) for side in cell.sides) / 2))
        order = (0.0, astray, nats)
    else:  # a cell more must halve the angle
        order = (1.0, off * 2 ** (cell.cells - 1))
    longer = float(np.linalg.norm(cell.sides, axis=1).max())
    return (*(round(number, 6) for number in (*order, longer, lean, off)), *cell.steps.ravel().tolist())


def _angle_deg(vector: np.ndarray) -> float:
    return math.degrees(math.atan2(vector[1], vector[0]))

"""A filled sketch on a photo: what a fit leaves, whatever the sketch draws."""

import math
from dataclasses import dataclass

from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.pattern import Pattern
from p3i.search.forms.filling import Filling
from p3i.search.look.contrast import mean_contrast, placed_right
from p3i.search.result import Reading

FEWEST_SEEN = 3
"""Fewer objects in sight say nothing of a curve: through two points there are circles anywhere."""
SUPPORT = 0.12
"""A cell belongs to a pattern where the others predict it this much better than at half steps; the same
figure is taken off before cells are summed, so that many doubtful cells make no pattern."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A filled sketch on a photo: its free numbers `z` [F], the focal (mm), and how its objects agree.

    `index` [N, 2] are the objects in sight, `contrast` [N] how well each is predicted by the others beyond
    half a step. Of curves, `side` is the patches' side in program units and `cost` the robust misfit of the
    objects' places, and `covered` the share of the picture that they fill; of lattices, `covered` is the sum
    of what is predicted beyond SUPPORT, by the cells' shares of the picture. `bits` are what the objects of a
    ring, or the cells of a lattice that agree, save (fit/saved.py).
    """

    filling: Filling
    z: Tensor
    focal_mm: float
    side: float
    index: Tensor
    contrast: Tensor
    cost: float = math.inf
    covered: float = 0.0
    bits: float = 0.0

    @property
    def pattern(self) -> Pattern:
        """The generator."""
        return self.filling.pattern

    @property
    def theta(self) -> Tensor:
        """The numbers of the generator, [P]."""
        return self.filling.theta(self.z)

    @property
    def support(self) -> Tensor:
        """Which of the objects belong to the pattern, [N] bool."""
        return self.contrast > SUPPORT

    @property
    def mean(self) -> float:
        """The mean contrast: `mean_contrast`."""
        return mean_contrast(self.contrast)

    @property
    def quality(self) -> float:
        """The mean contrast, less where the objects do not stand where the program draws."""
        return placed_right(self.mean, self.cost)

    def program(self) -> Program:
        """The program as fitted, its bounds and guards as the sketch writes them."""
        return self.filling.program(self.z, self.filling.settings[0])


def as_large_as_seen(bits: float, covered: float) -> float:
    """What a pattern is worth beside others that save `bits` too, where it fills this share of the picture.

    Natural pictures look alike at every scale, so that small rings, of teeth and ticks, save as much as large
    ones. Of those that save alike, the one that is seen larger is meant. Powers of the share between 0.2 and
    0.6 put the same rings first on 60 pictures.
    """
    return bits * covered**0.25


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A fit of which it is known which objects are there: its `program`, and how sure it is, 0 to 1.

    `fit` is of the objects that are drawn. `sure` is what its score is made of (look/contrast.py); on rings
    it may be told at another radius than the objects'. `notes` are for people;
    `readings` are the places of the cell that may be its object.
    """

    program: Program
    fit: Fit
    sure: float
    notes: tuple[str, ...] = ()
    readings: tuple[Reading, ...] = ()

"""First numbers for a sketch, before anything is fitted: what every proposer hands to the fit."""

from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.camera import image_from_plane
from p3i.search.forms.filling import Filling
from p3i.search.forms.lattice import Lattice
from p3i.search.forms.spelled import lattice_filling
from p3i.size import Size


@dataclass(frozen=True, slots=True, eq=False)
class Base:
    """What a guess says more than: a fit of so many `objects`, their mean contrast and their quality.

    `side` is the patches' side, in program units; `sure` is how sure its program is, 0 to 1.
    """

    objects: int
    mean: float
    quality: float
    side: float
    sure: float


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """A filling and its numbers z [F], how promising they looked, and the setting of the extents.

    `promise` is 1 for the best guess of a proposer, and less for others. `focal_mm` is the focal that they go
    with, None for the one that is assumed. `local`: they hold near the pattern's origin only. `base` is what
    they begin with, where a smaller pattern was found before. `settled`: nothing of it is to be fitted.
    `doubted`: its fit counts only where it is certain.
    """

    filling: Filling
    z: Tensor
    promise: float
    focal_mm: float | None = None
    setting: int = 0
    local: bool = False
    base: Base | None = None
    settled: bool = False
    doubted: bool = False

    @property
    def theta(self) -> Tensor:
        """The numbers of the generator, [P]."""
        return self.filling.theta(self.z)

    def program(self) -> Program:
        """The guess as a program."""
        return self.filling.program(self.z, self.filling.settings[self.setting])

    @property
    def lattice(self) -> Lattice:
        """The numbers of a lattice's guess as one."""
        return Lattice.of(self.filling.pattern, self.theta)


def lattice_guess(lattice: Lattice, promise: float, *, local: bool) -> Guess:
    """A lattice as a guess for the sketch of lattices."""
    filling = lattice_filling()
    return Guess(filling, filling.z_of(lattice.theta(filling.pattern)), promise, local=local)


def tilted(guess: Guess, *, rx_deg: float, ry_deg: float, focal_mm: float, size: Size) -> Guess:
    """The same local lattice, read under another pose: same place and steps in the photo near its origin."""

    def homography(rx: float, ry: float) -> np.ndarray:
        return image_from_plane(rx, ry, size=size, focal_mm=focal_mm).numpy()

    old = guess.lattice
    change = np.linalg.inv(homography(rx_deg, ry_deg)) @ homography(old.rx_deg, old.ry_deg)
    moved = change @ np.array([*old.origin, 1.0])
    origin = moved[:2] / moved[2]
    slopes = (change[:2, :2] - np.outer(origin, change[2, :2])) / moved[2]
    lattice = Lattice(rx_deg, ry_deg, old.basis @ slopes.T, origin)
    return replace(guess, z=guess.filling.z_of(lattice.theta(guess.filling.pattern)))

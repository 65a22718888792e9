"""First numbers for a form, before anything is fitted: what a proposer hands to a fit."""

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from p3i.interp.camera import image_from_plane
from p3i.search.forms.filling import Filling
from p3i.search.forms.lattice import Lattice
from p3i.size import Size


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A lattice worth refining, and how promising it looked. `local`: it holds near its origin only."""

    lattice: Lattice
    worth: float
    local: bool


def tilted(proposal: Proposal, *, rx_deg: float, ry_deg: float, focal_mm: float, size: Size) -> Proposal:
    """The same local lattice, read under another pose: same place and steps in the photo near its origin."""

    def homography(rx: float, ry: float) -> np.ndarray:
        return image_from_plane(rx, ry, size=size, focal_mm=focal_mm).numpy()

    old = proposal.lattice
    change = np.linalg.inv(homography(rx_deg, ry_deg)) @ homography(old.rx_deg, old.ry_deg)
    moved = change @ np.array([*old.origin, 1.0])
    origin = moved[:2] / moved[2]
    slopes = (change[:2, :2] - np.outer(origin, change[2, :2])) / moved[2]
    basis = old.basis @ slopes.T
    return Proposal(Lattice(rx_deg, ry_deg, basis, origin), proposal.worth, proposal.local)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A filling's numbers z [F], which setting of its extents, and the score of its points."""

    filling: Filling
    z: Tensor
    setting: int
    score: float

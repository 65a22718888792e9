"""How well a lattice's objects fix the camera's tilt: what no search can beat."""

import numpy as np
import torch

from p3i.grammar.ast import Program
from p3i.interp.camera import project
from p3i.interp.compile import compile
from p3i.size import Size

PLACE_PX = 0.25
"""An object's place is read to a quarter of a pixel."""


def lattice_sigma_deg(program: Program, index: np.ndarray, size: Size, *, stray_units: float) -> float:
    """The standard error of the tilt in degrees, where all objects are read as well as they can be.

    Least squares (the Cramer-Rao bound) over the camera's angles and all numbers in `Draw`, with the focal
    known; the objects `index` [N, 2] stray by `stray_units` on the plane and are read to PLACE_PX.
    """
    pattern = compile(program)
    at = torch.from_numpy(np.asarray(index, np.float64))

    def seen(theta: torch.Tensor) -> torch.Tensor:
        matrix = pattern.image_from_plane(theta, size=size)
        return project(matrix, pattern.points_at(at, theta))[0]

    def strayed(points: torch.Tensor) -> torch.Tensor:
        return project(pattern.image_from_plane(size=size), points)[0]

    slopes = torch.autograd.functional.jacobian(seen, pattern.theta)
    points = pattern.points_at(at)
    around = torch.stack(
        [(strayed(points + step) - strayed(points - step)) / 2e-3 for step in 1e-3 * torch.eye(2).double()], 2
    )
    noise = stray_units**2 * around @ around.mT + PLACE_PX**2 * torch.eye(2).double()
    whitened = torch.linalg.solve_triangular(torch.linalg.cholesky(noise), slopes, upper=False)  # pyright: ignore
    rows = whitened.reshape(-1, len(pattern.theta))
    covariance = torch.linalg.pinv(rows.T @ rows, hermitian=True)
    angles = [pattern.paths.index(path) for path in ("camera.rx", "camera.ry")]
    return float(covariance[angles, angles].sum().sqrt())

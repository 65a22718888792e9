"""Programs that no picture can show: a plane seen edge-on, and steps beyond all pictures."""

import numpy as np
import torch

from p3i.errors import ProgramError
from p3i.interp.camera import Camera
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import nest

FAR = 1e6
"""Objects farther from the origin than this, in program units, are left out: ten thousand pictures away."""

# A plane whose normal leaves less than this of itself along the optical axis is seen edge-on: 0.0006 degrees.
_EDGE_ON = 1e-5


def refuse_edge_on(camera: Camera) -> None:
    """Raise ProgramError where a camera sees its plane edge-on: as a line, on which no two points differ."""
    if abs(camera.normal[2]) < _EDGE_ON:
        raise ProgramError(
            f"the plane is seen edge-on (rx={camera.rx_deg:g}, ry={camera.ry_deg:g}), as a line on which "
            "nothing can be told apart: tilt it by less than 90 degrees"
        )


def refuse_far_steps(pattern: Pattern, index: np.ndarray) -> None:
    """Raise ProgramError where a cell at `index` [M, 2] reaches beyond all pictures: numbers overflow."""
    loops = nest(pattern.program)
    at = torch.as_tensor(index, dtype=torch.float64)
    for axis, loop in enumerate((loops.for_i, loops.for_j)):
        half = torch.zeros(2, dtype=torch.float64)
        half[axis] = 0.5 * (loop is not None)
        steps = (pattern.points_at(at + half) - pattern.points_at(at - half)).abs()
        if not bool((steps < FAR).all()):  # nan is none either
            raise ProgramError(
                f"one step of the loop over {'ij'[axis]} goes farther than {FAR:,.0f} units, "
                "ten thousand pictures: write smaller numbers in Draw"
            )

"""A whole program as numbers to fit: its camera and its `Draw`, tied where it writes one number twice.

A circle's radius and angle stand in x and in y and are one number each; apart they would make an ellipse of
it, and fit what no camera does to a circle.
"""

import math
from dataclasses import replace

from torch import Tensor

from p3i.grammar.ast import Program
from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.pattern import moving_leaves
from p3i.search.forms.filling import LENGTH_DIGITS, Filling, only_filling, whole_program_sketch


def whole_filling(program: Program) -> tuple[Filling, Tensor]:
    """The program with camera and `Draw` free, but for the step of a closed ring, and its numbers z [F]."""
    sketch = whole_program_sketch(program)
    step = leaves(program).get("draw.x.angle.j", 0.0)
    if step and math.isclose(round(360 / step) * step, 360, abs_tol=1e-6):
        sketch = replace(
            sketch, holes=tuple(hole for hole in sketch.holes if not hole.path.endswith(".angle.j"))
        )
    filling = only_filling(sketch)
    return filling, filling.z_of(filling.pattern.theta)


def scaled(program: Program, factor: float) -> Program:
    """The program with all lengths times `factor`; angles and loops stay."""
    if factor == 1:
        return program
    lengths = {
        path: round(value * factor, LENGTH_DIGITS)
        for path, value in moving_leaves(program).items()
        if path.startswith("draw.") and ".angle." not in path
    }
    return with_leaves(program, lengths)

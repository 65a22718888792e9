"""A program -> its differentiable generator of points."""

import torch

from p3i.grammar.ast import Program
from p3i.interp.pattern import Pattern, moving_leaves
from p3i.interp.unroll import edges, live_indices


def compile(program: Program) -> Pattern:
    """Walk the loops and guards of a program once, and leave its numbers free.

    The result's `centers(theta)` is differentiable in the camera's angles and every number in `Draw`; the
    bounds and guards are discrete: a change of theirs needs another compile. An `i` that no loop binds
    reads as 1 under Table 1's top-level ring (DESIGN 2.2). Draws that coincide are all kept.

    Raises ParseError (P122, P123) where the loops turn too often or a bound overflows.
    """
    live = live_indices(program)
    moving = moving_leaves(program)
    return Pattern(
        program,
        tuple(moving),
        torch.tensor(list(moving.values()), dtype=torch.float64),
        torch.tensor(live, dtype=torch.int64).reshape(-1, 2),
        torch.tensor(edges(live), dtype=torch.int64).reshape(-1, 2),
    )

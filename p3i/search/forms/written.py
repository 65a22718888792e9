"""Answers as starts for a sketch: the same pattern, as far as the sketch can say it.

A grid over all holes of a lattice has a point for one in a million; views and windows look at the picture
instead. Where a sketch draws what is found without it, that answer, written in the sketch's numbers, is the
place to begin, whatever the sketch fixes, ties together or bounds.
"""

from collections.abc import Sequence

import torch

from p3i.grammar.ast import Program
from p3i.interp.compile import compile
from p3i.interp.pattern import moving_leaves
from p3i.search.forms.filling import Filling, kept_within
from p3i.search.forms.guess import Guess
from p3i.search.look.patches import spacing

# A start that draws its objects further off than this share of their spacing is none.
_MOST_OFF = 1.0


def written_in(every: Sequence[Filling], program: Program) -> Guess | None:
    """The filling, of a sketch's, that draws a program's objects most nearly; None where none comes near.

    Its promise is -1 times how far off the objects lie, in spacings.
    """
    pattern, values = compile(program), moving_leaves(program)
    found: list[Guess] = []
    for filling in every:
        if set(filling.pattern.paths) != set(values):
            continue  # another form of pattern
        theta = torch.tensor([values[path] for path in filling.pattern.paths], dtype=torch.float64)
        z = kept_within(filling, filling.z_of(theta))
        drawn = filling.pattern.points_at(pattern.index.double(), filling.theta(z))
        off = (drawn - pattern.centers()).norm(dim=1).median() / spacing(pattern, pattern.theta)
        setting = (filling.masks.sum(1) - len(pattern.index)).abs().argmin()
        found.append(Guess(filling, z, -float(off), setting=int(setting)))
    best = max(found, key=lambda one: one.promise, default=None)
    return best if best is not None and best.promise > -_MOST_OFF else None

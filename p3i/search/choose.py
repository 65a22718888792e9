"""Choice: which of the programs found, of whatever structure, explains the photo best for what it costs.

One measure for all, in bits. What a program explains: each object in sight that the others predict saves the
bits of so many independent samples of its patch, -1/2 log2(1 - c^2) each, c being how much better the others
predict it than what lies half a step away. What a program costs: its numbers, bounds and guards, written down
to the precision that matters. (Minimum description length: Rissanen 1978; the paper itself compares programs
of one structure only, by its equation 2.)
"""

import math
from dataclasses import replace

from p3i.grammar.ast import Polar, Program
from p3i.grammar.leaves import leaves
from p3i.interp.compile import compile
from p3i.interp.unroll import nest
from p3i.search.evidence import Evidence
from p3i.search.patches import patch_contrast, spacing
from p3i.search.score import without_doubles
from p3i.search.session import Answer

# Samples of a patch that count as independent of each other: about 7 x 7.
_SAMPLES = 50
# A length or an angle is written in this many bits, a bound or a number of a guard in that many.
_NUMBER_BITS = 11.0
_WHOLE_BITS = 5.0
# A loop, a guard, a circular coordinate: which of the productions.
_PRODUCTION_BITS = 2.0
# Contrast is never taken for more than this.
_MOST_CONTRAST = 0.98
# More objects than this are judged by a part of them.
_MOST_JUDGED = 300


def by_explained(evidence: Evidence, answers: list[list[Answer]]) -> list[Answer]:
    """The answers of several families, each list in its own order, as one list: most bits explained first.

    Every answer's `worth` becomes what it explains; within a family the order stays, since that family knows
    its own programs best.
    """
    together: list[Answer] = []
    for family in answers:
        most = math.inf
        for answer in family:
            most = min(most, explained_bits(evidence, answer))
            together.append(replace(answer, worth=most))
    return sorted(together, key=lambda answer: -answer.worth)


def explained_bits(evidence: Evidence, answer: Answer) -> float:
    """What a program explains of the photo less what it costs, in bits; negative where it costs more."""
    pattern = without_doubles(compile(answer.program))
    focal_mm = answer.focal_mm or evidence.focal_mm
    index = pattern.index[evidence.in_sight(pattern, focal_mm=focal_mm)].double()
    cost = cost_bits(answer.program)
    if len(index) < 2:
        return -cost
    judged = index[:: len(index) // _MOST_JUDGED + 1]
    side = spacing(pattern, pattern.theta)
    found = patch_contrast(evidence, pattern, pattern.theta, judged, side=side, focal_mm=focal_mm)
    strength = found.contrast.abs().clamp(max=_MOST_CONTRAST)
    bits = -0.5 * _SAMPLES * (1 - strength.square()).log2() * found.contrast.sign()
    # The mean patch itself is learnt from the objects: one of them says nothing new.
    return float(bits.mean()) * (len(index) - 1) - cost


def cost_bits(program: Program) -> float:
    """The bits that a program takes to write down."""
    parts = nest(program)
    bits = _PRODUCTION_BITS * (1 + len(parts.guards) + (parts.for_i is not None) + (parts.for_j is not None))
    for form in (parts.draw.x, parts.draw.y):
        bits += _PRODUCTION_BITS * isinstance(form, Polar)
    shared: set[tuple[str, float]] = set()
    for path, value in leaves(program).items():
        if value == 0:
            continue
        if not path.startswith(("camera.", "draw.")):
            bits += _WHOLE_BITS
            continue
        # A circle's radius and angle stand in x and in y and are one number.
        name = path.replace("draw.y.", "draw.x."), value
        if ".radius." in path or ".angle." in path:
            if name in shared:
                continue
            shared.add(name)
        bits += _NUMBER_BITS
    return bits

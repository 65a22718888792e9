"""The description length of programs and sketches: what it takes to write one down, in bits."""

from p3i.grammar.ast import Polar, Program
from p3i.grammar.leaves import leaves
from p3i.interp.unroll import nest

NUMBER_BITS = 7.0
"""A length or an angle: on the largest map, of 640 pixels, so many places lie 5 pixels apart, a quarter of
the step of what can be seen."""
CAMERA_BITS = 13.0
"""A lens or a focal of the pattern's own, as a header writes them: four digits."""
WHOLE_BITS = 5.0
"""A bound, or a number of a guard."""
PRODUCTION_BITS = 2.0
"""A loop, a guard, a circular coordinate: which of the productions."""


def production_bits(program: Program) -> float:
    """The bits that it takes to say which loops and guards a program has, and what it draws."""
    parts = nest(program)
    polar = sum(isinstance(form, Polar) for form in (parts.draw.x, parts.draw.y))
    loops = (parts.for_i is not None) + (parts.for_j is not None)
    return PRODUCTION_BITS * (1 + loops + len(parts.guards) + polar)


def cost_bits(program: Program) -> float:
    """The bits that a program takes to write down."""
    bits = production_bits(program)
    shared: set[tuple[str, float]] = set()
    for path, value in leaves(program).items():
        if value == 0:
            continue
        if not path.startswith(("camera.", "draw.")):
            bits += WHOLE_BITS
            continue
        # A circle's radius and angle stand in x and in y and are one number.
        name = path.replace("draw.y.", "draw.x."), value
        if ".radius." in path or ".angle." in path:
            if name in shared:
                continue
            shared.add(name)
        bits += NUMBER_BITS
    return bits

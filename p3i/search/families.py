"""The pattern families that the search knows: a structure, and the function that finds its programs.

A newcomer adds a line here. What a family's function shares with the others: `Session` (evidence, options,
clock), cells in index space (look/cells.py), their refinement through the compiled generator (fit/), and
`Answer`, whose scores are comparable between families.
"""

from collections.abc import Callable
from dataclasses import dataclass

from p3i.search.answer import Answer
from p3i.search.hybrids import find_hybrids
from p3i.search.lattices import find_lattices
from p3i.search.look.session import Session
from p3i.search.result import StructureFound
from p3i.search.rings import find_rings


@dataclass(frozen=True, slots=True)
class Family:
    """A kind of pattern: its name, and how its programs are found on a photo, the most worth first.

    A family that `starts_from` another one's programs may say more than these, however sure they are.
    """

    structure: StructureFound
    find: Callable[[Session], list[Answer]]
    starts_from: StructureFound | None = None


FAMILIES: tuple[Family, ...] = (
    Family("lattice", find_lattices),
    Family("circular", find_rings),
    Family("hybrid", find_hybrids, starts_from="circular"),
)

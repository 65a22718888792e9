"""Who proposes first numbers for which sketches: a newcomer adds a line here.

A proposer reads the photo, the sketch and what was found so far, and yields guesses in rounds: each round is
fitted before the next is asked for, so that a later one may start from what an earlier one became.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best
from p3i.search.forms.guess import Guess
from p3i.search.forms.sketches import WALKED_SHAPES, Shape, Sketched
from p3i.search.look.session import Session
from p3i.search.propose.holes import hole_guesses
from p3i.search.propose.lattices import lattice_rounds
from p3i.search.propose.paper import paper_guesses
from p3i.search.propose.repeats import guesses_around
from p3i.search.propose.votes import ring_rounds

Rounds = Iterator[Iterable[Guess]]


@dataclass(frozen=True, slots=True)
class Proposer:
    """A way to guess: the shapes that it writes, and how.

    At most `most_fitted` of a round's guesses are fitted, and `most_drawn` of the fits drawn. `all_at_once`:
    it writes all its shapes when it is first asked, whatever the sketch.
    """

    writes: frozenset[Shape]
    rounds: Callable[[Session, Sketched, Best], Rounds]
    most_fitted: int
    most_drawn: int
    all_at_once: bool = True


LATTICES = Proposer(frozenset({"lattice"}), lambda look, _, best: lattice_rounds(look, best), 7, 3)
RINGS = Proposer(frozenset({"ring", "arc"}), lambda look, _, best: ring_rounds(look, best), 8, 2)
AROUND = Proposer(
    frozenset({"rings in rings", "fan", "rings in a row"}),
    lambda look, _, best: iter([guesses_around(look, best.rings())]),
    12,
    2,
)
HOLES = Proposer(frozenset({"any", "row", "spiral"}), hole_guesses, 10, 10, False)
PAPER = Proposer(frozenset({"lattice"}), lambda look, _, __: iter([paper_guesses(look)]), 100, 100)


def proposers(config: SearchConfig) -> tuple[Proposer, ...]:
    """Those of a search: the paper's recipe has its own."""
    return (PAPER,) if config.recipe == "paper" else (LATTICES, RINGS, AROUND, HOLES)


def share_of_time(config: SearchConfig, sketch: Sketched) -> float | None:
    """The seconds that a sketch of no fast proposer has, None where nothing limits it."""
    if config.exhaustive_s is None or sketch.shape not in WALKED_SHAPES:
        return None
    return config.exhaustive_s / len(WALKED_SHAPES)

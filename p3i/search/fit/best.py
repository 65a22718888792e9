"""What a search has so far: what proposers may start from, and the answers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from p3i.search.answer import Answer
from p3i.search.fit.fitted import Drawn, Fit, as_large_as_seen
from p3i.search.fit.places import values_of
from p3i.search.forms.sketches import Sketched
from p3i.search.result import NEEDED_BITS

# A program that explains more than the rings and hybrids of photos do leaves nothing to a pattern of another
# structure; where its objects agree well, it need not explain as much.
_BEYOND_DOUBT = 0.3
_MOST_OF_CURVES = {True: 300.0, False: 1000.0}


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A program that was found for a sketch, and what it is as an answer: in strict, it may be none."""

    sketch: Sketched
    drawn: Drawn
    answers: tuple[Answer, ...]


@dataclass(slots=True)
class Best:
    """All that was found, in order; `fits` are all that were worth drawing, drawn or not."""

    found: list[Found] = field(default_factory=list)
    fits: list[Fit] = field(default_factory=list)

    def add(self, sketch: Sketched, drawn: Drawn, answers: Iterable[Answer]) -> None:
        """Take in a program."""
        self.found.append(Found(sketch, drawn, tuple(answers)))

    def leaves_room_for(self, sketch: Sketched) -> bool:
        """Whether a program of this sketch could explain more than what was found.

        Hybrids hold rings, and say more than these, however sure they are.
        """
        return not any(
            answer.worth > _MOST_OF_CURVES[answer.score > _BEYOND_DOUBT]
            and answer.structure != sketch.structure
            and not (sketch.structure == "hybrid" and answer.structure == "circular")
            for answer in self.asked()
        )

    def rings(self) -> list[Drawn]:
        """The rings beyond noise, and those that strict has no words for, the surest first."""
        rings = [one for one in self.found if one.sketch.shape == "ring"]
        beyond = [one for one in rings if all(answer.worth > NEEDED_BITS for answer in one.answers)]
        return sorted((one.drawn for one in beyond), key=lambda drawn: -drawn.sure)

    def holds_lattice(self) -> bool:
        """Whether a lattice beyond noise was found."""
        return any(answer.structure == "lattice" and answer.worth > NEEDED_BITS for answer in self.asked())

    def holds_closed_ring(self) -> bool:
        """Whether a ring beyond noise was found that goes all the way round, its step a part of a turn."""
        return any(
            one.sketch.shape == "ring"
            and "draw.x.angle.j" not in values_of(one.drawn.fit)
            and any(answer.worth > NEEDED_BITS for answer in one.answers)
            for one in self.found
        )

    def of(self, sketch: Sketched) -> list[Answer]:
        """The answers that a sketch has."""
        return [answer for one in self.found if one.sketch is sketch for answer in one.answers]

    def alike(self, sketch: Sketched) -> list[Answer]:
        """The answers of other sketches of the same structure, the most worth first."""
        others = (one for one in self.found if one.sketch is not sketch)
        alike = [one for one in others if one.sketch.structure == sketch.structure]
        return sorted((answer for one in alike for answer in one.answers), key=lambda one: -one.worth)

    def in_order(self) -> list[Answer]:
        """The answers, those first whose structure explains most, and of its rings the one that is meant."""
        answers, most = list(self.asked()), dict[str, float]()
        for answer in answers:
            most[answer.structure] = max(answer.worth, most.get(answer.structure, answer.worth))

        def order(answer: Answer) -> tuple[float, float]:
            return -most[answer.structure], -as_large_as_seen(answer.worth, answer.covered)

        return sorted(answers, key=order)

    def asked(self) -> Iterator[Answer]:
        """The answers that the options ask for, not those that others only start from."""
        return (answer for one in self.found if one.sketch.asked for answer in one.answers)

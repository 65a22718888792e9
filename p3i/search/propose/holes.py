"""Guesses for the sketch that a person wrote: what others found, said by it, then points of the grid."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from p3i.grammar.leaves import with_leaves
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.fit.best import Best
from p3i.search.forms.filling import Filling, fillings, unknowns_of
from p3i.search.forms.guess import Guess
from p3i.search.forms.sketches import Sketched
from p3i.search.forms.written import written_in
from p3i.search.look.session import Session
from p3i.search.propose.climb import distinct, search_grid
from p3i.search.propose.grid import PointMaps


@dataclass(frozen=True, slots=True)
class Effort:
    """How hard to try: points of the grid, the least of them for a setting of the counts, fits, rounds."""

    points: int
    least: int
    fits: int
    rounds: int


BY_HAND = Effort(60_000, 2_000, 10, 2)
"""For a sketch that a person wrote: after a round with a sure answer no other follows."""
WALKED = Effort(24_000, 600, 4, 1)
"""For one of many that are walked through."""

# An answer that scores this by what it draws is sure enough to look no further.
_ENOUGH = 0.35
# A sketch can say a program where it draws its objects to within this share of their spacing.
_SAID = 0.25
# Objects that a sketch may draw in the coarse search, and settings of its extents there.
_MOST_INDICES, _MOST_SETTINGS = 64, 8
# So many answers of other sketches are taken as starts.
_MOST_KNOWN = 2


def hole_guesses(look: Session, sketch: Sketched, best: Best) -> Iterator[list[Guess]]:
    """Guesses in rounds: what others' answers say, then the best of the grid until one is sure enough."""
    size = look.evidence.image.size
    canvas = (size.width / size.unit_px, size.height / size.unit_px)
    unknowns = unknowns_of(sketch.sketch, longer_units=canvas)
    every = list(fillings(sketch.sketch, unknowns, most_indices=_MOST_INDICES, most_settings=_MOST_SETTINGS))
    if not every:
        return
    effort = WALKED if sketch.by_hand is None else BY_HAND
    known = [_refocused(answer, look.evidence.focal_mm) for answer in best.alike(sketch)[:_MOST_KNOWN]]
    starts = [start for answer in known if (start := written_in(every, answer.program)) is not None]
    yield starts
    # A ring where a spiral is asked for is where a fit may begin, and no reason to look no further.
    sayable = all(start.promise > -_SAID for start in starts)
    maps: PointMaps | None = None
    for turn in range(effort.rounds):
        enough = max((answer.worth for answer in best.of(sketch)), default=0.0) >= _ENOUGH
        if (enough and (turn > 0 or sayable)) or not look.go_on():
            return
        maps = maps or PointMaps.of(look.evidence)
        yield _from_grid(look, maps, every, effort=effort, done=turn / effort.rounds)


def _from_grid(
    look: Session, maps: PointMaps, every: list[Filling], *, effort: Effort, done: float
) -> list[Guess]:
    """The best of one look through the whole grid, with points of its own."""
    budget = max(effort.least, effort.points // len(every))
    share = 0.7 / effort.rounds
    found: list[Guess] = []
    with look.until_interrupted():
        for place, filling in enumerate(every):
            if found and not look.go_on():
                break
            look.tell("looking through the holes", done + share * place / len(every))
            found += search_grid(look, maps, filling, budget=budget, keep=effort.fits)
    found.sort(key=lambda one: -one.promise)
    return look.completed(lambda: distinct(maps, found))[: effort.fits]


def _refocused(answer: Answer, focal_mm: float) -> Answer:
    """A ring's answer with the camera of this focal that sees the same vanishing line.

    Its plane stays, as the affine change of `focal.refocused` would make an ellipse of the circle: its points
    in the photo move a little, and the fit that starts here brings them back.
    """
    if answer.focal_mm is None:
        return answer
    camera = Camera.of(answer.program, focal_mm=answer.focal_mm).refocused(focal_mm)
    angles = {"camera.rx": camera.rx_deg, "camera.ry": camera.ry_deg}
    return replace(answer, program=with_leaves(answer.program, angles), focal_mm=None)

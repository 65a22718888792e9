"""A sketch that a person wrote (or the enumerator) -> programs: grid, climb, registration, extent, score.

No family is known here. The coarse grid looks at single points (propose/grid.py, propose/climb.py); the best
fillings are fitted to where their objects really lie (fit/places.py), the extents are read off which objects
are there, and numbers that a person bounded stay within their bounds all the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.grammar.ast import Polar, Program
from p3i.grammar.printer import format_program
from p3i.grammar.sketch import Sketch
from p3i.interp.compile import compile
from p3i.interp.unroll import nest
from p3i.search.answer import Answer
from p3i.search.extent.centring import centred, standing_out
from p3i.search.fit.places import CurveFit, follow, measured
from p3i.search.forms.filling import (
    Filling,
    fillings,
    kept_within,
    pinned,
    unknowns_of,
    with_settings,
)
from p3i.search.forms.guess import Found
from p3i.search.forms.settings import best_setting, widened
from p3i.search.forms.written import written_in
from p3i.search.judge.evaluate import score_of_program
from p3i.search.look.patches import half_steps, patch_contrast
from p3i.search.look.session import Session
from p3i.search.look.thinned import thinned
from p3i.search.propose.climb import distinct, search_grid
from p3i.search.propose.grid import PointMaps
from p3i.search.result import StructureFound


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
# Of more objects in sight than this, so many say which are there.
_MOST_WEIGHED = 2000
# Fewer objects in sight say nothing.
_FEWEST = 4
# Rounds of registration.
_ROUNDS, _LAST_ROUNDS = 3, 5
# A pattern that was caught by its middle may grow by an object as often as this.
_EXTENTS_TRIED = 10
# An object is worth drawing from this share of the typical contrast on.
_PRESENT = 0.35
# Half a step on, the draws must stand out from the ground by this factor more.
_MORE_OBJECT = 1.3
_SHIFTS = [(1, 0), (-1, 0), (0, 1), (0, -1)]


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A fit of one setting of the extents, and that setting."""

    curve: CurveFit
    setting: tuple[int, ...]


def find_by_sketch(
    session: Session, sketch: Sketch, *, known: Sequence[Answer] = (), effort: Effort = BY_HAND
) -> list[Answer]:
    """Programs that fill the sketch, the best first; empty where no filling has objects in the photo.

    Fits begin at the answers that are `known`, and go on to the grid where none of these is sure enough.
    """
    size = session.evidence.image.size
    canvas = (size.width / size.unit_px, size.height / size.unit_px)
    unknowns = unknowns_of(sketch, longer_units=canvas)
    every = list(fillings(sketch, unknowns, most_indices=_MOST_INDICES, most_settings=_MOST_SETTINGS))
    if not every:
        return []
    starts = [start for answer in known if (start := written_in(every, answer.program)) is not None]
    answers = _answers(session, starts, done=0.0, share=0.0)
    # A ring where a spiral is asked for is where a fit may begin, and no reason to look no further.
    sayable = all(start.score > -_SAID for start in starts)
    maps: PointMaps | None = None
    with session.until_interrupted():
        for turn in range(effort.rounds):
            enough = max((answer.worth for answer in answers), default=0.0) >= _ENOUGH
            if (enough and (turn > 0 or sayable)) or not session.go_on():
                break
            maps = maps or PointMaps.of(session.evidence)
            answers += _searched(session, maps, every, effort=effort, done=turn / effort.rounds)
    return _different(sorted(answers, key=lambda answer: -answer.worth))


def _searched(
    session: Session, maps: PointMaps, every: list[Filling], *, effort: Effort, done: float
) -> list[Answer]:
    """One look through the whole grid, with points of its own, and the fits of what was best there."""
    budget = max(effort.least, effort.points // len(every))
    share = 1 / effort.rounds
    found: list[Found] = []
    with session.until_interrupted():
        for place, filling in enumerate(every):
            if found and not session.go_on():
                break
            session.tell("looking through the holes", done + share * 0.7 * place / len(every))
            found += search_grid(session, maps, filling, budget=budget, keep=effort.fits)
    found.sort(key=lambda one: -one.score)
    found = session.completed(lambda: distinct(maps, found))[: effort.fits]
    with session.until_interrupted():
        for one in found:
            session.record("grid", score=one.score, program=_text(one.filling, one.z, one.setting))
    return _answers(session, found, done=done + share * 0.7, share=share * 0.3)


def _answers(session: Session, found: Sequence[Found], *, done: float, share: float) -> list[Answer]:
    """What was found, fitted to its objects; `done` and `share` are parts of the whole search."""
    answers: list[Answer] = []
    reached = 0
    with session.until_interrupted():
        for place, one in enumerate(found):
            if answers and not session.go_on():
                break
            session.tell("fitting to the objects", done + share * place / len(found))
            reached = place
            _fit_to_objects(session, one, answers)
        return answers
    if not answers and found:  # the one that was begun is worth the wait
        _fit_to_objects(session, found[reached], answers)
    return answers


def _fit_to_objects(session: Session, found: Found, answers: list[Answer]) -> None:
    """Fit what was found in the grid; its answer, if it has one, goes into `answers`."""
    fit = _fitted(session, found)
    if fit is not None:
        answers.append(_answer(session, fit))
        session.record("fit", score=answers[-1].score, program=format_program(answers[-1].program))


def _fitted(session: Session, found: Found) -> _Fit | None:
    """A filling fitted to its objects, its extents chosen anew."""
    setting = found.filling.settings[found.setting]
    filling = with_settings(found.filling, (setting,))
    now = _followed(session, filling, found.z, rounds=_ROUNDS)
    if now is None:
        return None
    now = _on_objects(session, now)
    wide = widened(filling)
    for _ in range(_EXTENTS_TRIED):
        chosen = _best_extent(session, wide, now, setting)
        if chosen is None or (chosen[1] == setting and torch.equal(chosen[0], now.z)):
            break
        z, setting = chosen
        moved = _followed(session, with_settings(filling, (setting,)), z, rounds=_ROUNDS)
        if moved is None:
            break
        now = moved
    last = _followed(session, now.filling, now.z, rounds=_LAST_ROUNDS)
    best = last if last is not None and last.mean >= now.mean else now
    best = _centred(session, best)
    return _Fit(best, setting)


def _followed(session: Session, filling: Filling, z: Tensor, *, rounds: int) -> CurveFit | None:
    """Registration that keeps the limits: a number that leaves its own is held there, the others follow."""
    evidence = session.evidence
    fit = measured(evidence, filling, z, focal_mm=evidence.focal_mm)
    if fit is None or not filling.moving:
        return fit
    free = follow(evidence, fit, rounds=rounds)
    held = torch.zeros(len(z), dtype=torch.bool)
    for _ in range(len(z)):
        inside = kept_within(filling, free.z)
        out = (inside - free.z).abs() > 1e-9
        if not bool(out.any()):
            break
        held |= out
        start = measured(evidence, pinned(filling, inside, held), inside, focal_mm=evidence.focal_mm)
        if start is None:
            break
        free = follow(evidence, start, rounds=rounds)
        free = replace(free, z=torch.where(held, inside, free.z))
    again = measured(evidence, filling, kept_within(filling, free.z), focal_mm=evidence.focal_mm)
    return again if again is not None and again.mean > fit.mean else fit


def _on_objects(session: Session, fit: CurveFit) -> CurveFit:
    """The fit, or the same half a step on, where objects rather than the gaps between them are drawn."""
    best, lead = fit, _MORE_OBJECT * standing_out(session.evidence, fit)
    steps = half_steps(fit.filling.pattern).tolist()
    for i, j in [*steps, *([-i, -j] for i, j in steps)]:
        z = _shifted(fit.filling, fit.z, (i, j))
        moved = None if z is None else measured(session.evidence, fit.filling, z, focal_mm=fit.focal_mm)
        if moved is None or moved.mean < 0.7 * fit.mean:
            continue
        found = standing_out(session.evidence, moved)
        if found > lead:
            best, lead = moved, found
    return best


def _centred(session: Session, fit: CurveFit) -> CurveFit:
    """The fit in the middle of its objects, if the limits allow it."""
    moved = centred(session.evidence, fit)
    inside = kept_within(fit.filling, _turned(fit.filling, moved.z))
    again = measured(session.evidence, fit.filling, inside, focal_mm=fit.focal_mm)
    return again if again is not None and again.mean > 0.8 * fit.mean else fit


def _best_extent(
    session: Session, wide: Filling, now: CurveFit, setting: tuple[int, ...]
) -> tuple[Tensor, tuple[int, ...]] | None:
    """Which objects are there: the setting of the extents that draws most of them and little else.

    Where the sketch's numbers allow, its indices are also counted from one object earlier or later.
    """
    typical = max(now.mean, 0.05)
    best: tuple[float, Tensor, tuple[int, ...]] | None = None
    for shift in [(0, 0), *_SHIFTS]:
        z = now.z if shift == (0, 0) else _shifted(wide, now.z, shift)
        if z is None:
            continue
        gains = _gains(session, wide, z, side=now.side, typical=typical)
        value, chosen = best_setting(wide, gains, setting)
        if best is None or value > best[0] + 0.5 * typical * (shift != (0, 0)):
            best = value, z, chosen
    return None if best is None else best[1:]


def _gains(session: Session, wide: Filling, z: Tensor, *, side: float, typical: float) -> Tensor:
    """What drawing each index gains, [N]: its contrast beyond what an object must have; 0 out of sight."""
    evidence = session.evidence
    theta = wide.theta(z)
    seen = evidence.in_sight(wide.pattern, theta)
    gains = torch.full((len(seen),), -0.02 * typical, dtype=torch.float64)
    if int(seen.sum()) >= 3:
        at = torch.nonzero(seen)[:, 0]
        at = at[thinned(wide.pattern.index[at], _MOST_WEIGHED)]
        index = wide.pattern.index[at].double()
        found = patch_contrast(evidence, wide.pattern, theta, index, side=side, focal_mm=evidence.focal_mm)
        gains[at] = found.contrast.double() - _PRESENT * typical
    return gains


def _shifted(filling: Filling, z: Tensor, shift: tuple[float, float]) -> Tensor | None:
    """The numbers that draw at (i, j) what z draws at (i, j) + shift; None where the sketch cannot say it."""
    theta = filling.theta(z)
    paths = filling.pattern.paths
    moved = theta.clone()
    for place, path in enumerate(paths):
        if path.startswith("draw.") and path.endswith(".1"):
            kind = path[:-2]
            for variable, amount in zip(("i", "j"), shift, strict=True):
                moved[place] += amount * theta[paths.index(f"{kind}.{variable}")]
    if torch.allclose(moved, theta):
        return None
    found = filling.z_of(moved)
    exact = torch.allclose(filling.theta(found), moved, atol=1e-6)
    within = torch.allclose(kept_within(filling, _turned(filling, found)), _turned(filling, found))
    return _turned(filling, found) if exact and within else None


def _turned(filling: Filling, z: Tensor) -> Tensor:
    """Angles brought back by whole turns into the limits that a person gave, where they can be."""
    turns = torch.tensor([unknown.range.turns and unknown.hard for unknown in filling.moving])
    lower = torch.tensor([unknown.range.lower for unknown in filling.moving]).double()
    return torch.where(turns, lower + (z - lower) % 360, z)


def _answer(session: Session, fit: _Fit) -> Answer:
    program = fit.curve.filling.program(fit.curve.z, fit.setting)
    if int(session.evidence.in_sight(compile(program)).sum()) < _FEWEST:
        return Answer(program, structure_of(program), 0.0, 0.0)
    # What a curve explains beside its draws is told in its score, but makes it no better a filling.
    score = score_of_program(session.evidence, program)
    return Answer(
        program, structure_of(program), score, score_of_program(session.evidence, program, elsewhere=False)
    )


def structure_of(program: Program) -> StructureFound:
    """What a program's pattern is called: circular for one curve, hybrid for several, else lattice."""
    parts = nest(program)
    if not any(isinstance(form, Polar) for form in (parts.draw.x, parts.draw.y)):
        return "lattice"
    return "hybrid" if parts.for_i is not None and parts.for_j is not None else "circular"


def _different(answers: list[Answer]) -> list[Answer]:
    """Those whose text none before them has."""
    kept: dict[Program, Answer] = {}
    for answer in answers:
        kept.setdefault(answer.program, answer)
    return list(kept.values())


def _text(filling: Filling, z: Tensor, setting: int) -> str:
    return format_program(filling.program(z, filling.settings[setting]))

"""Lattices on a photo: proposals, growth, the primitive cell, phase and extent, in this order."""

import numpy as np
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.answer import Answer
from p3i.search.extent.layout import Layout, filling_layout, found_layout, layout_fit, refitted, strict_layout
from p3i.search.extent.primitive import primitive
from p3i.search.fit.grow import Fit, follow, grow
from p3i.search.forms.guess import Proposal
from p3i.search.forms.lattice import Lattice, lattice_pattern, map_from_index
from p3i.search.judge.elsewhere import with_others
from p3i.search.look.contrast import score_of
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.propose.windows import straightened_proposals, window_proposals
from p3i.search.result import NEEDED

# So many proposals of each kind are looked at, and so many fits that differ are grown in all.
_MOST_PROPOSALS = 10
_MOST_GROWN = 7
# Fits of this worth are certain enough that only a better one could matter; after two more tries without
# one, of proposals at least half as promising as the best of their kind, the search goes on to finish it.
_CERTAIN = 0.025
_TRIES_WHEN_CERTAIN = 2
# A runner-up is finished too where its worth is at least this share of the best.
_RIVAL = 0.5
# A pattern of n cells counts as if it had _FEW_CELLS fewer: the numbers and the mean cell take their part.
_FEW_CELLS = 10
# Below that number they still count a little, so that a pattern of few cells wins where there is no other.
_DOUBT = 0.05
_LEAST_CELLS = 4
_LAST_ROUNDS = 4
# A fit of less worth is none: on rendered scenes and photos the fits of true patterns had five times as much.
_LEAST_WORTH = 5e-4
# So many fits are worked out to programs before the search gives up.
_MOST_FINISHED = 3
# A proposal says nothing of its extent; the trace shows it so many steps to each side.
_PROPOSED_STEPS = 6


def find_lattices(session: Session) -> list[Answer]:
    """The lattices of a photo as finished programs, the most worth first."""
    pattern = lattice_pattern()
    fits: list[Fit] = []
    with session.until_interrupted():
        _grow_all(session, pattern, fits)
    fits.sort(key=lambda fit: -worth(fit))
    answers: list[Answer] = []
    finished = False
    with session.until_interrupted():
        _finish_all(session, pattern, fits, answers)
        finished = True
    if not finished and not answers:  # what is finished by now is kept, and the best is worth the wait
        _finish_all(session, pattern, fits[:1], answers)
    answers.sort(key=lambda answer: -answer.worth)
    with session.until_interrupted():
        return with_others(session, pattern, fits, answers, finish=_finished)
    return answers


def worth(fit: Fit) -> float:
    """How much of the photo a fit explains, and how well, less what few cells explain by chance."""
    contrast = fit.contrast[fit.support]
    count = len(contrast)
    if count < _LEAST_CELLS:
        return 0.0
    beyond_chance = max(1 - _FEW_CELLS / count, _DOUBT * (1 - _LEAST_CELLS / count))
    return fit.score * float(contrast.mean()) * beyond_chance


def _grow_all(session: Session, pattern: Pattern, fits: list[Fit]) -> None:
    """Grow the proposals, the promising ones first and none twice; the fits go into `fits`."""
    session.tell("looking through windows", 0.02)
    windows = window_proposals(session.evidence)[:_MOST_PROPOSALS]
    session.tell("straightening", 0.1)
    views = straightened_proposals(session.evidence)[:_MOST_PROPOSALS]
    most = {kind[0].local: kind[0].worth for kind in (views, windows) if kind}
    grown = idle = 0
    for proposal in _alternating(views, windows):
        if not session.go_on() or grown >= _MOST_GROWN:
            return
        certain = max((worth(fit) for fit in fits), default=0.0) > _CERTAIN
        if certain and proposal.worth < _RIVAL * most[proposal.local]:
            continue
        if any(_explained(session.evidence, pattern, proposal, fit) for fit in fits):
            continue
        session.tell("refining", 0.3 + 0.5 * grown / _MOST_GROWN)
        fit = grow(session.evidence, pattern, proposal, generator=session.generator)
        grown += fit is not None  # what cannot even be begun costs next to nothing
        _record(session, pattern, proposal, fit)
        if fit is None or int(fit.support.sum()) < _LEAST_CELLS:
            continue
        better = worth(fit) > max((worth(other) for other in fits), default=0.0)
        fits.append(fit)
        certain = max(worth(other) for other in fits) > _CERTAIN
        idle = 0 if better else idle + 1
        if certain and idle >= _TRIES_WHEN_CERTAIN:
            return


def _alternating(first: list[Proposal], second: list[Proposal]) -> list[Proposal]:
    """The two lists merged, one of each in turn."""
    merged = []
    for place in range(max(len(first), len(second))):
        merged += first[place : place + 1] + second[place : place + 1]
    return merged


def _finish_all(session: Session, pattern: Pattern, fits: list[Fit], answers: list[Answer]) -> None:
    """Work out fits, the best first, to programs until one is sure; the programs go into `answers`."""
    finished: list[Fit] = []
    for fit in fits:
        if worth(fit) < _LEAST_WORTH:
            break
        sure = max((answer.score for answer in answers), default=0.0) >= NEEDED
        if sure and len(answers) >= session.config.top and worth(fit) < _RIVAL * worth(finished[0]):
            break
        if len(finished) >= max(_MOST_FINISHED, session.config.top) or (finished and not session.go_on()):
            break
        if sure and any(_same(session.evidence, pattern, fit, other) for other in finished):
            continue
        session.tell("reading off the objects", 0.8 + 0.05 * len(finished))
        finished.append(fit)
        answer = _finished(session, pattern, fit)
        if answer is not None:
            answers.append(answer)


def _finished(session: Session, pattern: Pattern, fit: Fit) -> Answer | None:
    """The last refinement on the fine map, the primitive cell, phase and extent, and the score."""
    evidence = session.evidence
    # The middle of the support is where cells are measured and where the index starts.
    middle = fit.index[fit.support].median(0).values
    theta = Lattice.of(pattern, fit.theta).moved_to(middle.numpy()).theta(pattern)
    selected = fit.index[fit.support] - middle
    last = follow(
        evidence, pattern, theta, selected, generator=session.generator, rounds=_LAST_ROUNDS, finest=True
    )
    if last is None or int(last.support.sum()) < _LEAST_CELLS:
        return None
    readings = primitive(evidence, pattern, last)
    best = _best_of(session, pattern, readings)
    if (best is None or best.score < NEEDED) and all(theta is not last.theta for theta, _ in readings):
        own = _best_of(session, pattern, [(last.theta, last.index[last.support])])
        best = max((one for one in (best, own) if one is not None), key=lambda one: one.score, default=None)
    return best


def _best_of(session: Session, pattern: Pattern, readings: list[tuple[Tensor, Tensor]]) -> Answer | None:
    """Of one ground's cells (theta [P], index [N, 2]), finished each, the program with the best score."""
    best: Answer | None = None
    for theta, ground in readings:
        layout = found_layout(session.evidence, Lattice.of(pattern, theta), ground)
        if layout is None:
            continue
        answer = _answer(session, pattern, refitted(session.evidence, pattern, layout))
        if answer is not None and (best is None or answer.score > best.score):
            best = answer
    return best


def _answer(session: Session, pattern: Pattern, layout: Layout) -> Answer | None:
    """The program of a layout with its score, under the options that change what is drawn."""
    notes: tuple[str, ...] = ()
    if session.config.strict:
        free, (layout, moved) = layout, strict_layout(layout)
        notes = (_strict_note(free, layout, moved * session.evidence.image.size.unit_px),)
    measured = layout_fit(session.evidence, layout)
    if measured is None:
        return None
    score = score_of(measured.contrast)
    if session.config.extent_used == "image":
        layout = filling_layout(session.evidence, pattern, layout)
    program = layout.program(from_zero=not session.config.strict)
    session.record("candidate", program=program, score=score, worth=worth(measured))
    return Answer(program, "lattice", score, worth(measured), notes)


def _strict_note(free: Layout, strict: Layout, moved_px: float) -> str:
    """What Table 1 cost an answer: how far its objects moved, and the outline that it cannot say."""
    note = f"Table 1 has no constants: the objects lie {moved_px:.1f} pixels from the free fit"
    lost = len(free.guards) - len(strict.guards)
    return f"{note}, and {lost} of its {len(free.guards)} guards cannot be said" if lost else note


def _explained(evidence: Evidence, pattern: Pattern, proposal: Proposal, fit: Fit) -> bool:
    """Whether a fit holds the proposal's lattice already, or one that it is part of."""
    if worth(fit) < _CERTAIN:
        return False  # another start may do better
    level = evidence.frame
    wide = proposal.lattice.theta(pattern)
    ours, theirs = (map_from_index(level, pattern, theta) for theta in (fit.theta, wide))
    if not proposal.local:
        at = level.map_from_plane(pattern, fit.theta).numpy() @ [*Lattice.of(pattern, fit.theta).origin, 1.0]
    else:
        at = level.map_from_plane(pattern, wide).numpy() @ [*proposal.lattice.origin, 1.0]
        cell = np.linalg.inv(ours) @ (at / at[2])
        away = (fit.index[fit.support].numpy() - cell[:2] / cell[2]).astype(float)
        if len(away) == 0 or np.abs(away).max(1).min() > 1.0:
            return False
    point = at[:2] / at[2]
    return _one_divides_the_other(ours, theirs, point)


def _same(evidence: Evidence, pattern: Pattern, fit: Fit, other: Fit) -> bool:
    """Whether two fits mean one lattice, or one a multiple of the other."""
    ours, theirs = (map_from_index(evidence.frame, pattern, one.theta) for one in (fit, other))
    at = ours @ [*fit.index[fit.support].median(0).values.tolist(), 1.0]
    return _one_divides_the_other(ours, theirs, at[:2] / at[2])


def _one_divides_the_other(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> bool:
    """Whether, at a map point, one lattice (index -> map) is a part of the other, or the same."""
    a, b = _steps_at(a, point), _steps_at(b, point)
    return _whole_multiple(a, b) or _whole_multiple(b, a)


def _steps_at(matrix: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The steps of i and j in map pixels (as columns) at a map point, under index -> map `matrix`."""
    back = np.linalg.inv(matrix) @ [*point, 1.0]
    depth = matrix[2] @ (back / back[2])
    return (matrix[:2, :2] - np.outer(point, matrix[2, :2])) / depth


def _whole_multiple(steps: np.ndarray, of: np.ndarray) -> bool:
    """Whether the steps (columns) are whole combinations of others, to within a seventh of a step."""
    ratio = np.linalg.solve(of, steps)
    whole = np.round(ratio)
    return bool(np.abs(ratio - whole).max() < 0.15 and abs(np.linalg.det(whole)) >= 0.5)


def _record(session: Session, pattern: Pattern, proposal: Proposal, fit: Fit | None) -> None:
    if session.trace is None:
        return
    spread = (-_PROPOSED_STEPS, _PROPOSED_STEPS + 1)
    told = Layout(proposal.lattice, spread, spread).program()
    session.record("proposal", program=told, worth=proposal.worth, local=proposal.local)
    if fit is not None and bool(fit.support.any()):
        cells = fit.index[fit.support]
        low, high = cells.min(0).values.int().tolist(), (cells.max(0).values.int() + 1).tolist()
        found = Layout(Lattice.of(pattern, fit.theta), (low[0], high[0]), (low[1], high[1]))
        session.record("fit", program=found.program(), score=fit.score, worth=worth(fit), cells=len(cells))

"""Photo -> program: every sketch in turn, its guesses fitted, drawn and judged, until none has room left."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch

from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program
from p3i.search.anew import drawn_anew
from p3i.search.answer import Answer
from p3i.search.closer import looked_closer
from p3i.search.config import SearchConfig
from p3i.search.extent.drawn import drawn
from p3i.search.extent.layout import proposed, supported
from p3i.search.fit.best import Best
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.fitting import certain, fit_places, holds, worth
from p3i.search.fit.same import same_lattice, says_already
from p3i.search.forms.asked import asks_for_itself, check_asked
from p3i.search.forms.guess import Guess
from p3i.search.forms.sketches import Sketched, sketches
from p3i.search.forms.spelled import lattice_filling
from p3i.search.judge.accept import beyond_noise
from p3i.search.judge.answered import answers_of
from p3i.search.judge.elsewhere import with_others
from p3i.search.look.evidence import FINE, Evidence
from p3i.search.look.session import TRACE_VERSION, Progress, Session, Trace
from p3i.search.optics.curve_focal import with_paid_focal
from p3i.search.optics.lens import through_lens, with_lens
from p3i.search.outcome import focal_of, outcome, told
from p3i.search.propose.proposers import Proposer, proposers, share_of_time
from p3i.search.result import StopReason, SynthesisResult
from p3i.vision.image import Image
from p3i.vision.threads import limited_threads

# Pictures below this many pixels a side, or with less than this share known, are not searched.
_LEAST_SIDE = 32
_LEAST_KNOWN = 0.1
# The spread of grey levels (0..1) below which a picture is flat.
_LEAST_SPREAD = 0.004
# Once a fit is certain, so many more are tried without a better one, of guesses at least this promising; and
# of the fits, only those with this share of the best one's worth are drawn once an answer is sure.
_TRIES_WHEN_CERTAIN = 2
_RIVAL = 0.5

Fitted = tuple[Guess, Fit]


def synthesize(
    image: Image,
    config: SearchConfig,
    *,
    progress: Progress | None = None,
    trace: Trace | None = None,
) -> SynthesisResult:
    """Find the camera and the program of the pattern on a photo.

    The result's `program` is None where nothing convinces (judge/accept.py); then `stop` and `score` say why.
    The program has no header yet. A KeyboardInterrupt ends the search with the best that was found; a second
    one, while that is being finished, is raised.
    """
    # Where no guess climbs by gradients, torch need not prepare for them: a fifteenth of the time.
    climbs = asks_for_itself(config) or config.exhaustive_s is not None
    with limited_threads(config.threads), torch.inference_mode(not climbs):
        assumed = focal_of(image, config)
        if (hopeless := _hopeless(image)) is not None:
            return told(config, assumed, None, hopeless)
        check_asked(config, image.size)
        look = Session(Evidence(image, config, assumed[0]), config, progress, trace and _in_text(trace))
        width, height = image.size.width, image.size.height
        look.record("photo", width=width, height=height, focal=assumed[0], version=TRACE_VERSION)
        if isinstance(config.lens, float | int):
            answers = through_lens(look, config.lens, _answers)
        else:
            answers = _answers(look)
            if config.lens == "auto" and not asks_for_itself(config):
                answers = with_lens(look, answers, drawn_anew)
        result = look.completed(lambda: outcome(look, answers, assumed=assumed))
        closer = looked_closer(look, _answers) if result.program is None else None
        if closer is None:
            return result
        seen = look.completed(lambda: outcome(*closer, assumed=assumed))
        return result if seen.program is None else seen


def searched(look: Session) -> Best:
    """All that is found of the sketches which the options ask for; an interrupt ends the search with that."""
    best = Best()
    spoken: set[Proposer] = set()
    begun = False
    with look.until_interrupted():
        for sketch in sketches(look.config):
            if begun and not look.go_on():
                break
            if not best.leaves_room_for(sketch):
                continue
            for proposer in proposers(look.config):
                if sketch.shape in proposer.writes and proposer not in spoken:
                    spoken |= {proposer} if proposer.all_at_once else set()
                    _take_up(look, sketch, proposer, best)
            begun |= sketch.asked
    return best


def _take_up(look: Session, sketch: Sketched, proposer: Proposer, best: Best) -> None:
    """Fill a sketch: fit the guesses of each round, draw the best of the fits, and judge what is drawn."""
    look.record("sketch", name=sketch.name, bits=sketch.bits)
    drawn: list[Fit] = []
    with look.until_interrupted(), look.within(share_of_time(look.config, sketch)):
        for guesses in proposer.rounds(look, sketch, best):
            fits = _fitted(look, guesses, most=proposer.most_fitted)
            best.fits += [fit for _, fit in fits]
            for guess, fit in _rivals(look, fits, sketch, best, drawn, most=proposer.most_drawn):
                drawn.append(fit)
                look.tell("reading off the objects", 0.8)
                found = look.completed(partial(_drawn, look, sketch, guess, fit))
                if found is not None:
                    best.add(sketch, found, look.completed(partial(answers_of, look, sketch, found)))
                    look.record("candidate", program=found.program, score=found.sure, worth=worth(found.fit))


def _drawn(look: Session, sketch: Sketched, guess: Guess, fit: Fit) -> Drawn | None:
    """What a fit draws, a ring with its own focal where that pays for itself."""
    ring = sketch.structure == "circular" and sketch.by_hand is None
    return drawn(look, sketch, with_paid_focal(look.evidence, fit) if ring else fit, guess.base)


def _fitted(look: Session, guesses: Iterable[Guess], *, most: int) -> list[Fitted]:
    """The guesses fitted, the most worth first, until time is up or a fit is certain."""
    fits: list[Fitted] = []
    tried = fitted = idle = 0
    with look.until_interrupted():
        for guess in guesses:
            if fitted >= most or (tried and not look.go_on()):
                break
            sure = any(certain(fit) for _, fit in fits)
            if sure and guess.promise < _RIVAL:
                continue
            if any(says_already(look.evidence, own, fit, guess) for own, fit in fits):
                continue
            look.tell("refining", 0.3 + 0.5 * fitted / most)
            fit = look.completed(partial(_fit, look, guess))
            tried += 1
            fitted += fit is not None  # what cannot be begun costs next to nothing
            if fit is None or not holds(fit, guess):
                continue
            idle = 0 if all(worth(fit) > worth(other) for _, other in fits) else idle + 1
            fits.append((guess, fit))
            if idle >= _TRIES_WHEN_CERTAIN and any(certain(fit) for _, fit in fits):
                break
    return sorted(fits, key=lambda one: -worth(one[1]))


def _fit(look: Session, guess: Guess) -> Fit | None:
    """A guess fitted, and both told."""
    look.record("proposal", program=look.trace and proposed(guess), promise=guess.promise)
    fit = fit_places(look, guess)
    if fit is not None:
        look.record("fit", program=look.trace and supported(fit), score=fit.mean, worth=worth(fit))
    return fit


def _rivals(
    look: Session, fits: list[Fitted], sketch: Sketched, best: Best, drawn: list[Fit], *, most: int
) -> Iterator[Fitted]:
    """The fits to draw, the best first: once an answer is sure, only what could still be a better one.

    `drawn` are those that were drawn so far, of this round and of those before.
    """
    top, before = look.config.top, len(drawn)
    for guess, fit in fits:
        if len(drawn) - before >= max(most, top) or (len(drawn) > before and not look.go_on()):
            return
        answers = best.of(sketch)
        if sketch.by_hand is None and any(beyond_noise(answer.worth) for answer in answers):
            if len(answers) >= top and worth(fit) < _RIVAL * max(map(worth, drawn)):
                return
            if any(same_lattice(look.evidence, fit, other) for other in drawn):
                continue
        yield guess, fit


def _answers(look: Session) -> list[Answer]:
    """The answers of a search, those first that explain most."""
    best = searched(look)
    answers = best.in_order()
    if asks_for_itself(look.config):
        return answers
    lattices = [fit for fit in best.fits if fit.filling is lattice_filling()]
    return look.completed(lambda: with_others(look, lattices, answers, finish=_finished))


def _finished(look: Session, fit: Fit) -> Answer | None:
    """A lattice that was fitted, as an answer; None where no object is seen."""
    sketch = sketches(SearchConfig(structure="lattice"))[0]
    found = drawn(look, sketch, fit, None)
    return None if found is None else answers_of(look, sketch, found)[0]


def _in_text(trace: Trace) -> Trace:
    """A trace that is told programs, for one that takes their text."""

    def told(step: Mapping[str, Any]) -> None:
        program = step.get("program")
        text = format_program(replace(program, header=None)) if isinstance(program, Program) else program
        trace({**step, "program": text} if "program" in step else step)

    return told


def _hopeless(image: Image) -> StopReason | None:
    """Why a picture is not worth a search, if so."""
    if min(image.size.width, image.size.height) < _LEAST_SIDE:
        return StopReason.TOO_SMALL
    if float(image.valid[... if image.roi is None else image.roi].mean()) < _LEAST_KNOWN:
        return StopReason.TOO_LITTLE_KNOWN
    step = max(1, image.size.longer // FINE)
    grey = image.pixels[::step, ::step].mean(2)[image.valid[::step, ::step]]
    if len(grey) == 0 or float(np.std(grey)) < _LEAST_SPREAD:
        return StopReason.FLAT
    return None

"""Photo -> program: the whole search, from what may be looked at to the answer or the reason for none."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.asked import asked_for, check_asked, needed_for, stated_focal, walk, why_not
from p3i.search.config import SearchConfig
from p3i.search.families import FAMILIES
from p3i.search.judge.accept import convincing, faint_note, false_alarms, with_printed_scores
from p3i.search.judge.bits import by_explained
from p3i.search.judge.probability import Signs, probability
from p3i.search.judge.region import centers_px, region_px, share_in_sight
from p3i.search.judge.same import distinct_answers
from p3i.search.look.evidence import FINE, Evidence
from p3i.search.look.session import TRACE_VERSION, Progress, Session, Trace
from p3i.search.optics.focal import with_own_focal
from p3i.search.optics.lens import find_with_lens
from p3i.search.optics.mirrored import ambiguity_note, mirrored_camera
from p3i.search.optics.tilt import doubt_note, pose_sigma_deg
from p3i.search.result import (
    FOCAL_REASONS,
    Candidate,
    FocalSource,
    StopReason,
    SynthesisResult,
)
from p3i.search.table1 import unwritable_note, within_table1
from p3i.vision.image import Image
from p3i.vision.threads import limited_threads

# Pictures below this many pixels a side, or with less than this share known, are not searched.
_LEAST_SIDE = 32
_LEAST_KNOWN = 0.1
# The spread of grey levels (0..1) below which a picture is flat.
_LEAST_SPREAD = 0.004
# Where a family has an answer of this score, no other kind of pattern could explain the photo better.
_BEYOND_DOUBT = 0.3
# A curve of which the photo shows less than this share was not seen.
_LEAST_IN_SIGHT = 0.5


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
    with limited_threads(config.threads):
        return _searched(image, config, progress, trace)


def _searched(
    image: Image, config: SearchConfig, progress: Progress | None, trace: Trace | None
) -> SynthesisResult:
    """`synthesize`, however many threads there are."""
    assumed = focal_of(image, config)
    hopeless = _hopeless(image)
    if hopeless is not None:
        return _told(config, assumed, None, hopeless)
    check_asked(config, image.size)
    session = Session(Evidence(image, config, assumed[0]), config, progress, trace and _in_text(trace))
    width, height = image.size.width, image.size.height
    session.record("photo", width=width, height=height, focal=assumed[0], version=TRACE_VERSION)
    answers = _found(session) if config.lens is None else _found_with_lens(session)
    return session.completed(lambda: _result(session, answers, assumed=assumed))


def _result(
    session: Session, answers: list[Answer], *, assumed: tuple[float, FocalSource]
) -> SynthesisResult:
    """The best of the answers as the result of the search, or why none of them is one."""
    config, image, focal_mm = session.config, session.evidence.image, assumed[0]
    needed = needed_for(config)
    if config.focal_mm == "auto":
        answers = [with_own_focal(answer, size=image.size, assumed=assumed) for answer in answers]
    if config.strict:
        answers = within_table1(session, answers)
    told = with_printed_scores(session.evidence, answers, needed=needed)
    sure = convincing(answers, told, needed=needed, fills=config.extent_used == "image")
    # What a person asked for is theirs to choose, whatever it costs.
    asked = asked_for(config) is not None
    seen = sure if asked else [answer for answer in sure if _in_sight(session, answer)]
    good = seen if asked else [answer for answer in seen if answer.worth > 0]
    if not good:
        best = max((answer.score for answer in told), default=0.0)
        reason = StopReason.COSTS_MORE if seen else StopReason.OUT_OF_SIGHT if sure else why_not(config)
        if session.unwritable and not sure:
            reason = StopReason.OUTSIDE_TABLE_1
        bits = max((answer.worth for answer in told), default=None)
        stop = session.stopped or reason
        refused = _told(config, assumed, None, stop, agreement=best, bits=bits, needed=needed)
        session.record("answer", program=None, score=best, reason=refused.reason)
        return refused
    good = distinct_answers(good, size=image.size, focal_mm=focal_mm)
    first = good[0]
    signs = [_signs(session, answer, good) for answer in good[: config.top]]
    margin_bits, sigma_deg = signs[0].margin_bits, signs[0].pose_sigma_deg
    margin = min(max(margin_bits / max(abs(first.worth), 1.0), 0.0), 1.0)
    other = _mirrored(session, first)
    doubt = None if sigma_deg is None else doubt_note(sigma_deg, two_tilts=other is not None)
    ambiguity = None if other is None else ambiguity_note(other)
    notes = (*first.notes, *(note for note in (ambiguity, doubt) if note is not None))
    if config.extent_used == "image" and first.structure != "lattice":
        notes = (*notes, "--extent image continues lattices only: this is drawn as far as it was found")
    if session.unwritable - {first.structure}:
        notes = (*notes, unwritable_note(session))
    centers = centers_px(first.program, image, first.focal_mm or focal_mm, lens_k1=first.lens_k1)
    by_score = first.score >= needed
    if not by_score and config.extent_used == "found":
        notes = (*notes, faint_note(first, len(centers)))
    session.tell("done", 1.0)
    session.record("answer", program=first.program, score=first.score, focal=first.focal_mm or focal_mm)
    return _told(
        config,
        assumed,
        first.program,
        session.stopped or StopReason.FOUND,
        structure=first.structure,
        score=probability(signs[0]),
        agreement=first.score,
        bits=first.worth,
        margin_bits=margin_bits,
        margin=margin,
        needed=needed if by_score else None,
        false_alarms=false_alarms(first.structure, first.worth),
        candidates=tuple(
            Candidate(
                program=answer.program,
                score=probability(told_by),
                agreement=answer.score,
                bits=answer.worth,
                structure=answer.structure,
                false_alarms=false_alarms(answer.structure, answer.worth),
                **_focal_facts(answer, assumed),  # pyright: ignore[reportArgumentType]
            )
            for answer, told_by in zip(good, signs, strict=False)
        ),
        centers=centers,
        region=region_px(first.program, image, first.focal_mm or focal_mm, lens_k1=first.lens_k1),
        lens_k1=first.lens_k1,
        pose_sigma_deg=None if sigma_deg is None else round(sigma_deg, 3),
        mirrored=None if other is None else (round(other.rx_deg, 2), round(other.ry_deg, 2)),
        notes=notes,
        **_focal_facts(first, assumed),
    )


def _signs(session: Session, answer: Answer, good: list[Answer]) -> Signs:
    """What one of the good answers is judged by when people are told how likely it is right."""
    rivals = [other.worth for other in good if other is not answer]
    return Signs(
        structure=answer.structure,
        bits=answer.worth,
        agreement=answer.score,
        margin_bits=answer.worth - max(rivals, default=0.0),
        pose_sigma_deg=pose_sigma_deg(session.evidence, answer),
    )


def _told(
    config: SearchConfig,
    assumed: tuple[float, FocalSource],
    program: Program | None,
    stop: StopReason,
    **more: object,
) -> SynthesisResult:
    """A result with the facts that every one has, and `more`."""
    told = {**_focal_facts(None, assumed), "features": config.features_used, "seed": config.seed, **more}
    return SynthesisResult(program=program, stop=stop, **told)  # pyright: ignore[reportArgumentType]


def _found(session: Session) -> list[Answer]:
    """What every family that is asked for finds, the most worth first; an interrupt ends the search."""
    answers: list[list[Answer]] = []
    with session.until_interrupted():
        asked = asked_for(session.config)
        if asked is not None:
            answers.append(asked(session))
        for family in FAMILIES if asked is None else ():
            beyond_doubt = any(
                answer.score > _BEYOND_DOUBT and answer.structure != family.starts_from
                for found in answers
                for answer in found
            )
            if answers and not session.go_on():
                break
            if session.config.structure == family.structure or (
                session.config.structure == "auto" and not beyond_doubt
            ):
                answers.append(family.find(session))
        if session.config.exhaustive_s is not None and session.go_on():
            answers.append(walk(session))
    return session.completed(
        lambda: by_explained(session.evidence, answers, needed=needed_for(session.config))
    )


def _found_with_lens(session: Session) -> list[Answer]:
    """What is found through the lens of the options; once interrupted, what the photo as it is had shown."""
    plain: list[Answer] = []

    def search(inner: Session) -> list[Answer]:
        found = _found(inner)
        if inner is session:
            plain[:] = found
        return found

    with session.until_interrupted():
        return find_with_lens(session, search)
    return plain


def _in_text(trace: Trace) -> Trace:
    """A trace that is told programs, for one that takes their text."""

    def told(step: Mapping[str, Any]) -> None:
        program = step.get("program")
        text = format_program(replace(program, header=None)) if isinstance(program, Program) else program
        trace({**step, "program": text} if "program" in step else step)

    return told


def _in_sight(session: Session, answer: Answer) -> bool:
    """Whether the photo shows at least half of the objects of a curve, which it would be the evidence of.

    The box of indices of a lattice that stands askew to the frame has half of its corners outside.
    """
    if answer.structure == "lattice":
        return True
    focal_mm = answer.focal_mm or session.evidence.focal_mm
    shown = share_in_sight(answer.program, session.evidence.image, focal_mm, lens_k1=answer.lens_k1)
    return shown >= _LEAST_IN_SIGHT


def _mirrored(session: Session, answer: Answer) -> Camera | None:
    """The other tilt that a ring leaves open; more than one circle tells the tilt, and no time is no look."""
    if answer.structure != "circular" or answer.lens_k1 is not None or session.stopped is not None:
        return None
    with session.until_interrupted():
        return mirrored_camera(session.evidence, answer)
    return None


def focal_of(image: Image, config: SearchConfig) -> tuple[float, FocalSource]:
    """The focal that is assumed, and why: the option, a sketch's header, the photo's EXIF data, or 35 mm."""
    if config.focal_mm is not None and config.focal_mm != "auto":
        return config.focal_mm, "option"
    if (stated := stated_focal(config)) is not None:
        return stated, "header"
    if image.focal_mm is not None:
        return image.focal_mm, "exif"
    return 35.0, "default"


def _focal_facts(answer: Answer | None, assumed: tuple[float, FocalSource]) -> dict[str, object]:
    """The focal of an answer, its source and the reason, as fields of a result; None is told as assumed."""
    mm, source = assumed
    if answer is not None and answer.focal_mm is not None:
        mm, source = answer.focal_mm, "pattern"
    reason = answer.focal_reason if answer is not None else ""
    return {"focal_mm": mm, "focal_source": source, "focal_reason": reason or FOCAL_REASONS[source]}


def _hopeless(image: Image) -> StopReason | None:
    """Why a picture is not worth a search, if so."""
    if min(image.size.width, image.size.height) < _LEAST_SIDE:
        return StopReason.TOO_SMALL
    if float(image.valid.mean()) < _LEAST_KNOWN:
        return StopReason.TOO_LITTLE_KNOWN
    step = max(1, image.size.longer // FINE)
    grey = image.pixels[::step, ::step].mean(2)[image.valid[::step, ::step]]
    if len(grey) == 0 or float(np.std(grey)) < _LEAST_SPREAD:
        return StopReason.FLAT
    return None

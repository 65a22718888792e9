"""From the answers of a search to its result: the best of them, or why none of them is one."""

from p3i.grammar.ast import Program
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.forms.asked import asks_for_itself, needed_for, stated_focal, why_not
from p3i.search.judge.accept import false_alarms, suffices, with_printed_scores
from p3i.search.judge.probability import Signs, probability
from p3i.search.judge.region import centers_px, region_px, share_in_sight
from p3i.search.judge.same import distinct_answers
from p3i.search.judge.table1 import unwritable_note, within_table1
from p3i.search.look.session import Session
from p3i.search.look.upright import UPRIGHT_NOTE
from p3i.search.optics.focal import with_own_focal
from p3i.search.optics.mirrored import ambiguity_note, mirrored_camera
from p3i.search.optics.printed import briefly
from p3i.search.optics.tilt import doubt_note, pose_sigma_deg
from p3i.search.readings import offers, on_asked_circle, other_readings, reading_notes
from p3i.search.result import FOCAL_REASONS, Candidate, FocalSource, StopReason, SynthesisResult
from p3i.vision.image import Image


def outcome(look: Session, answers: list[Answer], *, assumed: tuple[float, FocalSource]) -> SynthesisResult:
    """The best of the answers as the result of the search, or why none of them is one."""
    config, image, focal_mm = look.config, look.evidence.image, assumed[0]
    # What a person asked for is theirs to choose, whatever it costs.
    asked = asks_for_itself(config)
    needed = needed_for(config) if asked else None
    if config.focal_mm == "auto":
        answers = [with_own_focal(answer, size=image.size, assumed=assumed) for answer in answers]
    if config.strict:
        answers = within_table1(look, answers)
    written = answers if asked else [briefly(look.evidence, answer) for answer in answers]
    printed = with_printed_scores(look.evidence, written, needed=needed)
    sure = [answer for answer in printed if suffices(answer, needed)]
    good = sure if asked else [answer for answer in sure if _in_sight(look, answer)]
    if not good:
        best = max((answer.score for answer in printed), default=0.0)
        reason = StopReason.OUT_OF_SIGHT if sure else why_not(config)
        if look.unwritable and not sure:
            reason = StopReason.OUTSIDE_TABLE_1
        bits = None if asked else max((answer.worth for answer in printed), default=None)
        facts = {"bits": bits, "least_period_px": look.evidence.least_period_px, "needed": needed}
        return _refused(look, assumed, look.stopped or reason, best, **facts)
    good = distinct_answers(good, image=image, focal_mm=focal_mm)
    first = on_asked_circle(look, good[0])
    good = [first, *good[1:]]
    if not offers(first, config):
        return _refused(look, assumed, StopReason.NO_SUCH_OBJECT, first.score, readings=first.readings)
    elsewhere = other_readings(look, first, most=config.top - 1)
    listed = [first, *elsewhere, *good[1:]][: config.top]
    signs = [_signs(look, answer, good) for answer in listed]
    margin_bits, sigma_deg = signs[0].margin_bits, signs[0].pose_sigma_deg
    margin = min(max(margin_bits / max(abs(first.worth), 1.0), 0.0), 1.0)
    other = _mirrored(look, first)
    doubt = None if sigma_deg is None else doubt_note(sigma_deg, two_tilts=other is not None)
    ambiguity = None if other is None else ambiguity_note(other)
    hanging = UPRIGHT_NOTE if first.upright else None
    notes = (*first.notes, *(note for note in (hanging, ambiguity, doubt) if note is not None))
    if config.extent_used == "image" and first.structure != "lattice":
        notes = (*notes, "--extent image continues lattices only: this is drawn as far as it was found")
    notes = (*notes, *reading_notes(first, config))
    if look.unwritable - {first.structure}:
        notes = (*notes, unwritable_note(look))
    centers = centers_px(first.program, image, first.focal_mm or focal_mm, lens_k1=first.lens_k1)
    look.tell("done", 1.0)
    look.record("answer", program=first.program, score=first.score, focal=first.focal_mm or focal_mm)
    return told(
        config,
        assumed,
        first.program,
        look.stopped or StopReason.FOUND,
        structure=first.structure,
        score=probability(signs[0]),
        agreement=first.score,
        bits=None if asked else first.worth,
        margin_bits=margin_bits,
        margin=margin,
        needed=needed,
        false_alarms=None if asked else false_alarms(first.worth),
        candidates=tuple(
            Candidate(
                program=answer.program,
                score=probability(told_by),
                agreement=answer.score,
                bits=None if asked else answer.worth,
                structure=answer.structure,
                false_alarms=None if asked else false_alarms(answer.worth),
                reading=next((one for one in answer.readings if one.drawn), None),
                same_lattice=answer in elsewhere,
                upright=answer.upright,
                **_focal_facts(answer, assumed),  # pyright: ignore[reportArgumentType]
            )
            for answer, told_by in zip(listed, signs, strict=True)
        ),
        readings=first.readings,
        centers=centers,
        region=region_px(first.program, image, first.focal_mm or focal_mm, lens_k1=first.lens_k1),
        lens_k1=first.lens_k1,
        pose_sigma_deg=None if sigma_deg is None else round(sigma_deg, 3),
        mirrored=None if other is None else (round(other.rx_deg, 2), round(other.ry_deg, 2)),
        others=first.others,
        window=look.evidence.part.window,
        upright=first.upright,
        notes=notes,
        **_focal_facts(first, assumed),
    )


def _refused(
    look: Session, assumed: tuple[float, FocalSource], stop: StopReason, score: float, **more: object
) -> SynthesisResult:
    """No answer, the best of those that were found having this score."""
    refused = told(look.config, assumed, None, stop, agreement=score, **more)
    look.record("answer", program=None, score=score, reason=refused.reason)
    return refused


def _signs(look: Session, answer: Answer, good: list[Answer]) -> Signs:
    """What one of the good answers is judged by when people are told how likely it is right."""
    rivals = [other.worth for other in good if other is not answer]
    return Signs(
        structure=answer.structure,
        bits=answer.worth,
        agreement=answer.score,
        margin_bits=answer.worth - max(rivals, default=0.0),
        pose_sigma_deg=pose_sigma_deg(look.evidence, answer),
    )


def told(
    config: SearchConfig,
    assumed: tuple[float, FocalSource],
    program: Program | None,
    stop: StopReason,
    **more: object,
) -> SynthesisResult:
    """A result with the facts that every one has, and `more`."""
    facts = {**_focal_facts(None, assumed), "features": config.features_used, "seed": config.seed, **more}
    return SynthesisResult(program=program, stop=stop, **facts)  # pyright: ignore[reportArgumentType]


def _in_sight(look: Session, answer: Answer) -> bool:
    """Whether the photo shows at least half of the objects of a curve, which it would be the evidence of.

    The box of indices of a lattice that stands askew to the frame has half of its corners outside.
    """
    if answer.structure == "lattice":
        return True
    focal_mm = answer.focal_mm or look.evidence.focal_mm
    shown = share_in_sight(answer.program, look.evidence.image, focal_mm, lens_k1=answer.lens_k1)
    return shown >= 1 / 2


def _mirrored(look: Session, answer: Answer) -> Camera | None:
    """The other tilt that a ring leaves open; more than one circle tells the tilt, and no time is no look."""
    if answer.structure != "circular" or answer.lens_k1 is not None or look.stopped is not None:
        return None
    with look.until_interrupted():
        return mirrored_camera(look.evidence, answer)
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

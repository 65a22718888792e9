"""What a person asked for in place of the families: a sketch to fill, a program to refine, a recipe."""

import dataclasses
import math
from collections.abc import Callable

from p3i.errors import SketchError
from p3i.grammar.ast import Header, Program
from p3i.grammar.departures import departures
from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.sketch import Hole, Sketch
from p3i.interp.camera import Camera
from p3i.interp.degenerate import FAR
from p3i.interp.unroll import nest
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.families import FAMILIES
from p3i.search.forms.filling import draws, whole_program_sketch
from p3i.search.forms.settings import check_settings
from p3i.search.forms.sketches import sketches_by_length
from p3i.search.look.session import Session
from p3i.search.paper import find_by_paper
from p3i.search.result import NEEDED, StopReason
from p3i.search.sketched import WALKED, find_by_sketch, structure_of
from p3i.size import Size

# A sketch that draws fewer objects than this fixes neither camera nor pattern.
_FEWEST_OBJECTS = 4
# So many answers of a family are taken as starts for a sketch.
_MOST_KNOWN = 2
# Canvases whose sides differ in proportion by more than this are not the same picture.
_SAME_SHAPE = 0.02


def asked_for(config: SearchConfig) -> Callable[[Session], list[Answer]] | None:
    """How to find the programs that the options ask for; None where the families are to be asked."""
    if config.recipe == "paper":
        return find_by_paper
    if config.start is not None:
        start = whole_program_sketch(config.start, table1=config.strict)
        return lambda session: find_by_sketch(session, start)
    sketch = config.sketch
    if sketch is None:
        return None
    return lambda session: find_by_sketch(session, sketch, known=_by_family(session, sketch))


def _by_family(session: Session, sketch: Sketch) -> list[Answer]:
    """What the family that draws what the sketch draws finds, the best few, under the assumed focal."""
    structure, loops = structure_of(sketch.template), nest(sketch.template)
    if structure == "lattice" and (loops.for_i is None or loops.for_j is None):
        return []  # a row is no lattice, and no family's
    found = next((family.find for family in FAMILIES if family.structure == structure), None)
    answers = [] if found is None else found(session)[:_MOST_KNOWN]
    return [_refocused(answer, session.evidence.focal_mm) for answer in answers]


def _refocused(answer: Answer, focal_mm: float) -> Answer:
    """A ring's answer with the camera of this focal that sees the same vanishing line.

    Its plane stays, as the affine change of `focal.refocused` would make an ellipse of the circle: its points
    in the photo move a little, and the fit that starts here brings them back.
    """
    if answer.focal_mm is None:
        return answer
    camera = Camera.of(answer.program, focal_mm=answer.focal_mm).refocused(focal_mm)
    angles = {"camera.rx": camera.rx_deg, "camera.ry": camera.ry_deg}
    return dataclasses.replace(answer, program=with_leaves(answer.program, angles), focal_mm=None)


def why_not(config: SearchConfig) -> StopReason:
    """The reason to give where nothing reached the score that an answer needs."""
    by_hand = config.sketch is not None or config.start is not None
    return StopReason.NO_FIT if by_hand else StopReason.NO_PATTERN


def needed_for(config: SearchConfig) -> float:
    """The score that an answer must reach: none for the paper's recipe, which always answers."""
    return 0.0 if config.recipe == "paper" else NEEDED


def stated_focal(config: SearchConfig) -> float | None:
    """The focal that the header of a sketch or a start names, in mm."""
    header = _header(config)
    return header.focal_mm if header is not None else None


def check_asked(config: SearchConfig, size: Size) -> None:
    """Raise SketchError where a sketch or a start cannot be fitted to a photo of this size."""
    name = "the sketch" if config.sketch is not None else "the program to start from"
    header = _header(config)
    if header is not None and header.canvas is not None:
        wide, tall = header.canvas
        if abs(math.log(wide / tall * size.height / size.width)) > _SAME_SHAPE:
            raise SketchError(
                place=name,
                reason=f"its canvas is {wide} x {tall}, and the photo is {size.width} x {size.height}",
                mend="give the photo that it was written for, or take `canvas` out of its header",
            )
    if header is not None and header.lens_k1 is not None:
        raise SketchError(
            place=name,
            reason=f"its header has a lens (lens_k1 = {header.lens_k1:g}), and no lens is fitted here",
            mend="take `lens_k1` out of its header",
        )
    sketch = config.sketch
    if config.start is not None:
        sketch = whole_program_sketch(config.start, table1=config.strict)
    if sketch is None:
        return
    if far := _beyond_pictures(sketch):
        raise SketchError(
            place=name,
            reason=f"its number {far:g} goes beyond {FAR:,.0f}, ten thousand pictures or turns",
            mend="write smaller numbers",
        )
    if config.strict and (left := departures(_filled_with_something(sketch))):
        raise SketchError(
            place=name,
            reason=f"it leaves Table 1: {left[0].message}",
            mend="keep to Table 1, or leave out --strict",
        )
    check_settings(sketch, place=name)
    drawn = 0
    for drawn_here in draws(sketch):
        drawn = max(drawn, drawn_here)
        if drawn >= _FEWEST_OBJECTS:
            break
    else:
        raise SketchError(
            place=name,
            reason=f"it draws {drawn} objects at most, too few to fix camera and pattern",
            mend=f"let its loops draw {_FEWEST_OBJECTS} or more",
        )


def _beyond_pictures(sketch: Sketch) -> float | None:
    """A number of the sketch, or a limit of its holes, that no picture can show; fits overflow on such."""
    limits = [limit for hole in sketch.holes for limit in (hole.start, hole.lower, hole.upper, hole.over)]
    told = [*leaves(sketch.template).values(), *(limit for limit in limits if limit is not None)]
    return next((number for number in told if abs(number) > FAR), None)


def _filled_with_something(sketch: Sketch) -> Program:
    """The sketch with a number other than 0 in each hole that may hold one: 0 is written anywhere."""

    def some(hole: Hole) -> float:
        limits = [limit for limit in (hole.start, hole.lower, hole.upper) if limit is not None]
        return next((limit for limit in limits if limit != 0), 0.0 if hole.lower == hole.upper == 0 else 1.0)

    return with_leaves(sketch.template, {hole.path: hole.leaf(some(hole)) for hole in sketch.holes})


def walk(session: Session) -> list[Answer]:
    """Programs of the enumerated sketches without a family, the shortest first, while time lasts."""
    assert session.config.exhaustive_s is not None
    deadline = session.elapsed() + session.config.exhaustive_s
    covered = {family.structure for family in FAMILIES}
    asked = session.config.structure
    ahead = [one for one in sketches_by_length() if one.family not in covered]
    ahead = [one for one in ahead if asked in ("auto", one.structure)]
    answers: list[Answer] = []
    with session.until_interrupted():
        for place, one in enumerate(ahead):
            left = deadline - session.elapsed()
            if not session.go_on() or left <= 0:
                break
            # Each gets an even share of the time that is left: a sketch with many counts takes no other's.
            limit = dataclasses.replace(session.config, time_s=left / (len(ahead) - place))
            inner = Session(session.evidence, limit, trace=session.trace)
            session.tell(f"trying {one.name}", place / len(ahead))
            found = find_by_sketch(inner, one.sketch, effort=WALKED)[:2]
            answers += found
            if inner.stopped is StopReason.INTERRUPTED:
                session.stopped = inner.stopped
            best = max((answer.score for answer in found), default=0.0)
            session.record("sketch", name=one.name, bits=one.bits, score=best)
    return answers


def _header(config: SearchConfig) -> Header | None:
    template = config.start if config.start is not None else config.sketch and config.sketch.template
    return template.header if template is not None else None

"""What a person asks for: a sketch to fill, a program to refine, a recipe; and what a photo cannot answer."""

import math

from p3i.errors import SketchError
from p3i.grammar.ast import Header, Program
from p3i.grammar.departures import departures
from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.sketch import Hole, Sketch
from p3i.interp.degenerate import FAR
from p3i.search.config import FEWEST_OBJECTS, SearchConfig
from p3i.search.forms.filling import draws, whole_program_sketch
from p3i.search.forms.settings import check_settings
from p3i.search.result import NEEDED, StopReason
from p3i.size import Size

# Canvases whose sides differ in proportion by more than this are not the same picture.
_SAME_SHAPE = 0.02


def asks_for_itself(config: SearchConfig) -> bool:
    """Whether a person says what to look for: a sketch, a program to start from, the paper's recipe."""
    return config.sketch is not None or config.start is not None or config.recipe == "paper"


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
        if drawn >= FEWEST_OBJECTS:
            break
    else:
        raise SketchError(
            place=name,
            reason=f"it draws {drawn} objects at most, too few to fix camera and pattern",
            mend=f"let its loops draw {FEWEST_OBJECTS} or more",
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


def _header(config: SearchConfig) -> Header | None:
    template = config.start if config.start is not None else config.sketch and config.sketch.template
    return template.header if template is not None else None

"""Which place of the cell is the object: an answer's other readings as answers, and what is said of them.

The same lattice may have its objects where lines cross or on the fields between, on the dark squares of a
floor or on the light ones, and the same ring on one circle or another. The likeliest is drawn; the others are
told, and `--object` picks one of them.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from p3i.grammar.ast import Program
from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.extent.layout import filling_layout, layout_at, refitted
from p3i.search.forms.lattice import Lattice
from p3i.search.judge.bits import explained
from p3i.search.judge.evaluate import score_of_program
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import Reading

# An answer whose reading is less probable than this says so, and names the others of at least that.
_SURE = 0.8
_WORTH_NAMING = 0.05


def offers(answer: Answer, config: SearchConfig) -> bool:
    """Whether an answer draws the place that the options ask for, or offers no other."""
    return config.object is None or not answer.readings or _is(_drawn(answer), config.object, answer)


def reading_notes(answer: Answer, config: SearchConfig) -> tuple[str, ...]:
    """What to say of the place that an answer's objects are on."""
    if config.object is not None:
        kind = _KINDS.get(answer.structure, answer.structure)
        return () if answer.readings else (f"--object chooses among places, and this {kind} offers one only",)
    reading = _drawn(answer)
    if reading is None or reading.probability >= _SURE:
        return ()
    others = [one for one in answer.readings if one is not reading and one.probability >= _WORTH_NAMING]
    told = ", ".join(f"--object {one.name} draws on {one.phrase} ({one.probability:.2f})" for one in others)
    drawn = (
        f"what of the cell is its object is not sure: drawn on {reading.phrase} ({reading.probability:.2f})"
    )
    return (f"{drawn}; {told}" if told else drawn,)


def other_readings(session: Session, answer: Answer, *, most: int) -> list[Answer]:
    """The same pattern with its objects on other places of its cell, the likeliest first, at most so many.

    None for an answer through a lens, whose lattice is one of another picture.
    """
    return list(itertools.islice(_others(session, answer), most)) if answer.lens_k1 is None else []


def on_asked_circle(session: Session, answer: Answer) -> Answer:
    """A ring with its objects on the circle that the options ask for, where it has that one."""
    asked = session.config.object
    if asked is None or answer.structure != "circular":
        return answer
    reading = next((one for one in answer.readings if _is(one, asked, answer)), None)
    if reading is None or reading.drawn:
        return answer
    return _drawn_on(session, answer, reading) or answer


def _others(session: Session, answer: Answer) -> Iterator[Answer]:
    for reading in answer.readings:
        other = None if reading.drawn else _drawn_on(session, answer, reading)
        if other is not None:
            yield replace(other, notes=())


def _drawn_on(session: Session, answer: Answer, reading: Reading) -> Answer | None:
    """An answer with its objects on another place; None where there are none.

    Through a lens it keeps its bits and its score: they are told on another picture.
    """
    evidence = session.evidence.under(answer.focal_mm or session.evidence.focal_mm)
    program = (_lattice_on if answer.structure == "lattice" else _ring_on)(evidence, answer, reading)
    if program is None:
        return None
    other = replace(answer, program=program, readings=_seen_from(reading, answer.readings))
    if answer.lens_k1 is not None:
        return other
    return replace(explained(session.evidence, other), score=score_of_program(evidence, program))


def _lattice_on(evidence: Evidence, answer: Answer, reading: Reading) -> Program | None:
    """The program of a lattice with its objects on another place; None where there are none."""
    drawn = compile(answer.program)
    lattice = Lattice.of(drawn, drawn.theta).moved_to(np.array(reading.steps))
    layout = layout_at(evidence, lattice, drawn.index)
    if layout is None:
        return None
    layout = refitted(evidence, layout)
    if evidence.config.extent_used == "image":
        layout = filling_layout(evidence, layout)
    return layout.program()


def _ring_on(_: Evidence, answer: Answer, reading: Reading) -> Program:
    """The program of a ring with its objects on another circle."""
    numbers = leaves(answer.program)
    step = numbers["draw.x.angle.j"]
    moved: dict[str, float] = {}
    for side in ("draw.x", "draw.y"):
        moved[f"{side}.radius.1"] = numbers[f"{side}.radius.1"] * reading.radius
        moved[f"{side}.angle.1"] = numbers[f"{side}.angle.1"] + reading.steps[1] * step
    return with_leaves(answer.program, moved)


def _seen_from(drawn: Reading, readings: tuple[Reading, ...]) -> tuple[Reading, ...]:
    """The readings as they are told where one of them is drawn."""
    i, j = drawn.steps
    return tuple(
        replace(one, steps=(one.steps[0] - i, one.steps[1] - j), radius=one.radius / drawn.radius)
        for one in readings
    )


def _drawn(answer: Answer) -> Reading | None:
    return next((one for one in answer.readings if one.drawn), None)


def _is(reading: Reading | None, asked: str, answer: Answer) -> bool:
    """Whether a reading is the one that was asked for, by its name or its rank."""
    return reading is not None and asked in (reading.name, str(answer.readings.index(reading) + 1))


_KINDS = {"circular": "ring", "hybrid": "pattern of rings"}

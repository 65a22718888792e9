"""A drawn program as an answer: with its score, its worth, and the focal that it is told with."""

from dataclasses import replace

from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Drawn
from p3i.search.forms.sketches import Sketched, structure_of
from p3i.search.judge.bits import explained, explained_bits
from p3i.search.judge.evaluate import score_of_program
from p3i.search.judge.table1 import in_table1
from p3i.search.look.session import Session


def answers_of(look: Session, sketch: Sketched, drawn: Drawn) -> list[Answer]:
    """What a drawn program is as an answer, worth what it explains; in Table 1's words where asked for."""
    if sketch.gridded:
        return [_as_asked(look, drawn)]
    if look.config.recipe == "paper":
        score = score_of_program(look.evidence, drawn.program)
        return [Answer(drawn.program, sketch.structure, score, drawn.fit.covered)]
    answer = _free(look, sketch, drawn)
    written = in_table1(look, drawn.fit, answer) if look.config.strict else [answer]
    return [explained(look.evidence, one) for one in written]


def _free(look: Session, sketch: Sketched, drawn: Drawn) -> Answer:
    """The answer in whatever words say it best."""
    stated = sketch.structure == "lattice" or drawn.fit.focal_mm == look.evidence.focal_mm
    answer = Answer(
        drawn.program,
        sketch.structure,
        drawn.sure,
        0.0,
        drawn.notes,
        focal_mm=None if stated else round(drawn.fit.focal_mm, 2),
        focal_reason="" if stated else "estimated from the pattern, its ring taken as a circle",
        readings=drawn.readings,
        covered=drawn.fit.covered if sketch.structure == "circular" else 1.0,
    )
    return answer if sketch.structure != "hybrid" else _without_empty_middle(look, answer)


def _as_asked(look: Session, drawn: Drawn) -> Answer:
    """A filling of a person's sketch."""
    program = drawn.program
    if int(look.evidence.in_sight(compile(program)).sum()) < FEWEST_OBJECTS:
        return Answer(program, structure_of(program), 0.0, 0.0)
    # What a curve explains beside its draws is told in its score, but makes it no better a filling.
    score = score_of_program(look.evidence, program)
    own = score_of_program(look.evidence, program, elsewhere=False)
    return Answer(program, structure_of(program), score, own)


def _without_empty_middle(look: Session, answer: Answer) -> Answer:
    """The answer without its first rings, down to two, as long as it explains more of the photo so.

    A first ring close to the centre has room for tiny patches only: where nothing is there, all lose by it.
    """
    bits = explained_bits(look.evidence, answer)
    while True:
        numbers = leaves(answer.program)
        first, stop = numbers["for_i.start.1"], numbers["for_i.stop.1"]
        if stop - first <= 2:
            return answer
        later = replace(answer, program=with_leaves(answer.program, {"for_i.start.1": first + 1}))
        more = explained_bits(look.evidence, later)
        if more <= bits:
            return answer
        bits, answer = more, later

"""A lattice that was found, drawn once more where more of it, or it more clearly, is seen."""

from dataclasses import replace

from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.extent.layout import found_layout, refitted
from p3i.search.forms.lattice import Lattice
from p3i.search.judge.bits import explained
from p3i.search.look.evidence import Evidence


def drawn_anew(evidence: Evidence, answer: Answer) -> Answer:
    """A lattice's answer, worth what it explains of what `evidence` looks at, with the objects that it has
    there if that says more.
    """
    drawn = compile(answer.program)
    answer = explained(evidence, answer)
    found = None
    if answer.worth > 0:
        found = found_layout(evidence, Lattice.of(drawn, drawn.theta), drawn.index.double())
    if found is None:
        return answer
    layout = refitted(evidence, found[0])
    wider = replace(answer, program=layout.program(), readings=layout.readings)
    wider = explained(evidence, wider)
    return max(answer, wider, key=lambda one: one.worth)

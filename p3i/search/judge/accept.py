"""Which answers a photo is given: those that are sure object by object, or that noise would not show.

Two rules, and either suffices. The older one asks how well the objects agree, on the mean: a score as high
as `needed`, and more bits than the program costs. The other one adds up what they explain: by the number of
false alarms (Desolneux, Moisan, Morel 2000), the finds as good as this one that a picture of noise would show
among all that the search can try,

    false alarms = tests * 2^-bits

with the bits of judge/bits.py. Three hundred objects that agree a little thus count for more than six that
agree well. A program's cost stays in its bits, though `tests` counts many of the same choices: it pays for
what the refinement moves between the points of the grids, and for what pictures have and noise has not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from p3i.search.answer import Answer
from p3i.search.judge.evaluate import score_of_program
from p3i.search.look.evidence import Evidence
from p3i.search.result import StructureFound

MOST_FALSE_ALARMS = 0.05
"""What fewer false alarms a picture than these say is no noise."""

LOG2_TESTS: Mapping[StructureFound, float] = {"lattice": 72.0}
"""How many programs of a structure the search can tell apart, as a power of 2.

Lattices, on the largest map: 34.8 bits of starts (114 poses of views and 17 of each of 81 windows, each with
every pair of shifts in its ring of shifts), 9.2 of phases (24 x 24 places in the cell), 27.3 of ranges (both
ends of i and of j among the 160 cells of the least size that a map has room for): 71.3. Guards, and what the
refinement adds, are paid by the program's cost. Rings and hybrids have no figure: on pictures without a
pattern they explain up to 230 bits, so noise of independent samples says nothing of them.
"""


def false_alarms(structure: StructureFound, bits: float) -> float | None:
    """How many finds of these bits the search expects in a picture of noise; None where nobody can say.

    At most the number of tests; 0 where it is less than any number.
    """
    tests = LOG2_TESTS.get(structure)
    return None if tests is None else 2.0 ** (tests - max(bits, 0.0))


def beyond_noise(structure: StructureFound, bits: float) -> bool:
    """Whether a picture of noise would hardly ever show a find of these bits."""
    expected = false_alarms(structure, bits)
    return expected is not None and expected < MOST_FALSE_ALARMS


def with_printed_scores(evidence: Evidence, answers: Sequence[Answer], *, needed: float) -> list[Answer]:
    """The answers, whose `worth` is in bits, with the scores that `p3i score` says of their programs.

    While a program was fitted, its family knew more than it holds (other radii of a ring, numbers before they
    were rounded). What cannot be an answer keeps the score that it was refused with.
    """
    return [_with_printed_score(evidence, answer, needed) for answer in answers]


def _with_printed_score(evidence: Evidence, answer: Answer, needed: float) -> Answer:
    if answer.score < needed and not beyond_noise(answer.structure, answer.worth):
        return answer
    score = score_of_program(evidence, answer.program, focal_mm=answer.focal_mm, lens_k1=answer.lens_k1)
    return replace(answer, score=score)


def convincing(
    found: Sequence[Answer], told: Sequence[Answer], *, needed: float, fills: bool = False
) -> list[Answer]:
    """Those of `told` that are sure by either rule, but for their bits being above 0.

    `found` are the same answers with the scores that their families gave, which must suffice as well: what
    was not sure enough while more was known is none the surer. `fills`: a program that fills the picture is
    as sure as the part of it that was found, whatever lies beyond.
    """
    return [
        after
        for before, after in zip(found, told, strict=True)
        if beyond_noise(after.structure, after.worth)
        or (before.score >= needed and (fills or after.score >= needed))
    ]


def faint_note(answer: Answer, objects: int) -> str:
    """What to say of an answer whose score alone would not do."""
    return (
        f"each of the {objects} objects agrees a little only (agreement {answer.score:.2f}); "
        f"together they explain {answer.worth:.0f} bits, which noise would hardly ever show"
    )

"""What suffices for an answer: more bits than a photo without a pattern would ever show.

What a program saves of the photo's code, less its own length, is its `worth` in bits (judge/bits.py). The
number of false alarms (Desolneux, Moisan and Morel 2000) is how many finds as good as this one a picture
without a pattern would show among all that can be written,

    false alarms = 2^-worth

since there are at most 2^c programs of c bits. One rule serves all structures: three hundred objects that
agree a little count for more than six that agree well, and no score is needed.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.judge.evaluate import score_of_program
from p3i.search.look.contrast import FEW
from p3i.search.look.evidence import Evidence
from p3i.search.result import NEEDED_BITS


def chosen_among(ways: int, answer: Answer) -> Answer:
    """An answer, whose `worth` is in bits, that was found where one of so many `ways` to look was chosen.

    As many times more programs were within reach, so its bits are fewer by the logarithm of that, for every
    rule.
    """
    return replace(answer, worth=answer.worth - math.log2(ways))


def false_alarms(bits: float) -> float:
    """How many finds of these bits are expected in a picture without a pattern, at most 1; 0 where it is less
    than any number.
    """
    return 2.0 ** -max(bits, 0.0)


def beyond_noise(bits: float) -> bool:
    """Whether a picture without a pattern would hardly ever show a find of these bits."""
    return bits > NEEDED_BITS


def suffices(answer: Answer, needed: float | None) -> bool:
    """Whether it is an answer: beyond noise by its `worth` in bits, or, where a person asked, by the score
    `needed`.

    Where objects are as much alike half a step away, the bits do not tell of the program's steps.
    """
    return _enough(answer, needed) and (needed is not None or not _as_much_at_half_steps(answer))


def _enough(answer: Answer, needed: float | None) -> bool:
    return beyond_noise(answer.worth) if needed is None else answer.score >= needed


def _as_much_at_half_steps(answer: Answer) -> bool:
    """Whether objects agree no more than half a step away, by a score that a few cells would not have."""
    return answer.score <= 0 and (answer.structure != "lattice" or len(compile(answer.program).index) > FEW)


def with_printed_scores(
    evidence: Evidence, answers: Sequence[Answer], *, needed: float | None
) -> list[Answer]:
    """The answers with the scores that `p3i score` says of their programs, which may no longer suffice.

    While a program was fitted, more was known than it holds (other radii of a ring, numbers before they
    were rounded). What does not suffice keeps the score that it was refused with: what was not sure enough
    while more was known is none the surer.
    """

    def printed(answer: Answer) -> float:
        return score_of_program(evidence, answer.program, focal_mm=answer.focal_mm, lens_k1=answer.lens_k1)

    return [replace(one, score=printed(one)) if _enough(one, needed) else one for one in answers]

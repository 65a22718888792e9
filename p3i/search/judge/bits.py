"""Choice: which of the programs found, of whatever structure, explains the photo best for what it costs.

All are compared in bits (minimum description length, Rissanen 1978; the paper itself compares programs of one
structure only, by its equation 2), each program by itself:

    worth = what its objects save by coming again at its steps (look/recurrence.py) - what it costs to write

Each number is written in as many bits as it has values that can be told apart. So the cost also counts the
hypotheses: programs of c bits are 2^c at most, and of all programs together no more than 2^-b are expected
to be worth b bits by chance (Kraft's inequality, and Markov's). That is what accepts (judge/accept.py).

What a person asked for (a sketch, a start, the paper's recipe) needs no bits.
"""

from dataclasses import replace

from p3i.interp.compile import compile
from p3i.interp.pattern import without_doubles
from p3i.search.answer import Answer
from p3i.search.fit.judged import sweeps_cells
from p3i.search.forms.lattice import in_shortest_steps
from p3i.search.forms.length import CAMERA_BITS, cost_bits
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits
from p3i.search.look.upright import as_it_stands
from p3i.search.result import NEEDED_BITS


def explained_bits(evidence: Evidence, answer: Answer) -> float:
    """What a program explains of the photo less what it costs, in bits; negative where it costs more.

    Fewer than two objects in sight explain nothing.
    """
    return explained(evidence, answer).worth


def explained(evidence: Evidence, answer: Answer) -> Answer:
    """The answer with its `worth` in bits, its objects taken to stand as they explain most."""
    pattern = without_doubles(compile(answer.program))
    cells = sweeps_cells(pattern)
    pattern = in_shortest_steps(pattern) if cells else pattern
    focal_mm = answer.focal_mm or evidence.focal_mm
    index = pattern.index[evidence.in_sight(pattern, focal_mm=focal_mm)].double()
    cost = cost_bits(answer.program)
    if len(index) < 2:
        return replace(answer, worth=-cost)
    if pattern.turning is not None:
        pattern, bits = as_it_stands(evidence, pattern, index, focal_mm=focal_mm)
    else:
        bits = recurrence_bits(
            evidence, pattern, index, focal_mm=focal_mm, cells=cells, needed=cost + NEEDED_BITS
        )
    return replace(answer, worth=bits - cost, upright=pattern.upright)


def worth_of_numbers(saved: float, *, numbers: int = 1) -> float:
    """What so many numbers of a camera are worth that save these bits: less their cost and noise's share."""
    return saved - numbers * CAMERA_BITS - NEEDED_BITS

"""An answer in a sketch's numbers: exact where the sketch can say it, near where it cannot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.compile import compile
from p3i.search.forms.filling import Filling, fillings, unknowns_of
from p3i.search.forms.written import written_in

LATTICE = """
SetCameraPose(rx=??, ry=??)
for i in range(0, ??):
    for j in range(0, ??):
        Draw(x=??*i + ??*j + ??, y=??*i + ??*j + ??)
"""
SQUARE = LATTICE.replace("x=??*i + ??*j", "x=?s*i").replace("y=??*i + ??*j", "y=?s*j")
RING = """
SetCameraPose(rx=??, ry=??)
for j in range(0, ?n):
    Draw(x=?r*Cos(360/?n*j + ?a) + ?x, y=?r*Sin(360/?n*j + ?a) + ?y)
"""
lengths = st.floats(-40, 40).map(lambda value: round(value, 3))
steps = st.floats(5, 20).map(lambda value: round(value, 3))


def every(text: str) -> list[Filling]:
    sketch = parse_sketch(text)
    assert isinstance(sketch, Sketch)
    return list(fillings(sketch, unknowns_of(sketch), most_indices=64, most_settings=8))


def program(text: str) -> Program:
    found = parse(text)
    assert isinstance(found, Program)
    return found


def lattice(u: float, v: float, skew: float, x: float, y: float) -> Program:
    return program(
        "SetCameraPose(rx=12, ry=-7)\nfor i in range(0, 4):\n    for j in range(0, 5):\n"
        f"        Draw(x={u}*i + {skew}*j + {x}, y={skew}*i + {v}*j + {y})\n"
    )


@settings(max_examples=40, deadline=None)
@given(steps, steps, st.floats(-2, 2).map(lambda value: round(value, 3)), lengths, lengths)
def test_a_free_sketch_says_all_that_the_answer_says(
    u: float, v: float, skew: float, x: float, y: float
) -> None:
    answer = lattice(u, v, skew, x, y)
    found = written_in(every(LATTICE), answer)
    assert found is not None and found.promise == pytest.approx(0, abs=1e-9)
    said = dict(zip(found.filling.pattern.paths, found.filling.theta(found.z).tolist(), strict=True))
    pattern = compile(answer)
    assert said == pytest.approx(dict(zip(pattern.paths, pattern.theta.tolist(), strict=True)))


def test_numbers_that_a_sketch_ties_become_their_mean() -> None:
    found = written_in(every(SQUARE), lattice(9, 11, 0, 3, -2))
    assert found is not None
    said = dict(zip(found.filling.pattern.paths, found.filling.theta(found.z).tolist(), strict=True))
    assert said["draw.x.i"] == said["draw.y.j"] == pytest.approx(10)
    assert found.promise < 0, "the sketch cannot say it exactly"


def test_limits_that_a_person_gave_hold() -> None:
    found = written_in(every(SQUARE.replace("?s*i", "?s(6, 9)*i")), lattice(9.5, 9.5, 0, 3, -2))
    assert found is not None
    said = dict(zip(found.filling.pattern.paths, found.filling.theta(found.z).tolist(), strict=True))
    assert said["draw.x.i"] == said["draw.y.j"] == pytest.approx(9)


@pytest.mark.parametrize("count", [5, 12])
def test_of_the_counts_the_answers_is_taken(count: int) -> None:
    answer = program(
        f"SetCameraPose(rx=20, ry=5)\nfor j in range(0, {count}):\n"
        f"    Draw(x=14*Cos({360 / count}*j + 8) + 3, y=14*Sin({360 / count}*j + 8) - 4)\n"
    )
    found = written_in(every(RING), answer)
    assert found is not None and found.filling.values == (count,)
    drawn = found.filling.pattern.centers(found.filling.theta(found.z))
    np.testing.assert_allclose(drawn, compile(answer).centers(), atol=1e-6)


def test_another_form_of_pattern_or_one_far_off_is_no_start() -> None:
    assert written_in(every(RING), lattice(9, 9, 0, 0, 0)) is None
    fixed = LATTICE.replace("x=??*i + ??*j + ??", "x=8*i + 60").replace("y=??*i + ??*j + ??", "y=8*j + 60")
    assert written_in(every(fixed), lattice(9, 9, 0, -40, -40)) is None

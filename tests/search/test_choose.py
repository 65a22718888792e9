"""The choice between structures: what a program costs, what it explains, and each family's own order."""

import pytest
from drawn import DrawnRing

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.search.choose import by_explained, cost_bits, explained_bits
from p3i.search.session import Answer

RING = DrawnRing()
EVIDENCE = RING.evidence()


def program(body: str) -> Program:
    return parse(f"SetCameraPose(rx=-32, ry=14)\n{body}\n")


def ring(*, count: int = 12, radius: float = 24, cx: float = 4, y_radius: float | None = None) -> Program:
    angle = f"{360 / count:g}*j + 20"
    y_radius = radius if y_radius is None else y_radius
    return program(
        f"for j in range(0, {count}):\n"
        f"    Draw(x={radius:g}*Cos({angle}) + {cx:g}, y={y_radius:g}*Sin({angle}) + -3)"
    )


def answer(of: Program) -> Answer:
    return Answer(of, "circular", 0.5, 0.5)


def test_more_numbers_cost_more() -> None:
    row = program("for i in range(0, 5):\n    Draw(x=9*i, y=0)")
    shifted = program("for i in range(0, 5):\n    Draw(x=9*i + 1, y=0)")
    slanted = program("for i in range(0, 5):\n    Draw(x=9*i + 1, y=2*i)")
    assert cost_bits(row) < cost_bits(shifted) < cost_bits(slanted)
    guarded = program("for i in range(0, 5):\n    if i - 2 >= 0:\n        Draw(x=9*i, y=0)")
    assert cost_bits(row) < cost_bits(guarded)


def test_a_number_costs_the_same_whatever_its_size() -> None:
    assert cost_bits(ring(radius=24)) == cost_bits(ring(radius=31.25))


def test_the_radius_that_both_coordinates_share_counts_once() -> None:
    shared, apart = cost_bits(ring()), cost_bits(ring(y_radius=25))
    number = cost_bits(program("Draw(x=3, y=4)")) - cost_bits(program("Draw(x=3, y=0)"))
    assert apart - shared == pytest.approx(number)


def test_the_true_ring_explains_most() -> None:
    true = explained_bits(EVIDENCE, answer(ring()))
    assert true > 300
    for wrong in (ring(count=6), ring(count=11), ring(cx=40)):
        assert explained_bits(EVIDENCE, answer(wrong)) < 0.1 * true


def test_a_program_that_draws_nothing_in_sight_is_only_a_cost() -> None:
    far = ring(cx=900)
    assert explained_bits(EVIDENCE, answer(far)) == -cost_bits(far)


def test_a_familys_own_order_stays_and_the_best_family_comes_first() -> None:
    bad, good, worse = answer(ring(count=11)), answer(ring()), answer(ring(cx=40))
    ordered = by_explained(EVIDENCE, [[bad, good]])
    assert [one.program for one in ordered] == [bad.program, good.program]
    assert ordered[1].worth <= ordered[0].worth
    across = by_explained(EVIDENCE, [[worse], [good, bad]])
    assert across[0].program == good.program
    assert [one.worth for one in across] == sorted((one.worth for one in across), reverse=True)
    assert by_explained(EVIDENCE, [[], []]) == []

"""The choice between structures: what a program costs, and what it explains."""

from dataclasses import replace
from functools import cache

import pytest
from columns import two_kinds_of_columns
from drawn import DrawnRing

from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.evaluation.scene import Scene
from p3i.grammar.ast import Program
from p3i.grammar.leaves import leaves
from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.forms.length import cost_bits
from p3i.search.judge.bits import explained_bits
from p3i.search.look.evidence import Evidence

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


@cache
def hybrid(seed: int) -> tuple[Scene, Evidence]:
    scene = hybrid_scene(seed)
    return scene, Evidence(scene.image(), SearchConfig(), 35.0)


def ring_of(scene: Scene, i: int) -> Answer:
    """The ring i of rings around one centre, as a program of its own."""
    value = leaves(scene.program)
    radius = value["draw.x.radius.1"] + i * value["draw.x.radius.i"]
    angle = f"{value['draw.x.angle.j']}*j + {value['draw.x.angle.1']}"
    program = parse(
        f"SetCameraPose(rx={value['camera.rx']}, ry={value['camera.ry']})\n"
        f"for j in range(0, {int((scene.index[:, 0] == i).sum())}):\n"
        f"    Draw(x={radius}*Cos({angle}) + {value['draw.x.offset.1']}, "
        f"y={radius}*Sin({angle}) + {value['draw.y.offset.1']})\n"
    )
    assert isinstance(program, Program)
    return answer(program)


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


@pytest.mark.parametrize("seed", [1, 9])
def test_a_hybrid_wins_over_its_plainest_ring(seed: int) -> None:
    scene, evidence = hybrid(seed)
    whole = replace(answer(scene.program), structure="hybrid")
    assert explained_bits(evidence, whole) > explained_bits(evidence, ring_of(scene, 2)) > 0


def test_a_hybrid_whose_further_rings_are_not_there_loses_to_its_ring() -> None:
    angle = "30*j + 20"
    more = program(
        "for i in range(0, 3):\n    for j in range(0, 12):\n"
        f"        Draw(x=(8*i + 8)*Cos({angle}) + 4, y=(8*i + 8)*Sin({angle}) + -3)"
    )
    hybrid_of_all = replace(answer(more), structure="hybrid")
    assert explained_bits(EVIDENCE, hybrid_of_all) < explained_bits(EVIDENCE, answer(ring()))


def test_rings_come_by_what_they_explain() -> None:
    off, good = answer(ring(cx=4.5)), answer(ring())
    assert 0 < explained_bits(EVIDENCE, off) < explained_bits(EVIDENCE, good)


def test_what_two_kinds_of_columns_explain_does_not_depend_on_their_number() -> None:
    each: list[float] = []
    for rows, columns in ((16, 16), (18, 18), (17, 22)):
        image, lattice = two_kinds_of_columns(rows, columns)
        evidence = Evidence(image, SearchConfig(), 35.0)
        objects = int(evidence.in_sight(compile(lattice)).sum())
        each.append((explained_bits(evidence, answer(lattice)) + cost_bits(lattice)) / objects)
    assert each[1:] == pytest.approx([each[0]] * 2, rel=0.1)

"""Candidates mean different sets of objects, however they are written."""

from dataclasses import replace

import numpy as np
import pytest

from p3i.grammar.ast import Affine, CameraPose, Draw, For, Polar, Program
from p3i.search.answer import Answer
from p3i.search.judge.same import distinct_answers
from p3i.search.optics.focal import refocused
from p3i.vision.image import Image

PHOTO = Image(np.zeros((480, 640, 3), np.float32), np.ones((480, 640), bool))


def lattice(u: tuple[float, float], v: tuple[float, float], count: int = 7, shift: float = 0.0) -> Program:
    middle = (count - 1) / 2
    x, y = (Affine(u[k], v[k], shift - middle * (u[k] + v[k])) for k in (0, 1))
    rows = For("j", Affine(), Affine(constant=count), Draw(x, y))
    return Program(CameraPose(-35, 10), For("i", Affine(), Affine(constant=count), rows))


def ring(count: int) -> Program:
    parts = Affine(constant=25), Affine(j=360 / count), Affine()
    loop = For("j", Affine(), Affine(constant=count), Draw(Polar("Cos", *parts), Polar("Sin", *parts)))
    return Program(CameraPose(-35, 10), loop)


def kept(*programs: Program) -> list[int]:
    answers = [Answer(program, "lattice", 0.5, 1.0) for program in programs]
    found = distinct_answers(answers, image=PHOTO, focal_mm=35.0)
    return [answers.index(one) for one in found]


SQUARE = lattice((9, 1), (-1, 9))


@pytest.mark.parametrize(
    "other",
    [
        lattice((-1, 9), (9, 1)),  # rows for columns
        lattice((9, 1), (1, -9)),  # the other way round
        lattice((9, 1), (-1, 9), shift=0.8),  # hardly moved
    ],
)
def test_the_same_objects_in_other_words_are_one_candidate(other: Program) -> None:
    assert kept(SQUARE, other) == [0]


@pytest.mark.parametrize(
    "other",
    [
        lattice((18, 2), (-1, 9), count=5),  # every second column
        lattice((4.5, 0.5), (-1, 9), count=9),  # twice as dense
        lattice((9, 1), (-1, 9), shift=4.5),  # between the objects
        lattice((9, 1), (-1, 9), count=3),  # a part only
        ring(12),
    ],
)
def test_other_objects_are_another_candidate(other: Program) -> None:
    assert kept(SQUARE, other, SQUARE) == [0, 1]


def test_rings_of_another_count_differ_and_of_another_start_do_not() -> None:
    turned = ring(12)
    assert isinstance(turned.world, For) and isinstance(turned.world.body, Draw)
    x, y = turned.world.body.x, turned.world.body.y
    assert isinstance(x, Polar) and isinstance(y, Polar)
    on = Affine(j=30, constant=60)
    turned = replace(
        turned, world=replace(turned.world, body=Draw(replace(x, angle=on), replace(y, angle=on)))
    )
    assert kept(ring(12), ring(24), turned, ring(11)) == [0, 1, 3]


def test_a_program_told_with_another_focal_is_the_same() -> None:
    told = refocused(SQUARE, from_mm=35, to_mm=60)
    answers = [Answer(SQUARE, "lattice", 0.5, 1.0), Answer(told, "lattice", 0.5, 0.9, focal_mm=60.0)]
    assert distinct_answers(answers, image=PHOTO, focal_mm=35.0) == answers[:1]


def test_programs_that_draw_nothing_in_sight_all_mean_the_same() -> None:
    away = lattice((9, 1), (-1, 9), shift=4000)
    assert kept(away, SQUARE, away) == [0, 1]


def test_thousands_of_objects_are_one_candidate_in_any_order_of_the_loops() -> None:
    rows, columns = (
        lattice(*steps, count=60) for steps in (((0.9, 0.1), (-0.1, 0.9)), ((-0.1, 0.9), (0.9, 0.1)))
    )
    assert kept(rows, columns) == [0]
    assert kept(rows, lattice((1.8, 0.2), (-0.1, 0.9), count=60)) == [0, 1]

"""Unrolling in plain Python, held to a naive loop that shares no code with it."""

import itertools
import math

import pytest
import strategies
from hypothesis import HealthCheck, assume, given, settings

import p3i
from p3i.grammar.ast import Affine, Coordinate, Program
from p3i.grammar.parse_error import ParseError
from p3i.interp.unroll import distinct, edges, in_front, live_indices, nest, on_one_line, points


def value(part: Affine, i: int, j: int) -> float:
    return i * part.i + j * part.j + part.constant


def place(coordinate: Coordinate, i: int, j: int) -> float:
    if isinstance(coordinate, Affine):
        return value(coordinate, i, j)
    turn = {"Cos": math.cos, "Sin": math.sin}[coordinate.function]
    angle = value(coordinate.angle, i, j) * math.pi / 180
    return value(coordinate.radius, i, j) * turn(angle) + value(coordinate.offset, i, j)


def naive(program: Program) -> list[tuple[float, float, int, int]]:
    """Every whole number from -300 to 300 is tried against the meaning of bounds and guards."""
    parts = nest(program)
    candidates = range(-300, 301)
    found = []
    for i in candidates if parts.for_i else [parts.unbound_i]:
        if parts.for_i and not inside(parts.for_i.start, parts.for_i.stop, i, 0, 0):
            continue
        for j in candidates if parts.for_j else [0]:
            if parts.for_j and not inside(parts.for_j.start, parts.for_j.stop, j, i, 0):
                continue
            if all(value(statement.guard, i, j) >= -1e-9 for statement in parts.guards):
                found.append((place(parts.draw.x, i, j), place(parts.draw.y, i, j), i, j))
    return found


def inside(start: Affine, stop: Affine, k: int, i: int, j: int) -> bool:
    """start <= k < stop, either to within 1e-9."""
    return k >= value(start, i, j) - 1e-9 and k < value(stop, i, j) - 1e-9


@given(strategies.programs(number=strategies.tame_numbers, header=False, remarks=False))
@settings(deadline=None, max_examples=60, suppress_health_check=list(HealthCheck))
def test_points_are_those_of_a_naive_loop(program: Program) -> None:
    found = points(program)
    assume(all(abs(j) < 300 for _, _, _, j in found))
    expected = naive(program)
    assert [point[2:] for point in found] == [point[2:] for point in expected]
    for point, wanted in zip(found, expected, strict=True):
        assert point[:2] == pytest.approx(wanted[:2], rel=1e-12, abs=1e-9)
    assert live_indices(program) == [point[2:] for point in found]


def test_edges_join_neighbours_along_i_and_along_j_once() -> None:
    live = [(0, 0), (0, 1), (1, 0), (1, 1), (3, 1)]
    assert sorted(edges(live)) == [(0, 1), (0, 2), (1, 3), (2, 3)]


def test_a_ring_does_not_wrap() -> None:
    ring = p3i.loads("for j in range(0, 12):\n    Draw(x=20*Cos(30*j), y=20*Sin(30*j))\n")
    assert len(edges(live_indices(ring))) == 11


def test_an_unbound_i_is_1_under_a_ring_and_0_elsewhere() -> None:
    ring = p3i.loads("for j in range(0, 3*i):\n    Draw(x=2*i*Cos(30*j), y=Sin(30*j))\n")
    assert points(ring)[0] == (2.0, 0.0, 1, 0)
    row = p3i.loads("for j in range(5, 6):\n    Draw(x=j, y=2)\n")
    assert points(row) == [(5.0, 2.0, 0, 5)]


@pytest.mark.parametrize(
    "loops",
    [
        "for i in range(0, 1000000000):\n    Draw(x=i, y=1)",
        "for i in range(0, 2000):\n    for j in range(0, 2000):\n        Draw(x=i, y=j)",
        "for i in range(0, 900000000000):\n    for j in range(0, 0):\n        Draw(x=i, y=j)",
        "for i in range(0, 2000):\n    for j in range(0, 2000):\n        if i >= 1999: Draw(x=i, y=j)",
        "for i in range(1, 3):\n    for j in range(0, 1e300*i):\n        Draw(x=i, y=j)",
    ],
)
def test_loops_that_turn_too_often_are_refused_by_name(loops: str) -> None:
    with pytest.raises(ParseError, match=r"P122.*the limit is 1,000,000") as refused:
        points(p3i.loads(loops))
    assert "P3I_MAX_DRAWS" in (refused.value.diagnostics[0].help or "")


def test_the_limit_on_turns_can_be_raised_and_lowered(monkeypatch: pytest.MonkeyPatch) -> None:
    program = p3i.loads("for i in range(0, 20):\n    Draw(x=i, y=1)")
    monkeypatch.setenv("P3I_MAX_DRAWS", "19")
    with pytest.raises(ParseError, match="the limit is 19"):
        points(program)
    monkeypatch.setenv("P3I_MAX_DRAWS", "20")
    assert len(points(program)) == 20
    monkeypatch.setenv("P3I_MAX_DRAWS", "many")
    assert len(points(program)) == 20


@pytest.mark.parametrize(
    "text",
    [
        "for i in range(0, 3):\n    Draw(x=1.7e308*i, y=1)",
        "for i in range(0, 3):\n    Draw(x=1, y=Cos(1.7e308*i))",
        "for i in range(2, 9):\n    for j in range(0, -1.7e308*i):\n        Draw(x=i, y=j)",
    ],
)
def test_what_overflows_is_refused_by_name(text: str) -> None:
    with pytest.raises(ParseError, match="P123"):
        points(p3i.loads(text))


def test_distinct_keeps_the_first_of_those_that_coincide() -> None:
    found = [
        (0.0, 0.0, 0, 0),
        (1.0, 0.0, 0, 1),
        (1.0 + 9e-7, 0.0, 0, 2),
        (1.0 + 3e-6, 0.0, 0, 3),
        (-1e-7, 0.0, 0, 4),
    ]
    assert distinct(found) == [0, 1, 3]


@pytest.mark.parametrize(
    ("places", "line"),
    [
        ([], False),
        ([(3, 4)], True),
        ([(3, 4), (3, 4)], True),
        ([(0, 0), (1, 2), (-2, -4)], True),
        ([(0, 0), (1, 2), (2, 3.9)], False),
        ([(0, 0), (1e6, 1e6), (5e5, 5e5 + 0.1)], True),
    ],
)
def test_on_one_line(places: list[tuple[float, float]], line: bool) -> None:
    assert on_one_line([(x, y, 0, 0) for x, y in places]) is line


@pytest.mark.parametrize(("rx", "ry"), list(itertools.product([-80, -30, 0, 45, 100], [-70, 0, 20, 95])))
def test_in_front_follows_the_rotation_matrix(rx: float, ry: float) -> None:
    """Convention of docs/geometry.md: R = Ry(ry) Rx(rx), depth = (R (sx, sy, 0))_z + f."""
    program = p3i.loads(f"SetCameraPose(rx={rx}, ry={ry})\nDraw(x=0, y=0)")
    a, b = math.radians(rx), math.radians(ry)
    rotate_x = [[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]]
    rotate_y = [[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]]
    places = [(x, y, 0, 0) for x in (-200.0, -30.0, 0.0, 90.0) for y in (-150.0, 0.0, 60.0, 300.0)]
    scale, focal = 640 / 100, 28 / 36 * 640
    expected = []
    for x, y, *_ in places:
        turned = [sum(row[k] * (x, y, 0.0)[k] * scale for k in range(3)) for row in rotate_x]
        depth = sum(rotate_y[2][k] * turned[k] for k in range(3)) + focal
        expected.append(depth > 0)
    assert in_front(program, places, focal_mm=28) == expected


def test_unrolling_a_hundred_thousand_draws_is_quick() -> None:
    program = p3i.loads("for i in range(0, 400):\n    for j in range(0, 250):\n        Draw(x=i, y=j)")
    assert len(points(program)) == 100_000

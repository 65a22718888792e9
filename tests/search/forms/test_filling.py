"""Holes as numbers: what each may be, and how numbers become a program again."""

import math

import pytest
import torch

import p3i
from p3i.grammar.leaves import leaves
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.forms.filling import fillings, pinned, unknowns_of, whole_program_sketch, with_settings

RING = (
    "SetCameraPose(rx=??(-60, 60), ry=~5)\nfor j in range(0, ?n(4, 6)):\n"
    "    Draw(x=?r(10, 40)*Cos(360/?n*j + ??), y=?r*Sin(360/?n*j) + 7)\n"
)
ROW = "for j in range(??(-2, 0), ??(3, 5)):\n    Draw(x=??*j + ??, y=??*j + ??)\n"


def sketch(text: str) -> Sketch:
    found = parse_sketch(text)
    assert isinstance(found, Sketch), found
    return found


def filled(text: str):
    holes = sketch(text)
    return list(fillings(holes, unknowns_of(holes), most_indices=100, most_settings=100))


def test_each_value_of_a_count_in_an_angle_is_a_generator_of_its_own() -> None:
    every = filled(RING)
    assert [one.values for one in every] == [(4,), (5,), (6,)]
    assert [len(one.pattern.index) for one in every] == [4, 5, 6]
    steps = [one.base[one.pattern.paths.index("draw.x.angle.j")] for one in every]
    assert steps == [90, 72, 60]


def test_theta_ties_holes_of_one_name_and_keeps_plain_numbers() -> None:
    one = filled(RING)[0]
    names = [unknown.name for unknown in one.moving]
    assert names == ["camera.rx", "camera.ry", "draw.x.radius.1", "draw.x.angle.1"]
    z = torch.tensor([-20.0, 3.0, 33.0, 15.0], dtype=torch.float64)
    theta = dict(zip(one.pattern.paths, one.theta(z).tolist(), strict=True))
    assert theta["draw.x.radius.1"] == theta["draw.y.radius.1"] == 33
    assert theta["draw.y.offset.1"] == 7
    assert torch.equal(one.z_of(one.theta(z)), z)
    held = pinned(one, z, torch.tensor([False, False, True, False]))
    assert float(held.theta(z + 1)[one.pattern.paths.index("draw.x.radius.1")]) == 33


def test_limits_are_those_of_a_person_or_none() -> None:
    one = filled(RING)[0]
    assert one.lower.tolist() == [-60, -math.inf, 10, -math.inf]
    assert one.upper.tolist() == [60, math.inf, 40, math.inf]


def test_extents_are_masks_over_the_widest_loops() -> None:
    (one,) = filled(ROW)
    assert len(one.settings) == 9
    assert one.pattern.index[:, 1].tolist() == [-2, -1, 0, 1, 2, 3, 4]
    row = one.settings.index((-1, 4))
    assert one.masks[row].tolist() == [False, True, True, True, True, True, False]
    narrow = with_settings(one, ((0, 3),))
    assert narrow.pattern.index[:, 1].tolist() == [0, 1, 2]


def test_a_filling_is_written_with_few_digits_within_its_limits() -> None:
    one = filled(RING)[2]
    z = torch.tensor([-20.123456, 3.0, 40.00000001, 370.5], dtype=torch.float64)
    assert p3i.dumps(one.program(z, ())) == (
        "SetCameraPose(rx=-20.123, ry=3)\nfor j in range(0, 6):\n"
        "    Draw(x=40*Cos(60*j + 10.5), y=40*Sin(60*j) + 7)\n"
    )


@pytest.mark.parametrize(
    ("text", "free"),
    [
        (
            "SetCameraPose(rx=1, ry=2)\nfor i in range(0, 3):\n    for j in range(0, 3):\n"
            "        Draw(x=9*i, y=8*j + 1)\n",
            [
                "camera.rx",
                "camera.ry",
                "draw.x.i",
                "draw.x.j",
                "draw.x.1",
                "draw.y.i",
                "draw.y.j",
                "draw.y.1",
            ],
        ),
        (
            "for j in range(0, 9):\n    Draw(x=9*Cos(40*j), y=9*Sin(40*j) + 1)\n",
            [
                "camera.rx",
                "camera.ry",
                "draw.x.radius.1",
                "draw.x.angle.j",
                "draw.x.angle.1",
                "draw.x.offset.1",
                "draw.y.offset.1",
            ],
        ),
    ],
)
def test_a_whole_program_frees_its_camera_and_draw_and_a_circle_stays_one(text: str, free: list[str]) -> None:
    program = p3i.loads(text)
    holes = whole_program_sketch(program)
    unknowns = unknowns_of(holes)
    assert [unknown.name for unknown in unknowns] == free
    assert [unknown.start for unknown in unknowns] == [leaves(program)[name] for name in free]

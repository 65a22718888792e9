"""Sketches: a template and the paths of its holes."""

import pytest

import p3i
from p3i.grammar.leaves import leaves
from p3i.grammar.sketch import Hole, Sketch, format_sketch, parse_sketch

RING = (
    "SetCameraPose(rx=??(-60, 60), ry=~5)\nfor j in range(0, ?n(4, 24)):\n"
    "    Draw(x=?r(10, 40)*Cos(360/?n*j + ??), y=?r*Sin(360/?n*j))\n"
)


def sketch(text: str) -> Sketch:
    found = parse_sketch(text)
    assert isinstance(found, Sketch), found
    return found


def test_holes_have_paths_bounds_starts_and_kinds() -> None:
    assert sketch(RING).holes == (
        Hole("camera.rx", lower=-60, upper=60),
        Hole("camera.ry", start=5),
        Hole("for_j.stop.1", "n", 4, 24, whole=True),
        Hole("draw.x.radius.1", "r", 10, 40),
        Hole("draw.x.angle.j", "n", 4, 24, whole=True, over=360),
        Hole("draw.x.angle.1"),
        Hole("draw.y.radius.1", "r", 10, 40),
        Hole("draw.y.angle.j", "n", 4, 24, whole=True, over=360),
    )


def test_the_template_holds_first_values() -> None:
    values = leaves(sketch(RING).template)
    assert values["camera.rx"] == 0
    assert values["camera.ry"] == 5
    assert values["for_j.stop.1"] == 14
    assert values["draw.y.radius.1"] == 25
    assert values["draw.x.angle.j"] == 360 / 14


def test_a_program_is_a_sketch_without_holes() -> None:
    text = "SetCameraPose(rx=1, ry=2)\nDraw(x=1, y=2)\n"
    assert sketch(text) == Sketch(p3i.loads(text), ())


def test_filling_gives_a_program_and_equal_names_are_one_number() -> None:
    values = {
        "camera.rx": -30,
        "camera.ry": 1,
        "for_j.stop.1": 12,
        "draw.x.radius.1": 20,
        "draw.x.angle.1": 15,
    }
    assert p3i.dumps(sketch(RING).fill(values)) == (
        "SetCameraPose(rx=-30, ry=1)\nfor j in range(0, 12):\n    Draw(x=20*Cos(30*j + 15), y=20*Sin(30*j))\n"
    )
    with pytest.raises(KeyError):
        sketch(RING).fill({})


def test_format_is_stable_and_prints_bounds_where_a_name_comes_first() -> None:
    assert format_sketch(sketch(RING)) == RING
    moved = RING.replace("?n(4, 24)", "?n").replace("Sin(360/?n", "Sin(360/?n(4, 24)")
    assert format_sketch(sketch(moved)) == RING


def test_a_program_with_holes_is_no_program() -> None:
    with pytest.raises(p3i.ProgramError, match="P116"):
        p3i.loads(RING)
    assert p3i.check(RING) == ()


@pytest.mark.parametrize(
    "text",
    [
        "Draw(x=??*2, y=1)",
        "Draw(x=?? + 1, y=1)",
        "Draw(x=?? + ??, y=1)",
        "Draw(x=-?a, y=1)",
        "Draw(x=??/2, y=1)",
        "Draw(x=2/??, y=1)",
        "for i in range(0, 3): Draw(x=??*(i + 1), y=1)",
        "for j in range(0, 3): Draw(x=Cos(360/~0*j), y=1)",
        "for j in range(0, 3): Draw(x=Cos(360/?n(-1, 4)*j), y=1)",
        "for i in range(0, ~2.5): Draw(x=i, y=1)",
        "for i in range(0, ?n(1, 2.5)): Draw(x=i, y=1)",
        "Draw(x=?a(1, 2), y=?a(1, 3))",
        "Draw(x=??(2, 1), y=1)",
        "Draw(x=??(?a, 1), y=1)",
    ],
)
def test_a_hole_that_cannot_be_filled_is_p117(text: str) -> None:
    assert {found.code for found in p3i.check(text)} == {"P117"}


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("x=i*??, y=0", "x=??*i, y=0"),
        ("x=i*?? - ??(1, 2), y=0", "x=??*i + ??(-2, -1), y=0"),
        ("x=3*i + ~4, y=i*Cos(j*90/?n)", "x=3*i + ~4, y=i*Cos(90/?n*j)"),
        ("x=(?a*i + ?b)*Cos(j) - ?? + i, y=0", "x=(?a*i + ?b)*Cos(j) + i + ??, y=0"),
    ],
)
def test_holes_have_one_spelling(written: str, printed: str) -> None:
    frame = "for i in range(0, 3):\n    for j in range(0, 3):\n        Draw({})\n"
    assert p3i.format(frame.format(written)).endswith(frame.format(printed))

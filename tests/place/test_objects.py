"""The objects of a program: names as people say them, cells, order, and who is left out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i import loads
from p3i.errors import UsageError
from p3i.place.clip import area
from p3i.place.naming import letters
from p3i.place.objects import objects_of
from p3i.size import Size

SIZE = Size(640, 480)
BOARD = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 12):
    for j in range(0, 8):
        Draw(x=5*i - 27.5, y=5*j - 17.5)
"""


def names(text: str, **changes) -> list[str]:
    return [each.name for each in objects_of(loads(text), None, size=SIZE, **changes).objects]


def test_a_board_of_wells_is_named_as_people_name_it() -> None:
    expected = [f"{row}{column}" for row in "ABCDEFGH" for column in range(1, 13)]
    assert names(BOARD) == expected


@pytest.mark.parametrize(
    "draw",
    [
        "Draw(x=27.5 - 5*i, y=17.5 - 5*j)",
        "Draw(x=5*i - 27.5, y=17.5 - 5*j)",
    ],
)
def test_names_follow_the_photo_whichever_way_the_loops_run(draw: str) -> None:
    found = objects_of(loads(BOARD.replace("Draw(x=5*i - 27.5, y=5*j - 17.5)", draw)), None, size=SIZE)
    assert [each.name for each in found.objects[:2]] == ["A1", "A2"]
    assert found.objects[0].x_px < found.objects[1].x_px
    assert found.objects[0].y_px < found.objects[-1].y_px


@pytest.mark.parametrize("lean", [1, -1])
def test_the_bricks_of_a_wall_are_numbered_down_the_wall(lean: int) -> None:
    guards = "        if 2*i + j >= 0:\n            if 2*i + j <= 9:\n                "
    text = BOARD.replace("range(0, 12)", "range(-9, 12)").replace("        Draw", guards + "Draw")
    text = text.replace("x=5*i - 27.5", "x=5*i + 2.5*j - 15")
    if lean < 0:
        text = text.replace("2*i + j", "2*i - j").replace("2.5*j", "-2.5*j").replace("+ -", "- ")
    found = names(text)
    assert found == [f"{row}{column}" for row in "ABCDEFGH" for column in range(1, 6)]


def test_letters_go_on_after_z() -> None:
    assert [letters(row) for row in (0, 25, 26, 51, 52, 701, 702)] == [
        "A",
        "Z",
        "AA",
        "AZ",
        "BA",
        "ZZ",
        "AAA",
    ]


def test_every_middle_lies_in_its_cell() -> None:
    for each in objects_of(loads(BOARD), None, size=SIZE).objects:
        x, y = np.array(each.cell_px).T
        assert x.min() < each.x_px < x.max() and y.min() < each.y_px < y.max()


RING = "SetCameraPose(rx=-30, ry=8)\nfor j in range(0, 12):\n    Draw(x=20*Cos(30*j), y=20*Sin(30*j))\n"
RINGS = """SetCameraPose(rx=-20, ry=10)
for i in range(1, 4):
    for j in range(0, 6):
        Draw(x=8*i*Cos(60*j), y=8*i*Sin(60*j))
"""


def test_a_ring_counts_clockwise_from_the_top() -> None:
    found = objects_of(loads(RING), None, size=SIZE).objects
    assert [each.name for each in found] == [str(k) for k in range(1, 13)]
    assert min(found, key=lambda each: each.y_px).name in ("1", "2", "12")
    assert found[3].x_px > found[0].x_px > found[9].x_px  # a quarter on from the top is the right
    reversed_ = objects_of(loads(RING.replace("30*j", "-30*j + 7")), None, size=SIZE).objects
    assert reversed_[3].x_px > reversed_[0].x_px > reversed_[9].x_px


def test_an_object_just_left_of_the_top_is_the_first_of_its_ring() -> None:
    upright = RING.replace("rx=-30, ry=8", "rx=0, ry=0").replace("30*j", "30*j - 91")
    found = objects_of(loads(upright), None, size=SIZE).objects
    assert found[0].j == 0


def test_an_arc_over_the_top_begins_at_its_left_end() -> None:
    text = RING.replace("range(0, 12)", "range(0, 5)").replace("30*j", "30*j - 150")
    found = objects_of(loads(text), None, size=SIZE).objects
    assert [each.j for each in found] == [0, 1, 2, 3, 4]


def test_rings_have_a_letter_each_from_the_inside_out() -> None:
    found = objects_of(loads(RINGS), None, size=SIZE)
    assert [each.name for each in found.objects][:7] == ["A1", "A2", "A3", "A4", "A5", "A6", "B1"]
    assert [each.i for each in found.objects][::6] == [1, 2, 3]
    assert (found.arrangement, found.columns, found.rows) == ("rings", 6, 3)


def test_a_spiral_is_counted_along_its_arm() -> None:
    text = (
        "SetCameraPose(rx=0, ry=0)\nfor j in range(1, 20):\n    Draw(x=1.5*j*Cos(40*j), y=1.5*j*Sin(40*j))\n"
    )
    found = objects_of(loads(text), None, size=SIZE)
    assert found.arrangement == "curve"
    assert [each.j for each in found.objects] == list(range(1, 20))


def test_a_single_row_is_named_as_a_row_and_a_column_as_a_column() -> None:
    row = "SetCameraPose(rx=-30, ry=8)\nfor j in range(0, 3):\n    Draw(x=9*j, y=1*j)\n"
    assert names(row) == ["A1", "A2", "A3"]
    assert names(row.replace("x=9*j, y=1*j", "x=1*j, y=9*j")) == ["A1", "B1", "C1"]


def test_names_do_not_hang_on_what_is_listed() -> None:
    wide = BOARD.replace("range(0, 12)", "range(-20, 12)")
    inside = objects_of(loads(wide), None, size=SIZE)
    everything = objects_of(loads(wide), None, size=SIZE, outside=True)
    assert inside.outside > 0 and len(everything.objects) == len(inside.objects) + inside.outside
    by_place = {(each.i, each.j): each.name for each in everything.objects}
    assert all(by_place[each.i, each.j] == each.name for each in inside.objects)


@given(
    rx=st.floats(-60, 60),
    ry=st.floats(-60, 60),
    u=st.tuples(st.floats(3, 12), st.floats(-2, 2)),
    v=st.tuples(st.floats(-2, 2), st.floats(3, 12)),
    counts=st.tuples(st.integers(1, 6), st.integers(1, 6)),
    signs=st.tuples(st.sampled_from([-1, 1]), st.sampled_from([-1, 1])),
)
@settings(deadline=None, max_examples=60)
def test_any_grid_has_each_name_once_in_order_of_rows(rx, ry, u, v, counts, signs) -> None:
    (a, b), (c, d), (s, t) = u, v, signs
    text = (
        f"SetCameraPose(rx={rx!r}, ry={ry!r})\nfor i in range(0, {counts[0]}):\n"
        f"    for j in range(0, {counts[1]}):\n"
        f"        Draw(x={s * a!r}*i + {t * c!r}*j, y={s * b!r}*i + {t * d!r}*j)\n"
    )
    found = objects_of(loads(text), None, size=SIZE, outside=True, clip=True)
    places = [(each.row, each.column) for each in found.objects]
    assert places == sorted(set(places))
    assert len({each.name for each in found.objects}) == len(places)
    assert found.behind + len(places) == counts[0] * counts[1]
    for each in found.objects:
        corners = np.array(each.cell_px).reshape(-1, 2)
        assert (corners >= -0.501).all() and (corners <= (639.501, 479.501)).all()


def test_a_canvas_must_be_known() -> None:
    with pytest.raises(UsageError, match="how large is the photo"):
        objects_of(loads(BOARD), None)


def test_what_is_expected_is_compared_with_what_is_listed() -> None:
    found = objects_of(loads(BOARD), None, size=SIZE)
    assert found.differs_from(Size(12, 8)) == ""
    assert found.differs_from(Size(8, 12)) == "expected 8 columns x 12 rows, but found 12 x 8"
    assert found.counts == "96 objects"


def test_places_on_a_bent_photo_are_where_its_lens_shows_them() -> None:
    head = "# /// p3p\n# version = 1\n# canvas = [640, 480]\n# lens_k1 = -0.15\n# ///\n"
    straight, bent = (objects_of(loads(text), None, size=SIZE).objects for text in (BOARD, head + BOARD))
    moved = np.array([(b.x_px - a.x_px, b.y_px - a.y_px) for a, b in zip(straight, bent, strict=True)])
    away = np.array([(a.x_px - 319.5, a.y_px - 239.5) for a in straight])
    # A barrel draws the corners in.
    assert ((moved * away).sum(axis=1)[[0, 11, 84, 95]] < -1).all()
    assert len(bent[0].cell_px) > len(straight[0].cell_px)
    # A cell is as wide and high as the lens makes it: here up to a quarter less.
    sides = [
        np.ptp(b.cell_px, axis=0) / np.ptp(a.cell_px, axis=0) for a, b in zip(straight, bent, strict=True)
    ]
    assert np.min(sides) > 0.75 and np.max(sides) < 1.05


def test_the_middle_of_rings_has_a_disc_for_its_cell() -> None:
    text = RINGS.replace("range(1, 4)", "range(0, 3)")
    middle = objects_of(loads(text), None, size=SIZE).objects[0]
    away = np.linalg.norm(np.array(middle.cell), axis=1)
    assert np.ptp(away) < 1e-5 and 3.9 < away[0] < 4.1
    assert area(np.array(middle.cell)) == pytest.approx(np.pi * 16, rel=0.02)

"""The objects of a program: names as people say them, cells around their middles, order, and who is left out."""

import numpy as np
import pytest

from p3i import loads
from p3i.paint.naming import letters
from p3i.paint.objects import objects_of
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

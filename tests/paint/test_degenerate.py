"""Programs whose views cannot be drawn, or hardly: every verb draws them or says by name why not."""

from collections.abc import Callable

import numpy as np
import pytest

import p3i
from p3i.errors import P3IError, ProgramError
from p3i.export.crops import crops
from p3i.options.extend import Margins
from p3i.options.points import FORMATS
from p3i.vision.image import Image

GRID = """SetCameraPose(rx={rx}, ry={ry})
for i in range(0, 4):
    for j in range(0, 3):
        Draw(x={x}, y={y})
"""
BENT = "# /// p3p\n# version = 1\n# lens_k1 = -0.2\n# ///\n"


def grid(rx: float = -30.0, ry: float = 10.0, *, x: str = "14*i - 21", y: str = "14*j - 14") -> str:
    return GRID.format(rx=rx, ry=ry, x=x, y=y)


PROGRAMS = {
    "edge-on": grid(0, 90),
    "edge-on from below": grid(90, 0),
    "edge-on upside down": grid(-90, 0),
    "edge-on both": grid(90, 90),
    "edge-on behind a lens": BENT + grid(0, 90),
    "a hair off edge-on": grid(0, 89.9999999),
    "nearly edge-on": grid(0, 89.99),
    "nearly edge-on from above": grid(-89.7, 0),
    "behind the camera": grid(80, 0, y="14*j - 900"),
    "partly behind the camera": grid(-70, 0, y="60*j - 50"),
    "seen from the back": grid(150, 10),
    "coordinates of 1e300": grid(x="1e300*i", y="1e300*j"),
    "1e300 behind a lens": BENT + grid(x="1e300*i", y="14*j"),
    "one column at 1e300": grid(x="1e300*i - 3", y="14*j - 14"),
    "coordinates of 1e8": grid(x="1e8*i", y="1e8*j"),
    "coordinates of 1e-300": grid(x="1e-300*i", y="1e-300*j"),
    "a ring of 1e300": grid(x="1e300*Cos(90*i)", y="1e300*Sin(90*i)"),
    "a ring whose angle runs away": grid(x="20*Cos(1e300*i)", y="20*Sin(1e300*i)"),
    "all at one point": grid(x="5", y="-3"),
    "one object": "SetCameraPose(rx=-30, ry=10)\nDraw(x=3, y=4)\n",
    "one row": grid(y="0"),
    "one row behind a lens": BENT + grid(y="0"),
    "beyond the horizon": grid(-80, 0, y="14*j - 4000"),
    "far towards the horizon": grid(-60, 0, y="-3000*j"),
    "out of sight": grid(x="14*i + 500"),
    "none": grid().replace("range(0, 4)", "range(0, 0)"),
}
PHOTO = Image(
    np.random.default_rng(0).random((60, 80, 3)).astype(np.float32).round(2), np.ones((60, 80), bool)
)
HOLE = np.zeros((60, 80), bool)
HOLE[25:35, 35:45] = True
OTHER = p3i.loads(grid(x="14*i - 14"))
ALL = Margins(10, 10, 10, 10)

VERBS: dict[str, Callable[[p3i.Program], object]] = {
    "render": lambda program: p3i.render(program, size=PHOTO.size, horizon=True, cells=True).encode("png"),
    "render on its own canvas": lambda program: p3i.render(program).encode("svg"),
    "render straight": lambda program: p3i.render(program, plane=True, image=PHOTO).encode("png"),
    "render a sprite": lambda program: p3i.render(program, image=PHOTO, sprite=PHOTO).encode("pdf"),
    "show": lambda program: p3i.show(PHOTO, program).encode("png"),
    "points": lambda program: [p3i.points(program, image=PHOTO, outside=True).encode(form) for form in
                                  FORMATS if form != "dxf"],
    "points --crops": lambda program: list(crops(p3i.points(program, image=PHOTO), PHOTO)),
    "points --crops --plain": lambda program: list(
        crops(p3i.points(program, image=PHOTO), PHOTO, straight=False)
    ),
    "rectify": lambda program: (p3i.rectify(PHOTO, program).paint(), p3i.rectify(PHOTO, program).record()),
    "rectify --crop all": lambda program: p3i.rectify(PHOTO, program, crop="all").paint(),
    "rectify --crop inside": lambda program: p3i.rectify(PHOTO, program, crop="inside").paint(),
    "rectify --crop same --back": lambda program: p3i.rectify(PHOTO, program, crop="same").back(PHOTO),
    "tile": lambda program: p3i.tile(PHOTO, program).paint(),
    "inpaint": lambda program: p3i.inpaint(PHOTO, program, mask=HOLE).paint(),
    "inpaint --remove": lambda program: p3i.inpaint(PHOTO, program, remove=[(1, 1)]).paint(),
    "extend": lambda program: (p3i.extend(PHOTO, program, by=ALL).paint(),
                                  p3i.extend(PHOTO, program, by=ALL).record()),
    "extend by cells": lambda program: p3i.extend(PHOTO, program, by=Margins(1, 1, 1, 1, "cells")).paint(),
    "edit": lambda program: p3i.edit(PHOTO, program, OTHER).paint(),
    "edit to it": lambda program: p3i.edit(PHOTO, OTHER, program).paint(),
    "score": lambda program: p3i.score(PHOTO, program),
}  # fmt: skip


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_verb_draws_any_program_or_refuses_it_by_name(name: str) -> None:
    wrong: list[str] = []
    for verb, call in VERBS.items():
        try:
            call(p3i.loads(PROGRAMS[name]))
        except P3IError as error:
            assert len(str(error)) > 20, "it says why"
        except Exception as error:
            wrong.append(f"{verb}: {error!r}")
    assert wrong == []


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb not in ("score", "edit to it")])
def test_a_plane_seen_edge_on_is_refused_with_the_reason_and_the_mend(verb: str) -> None:
    with pytest.raises(ProgramError, match=r"edge-on \(rx=0, ry=90\).* tilt it by less"):
        VERBS[verb](p3i.loads(PROGRAMS["edge-on"]))


@pytest.mark.parametrize("verb", [verb for verb in VERBS if not verb.startswith(("render", "score"))])
def test_steps_beyond_all_pictures_are_refused_with_the_loop_that_takes_them(verb: str) -> None:
    with pytest.raises(ProgramError, match=r"the loop over i goes farther"):
        VERBS[verb](p3i.loads(PROGRAMS["one column at 1e300"]))


def test_objects_too_far_away_are_counted_alike_by_all_who_leave_them_out() -> None:
    """One of the three columns lies beyond a million units."""
    program = p3i.loads(grid(x="600000*i - 3").replace("range(0, 4)", "range(0, 3)"))
    assert "3 too far away" in p3i.points(program, image=PHOTO).counts
    notes = p3i.show(PHOTO, program).notes
    assert any(note.startswith("3 objects lie more than 1,000,000 units") for note in notes)

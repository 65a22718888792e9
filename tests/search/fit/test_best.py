"""What is found decides which sketches are taken up still."""

import pytest

from p3i.grammar.parser import parse
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best
from p3i.search.fit.fitted import Drawn
from p3i.search.forms.sketches import sketches
from p3i.search.result import NEEDED_BITS

PROGRAM = parse("SetCameraPose(rx=0, ry=0)\nfor i in range(0, 4):\n    Draw(x=9*i, y=0)\n")


@pytest.mark.parametrize(("bits", "room"), [(NEEDED_BITS - 1, True), (NEEDED_BITS + 1, False)])
def test_a_lattice_that_may_be_noise_leaves_room_for_rings_however_well_its_cells_agree(bits, room):
    lattice, ring = (
        next(one for one in sketches(SearchConfig()) if one.structure == structure)
        for structure in ("lattice", "circular")
    )
    best = Best()
    drawn = Drawn(PROGRAM, None, 0.9)  # pyright: ignore[reportArgumentType]
    best.add(lattice, drawn, [Answer(PROGRAM, "lattice", 0.9, bits)])
    assert best.leaves_room_for(ring) is room

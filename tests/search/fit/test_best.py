"""What is found decides which sketches are taken up still."""

import pytest
import torch

from p3i.grammar.parser import parse
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.forms.filling import Filling
from p3i.search.forms.sketches import sketches
from p3i.search.forms.spelled import ring_filling
from p3i.search.result import NEEDED_BITS, StructureFound

PROGRAM = parse("SetCameraPose(rx=0, ry=0)\nfor i in range(0, 4):\n    Draw(x=9*i, y=0)\n")


@pytest.mark.parametrize(
    ("bits", "score", "room"),
    [(NEEDED_BITS - 1, 0.9, True), (200, 0.9, True), (400, 0.9, False), (400, 0.2, True), (1100, 0.2, False)],
)
def test_a_lattice_leaves_room_for_rings_unless_it_explains_much_and_less_suffices_if_cells_agree_well(
    bits: float, score: float, room: bool
) -> None:
    lattice, ring = (
        next(one for one in sketches(SearchConfig()) if one.structure == structure)
        for structure in ("lattice", "circular")
    )
    best = Best()
    drawn = Drawn(PROGRAM, None, score)  # pyright: ignore[reportArgumentType]
    best.add(lattice, drawn, [Answer(PROGRAM, "lattice", score, bits)])
    assert best.leaves_room_for(ring) is room


RING = parse("SetCameraPose(rx=0, ry=0)\nfor j in range(0, 9):\n    Draw(x=9*Cos(40*j), y=9*Sin(40*j))\n")


def test_of_rings_the_larger_comes_first_and_structures_by_their_bits() -> None:
    ring, lattice = (
        next(one for one in sketches(SearchConfig()) if one.structure == structure)
        for structure in ("circular", "lattice")
    )
    ticks, hours = (
        Answer(RING, "circular", 0.5, bits, covered=share) for bits, share in [(120, 0.02), (100, 0.2)]
    )
    rows = Answer(PROGRAM, "lattice", 0.5, 110)
    best = Best()
    for sketch, answer in ((ring, ticks), (lattice, rows), (ring, hours)):
        best.add(sketch, Drawn(answer.program, None, 0.5), [answer])  # pyright: ignore[reportArgumentType]
    assert best.in_order() == [hours, ticks, rows]


@pytest.mark.parametrize(
    ("filling", "bits", "holds"),
    [
        (ring_filling(9), NEEDED_BITS + 1, True),
        (ring_filling(9), NEEDED_BITS - 1, False),
        (ring_filling(0, drawn=9), NEEDED_BITS + 1, False),
    ],
    ids=["closed", "noise", "arc"],
)
def test_only_a_closed_ring_beyond_noise_makes_a_second_focal_needless(
    filling: Filling, bits: float, holds: bool
) -> None:
    ring = next(one for one in sketches(SearchConfig()) if one.shape == "ring")
    nothing = torch.zeros(len(filling.moving)).double()
    fit = Fit(filling, nothing, 35.0, 1.0, torch.zeros(9, 2), torch.ones(9))
    best = Best()
    best.add(ring, Drawn(RING, fit, 0.5), [Answer(RING, "circular", 0.5, bits)])
    assert best.holds_closed_ring() is holds


@pytest.mark.parametrize("structure", ["lattice", "circular"])
@pytest.mark.parametrize("bits", [NEEDED_BITS + 1, NEEDED_BITS - 1])
def test_it_holds_a_lattice_where_one_is_beyond_noise(structure: StructureFound, bits: float) -> None:
    sketch = next(one for one in sketches(SearchConfig()) if one.structure == structure)
    best = Best()
    answer = Answer(PROGRAM, structure, 0.5, bits)
    best.add(sketch, Drawn(PROGRAM, None, 0.5), [answer])  # pyright: ignore[reportArgumentType]
    assert best.holds_lattice() is (structure == "lattice" and bits > NEEDED_BITS)

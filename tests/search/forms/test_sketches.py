"""The enumerator: which sketches there are, and which a search takes up."""

import itertools

from p3i.grammar.departures import departures
from p3i.grammar.sketch import Sketch, format_sketch, parse_sketch
from p3i.search.config import SearchConfig
from p3i.search.forms.length import NUMBER_BITS
from p3i.search.forms.sketches import sketches, sketches_by_length, structure_of
from p3i.search.propose.proposers import proposers


def test_sketches_come_the_shortest_first_and_each_once() -> None:
    every = list(sketches_by_length())
    assert [one.bits for one in every] == sorted(one.bits for one in every)
    texts = [format_sketch(one.sketch) for one in every]
    assert len(set(texts)) == len(texts)
    assert len({one.name for one in every}) == len(every)


def test_a_sketch_has_the_structure_that_its_text_spells() -> None:
    for one in sketches_by_length():
        assert one.structure == structure_of(one.sketch.template), one.name


def outside_table1(sketch: Sketch) -> bool:
    """Whether its numbers leave Table 1, by the language's own check; how a count is spelt may be mended."""
    return any("Rotate2Stmt" not in found.message for found in departures(sketch.template))


def test_table1_is_walked_before_what_it_cannot_say_with_as_many_numbers() -> None:
    compared = 0
    for one, other in itertools.permutations(sketches_by_length(), 2):
        numbers, others = (
            len({hole.name or hole.path for hole in each.sketch.holes}) for each in (one, other)
        )
        if numbers == others and outside_table1(other.sketch) and not outside_table1(one.sketch):
            compared += 1
            assert one.bits < other.bits, (one.name, other.name)
    assert compared > 3


def test_the_length_is_of_the_holes_that_the_text_has() -> None:
    for one in sketches_by_length():
        numbers = len({hole.name or hole.path for hole in one.sketch.holes})
        assert 0 <= one.bits - NUMBER_BITS * numbers < 35, one.name


def test_a_search_takes_up_each_shape_once_and_starts_with_lattices() -> None:
    shapes = [one.shape for one in sketches(SearchConfig())]
    assert shapes == ["lattice", "ring", "arc", "rings in rings", "fan", "rings in a row"]


def test_rows_and_spirals_are_walked_last_and_only_where_somebody_asks() -> None:
    shapes = [one.shape for one in sketches(SearchConfig(exhaustive_s=9))]
    assert shapes[-2:] == ["row", "spiral"] and len(shapes) == 8


def test_every_shape_has_a_proposer() -> None:
    written = frozenset().union(*(proposer.writes for proposer in proposers(SearchConfig())))
    assert written >= {one.shape for one in sketches_by_length()}


def test_hybrids_start_from_rings_that_are_no_answers() -> None:
    taken = sketches(SearchConfig(structure="hybrid"))
    assert [one.shape for one in taken if not one.asked] == ["ring", "arc"]
    assert {one.structure for one in taken if one.asked} == {"hybrid"}


def test_a_persons_sketch_starts_from_what_its_structure_finds() -> None:
    holes = parse_sketch("SetCameraPose(rx=??, ry=3)\nfor j in range(0, 8):\n    Draw(x=9*j, y=??*j)\n")
    assert isinstance(holes, Sketch)
    assert [one.name for one in sketches(SearchConfig(sketch=holes))] == ["the sketch"], "a row is no lattice"
    text = "SetCameraPose(rx=??, ry=3)\nfor j in range(0, 8):\n    Draw(x=9*Cos(??*j), y=9*Sin(??*j))\n"
    holes = parse_sketch(text)
    assert isinstance(holes, Sketch)
    taken = sketches(SearchConfig(sketch=holes))
    assert [(one.shape, one.asked) for one in taken] == [("ring", False), ("arc", False), ("any", True)]

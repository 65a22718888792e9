"""The sketches that the exhaustive search walks through."""

from p3i.grammar.departures import departures
from p3i.grammar.sketch import format_sketch
from p3i.search.enumerate import sketches_by_length
from p3i.search.sketched import structure_of


def test_sketches_come_the_shortest_first_and_each_once() -> None:
    every = list(sketches_by_length())
    assert [one.bits for one in every] == sorted(one.bits for one in every)
    texts = [format_sketch(one.sketch) for one in every]
    assert len(set(texts)) == len(texts)
    assert len({one.name for one in every}) == len(every)


def test_a_sketch_has_the_structure_that_its_text_spells() -> None:
    for one in sketches_by_length():
        assert one.structure == structure_of(one.sketch.template), one.name


def test_table1_is_walked_before_what_it_cannot_say_with_as_many_numbers() -> None:
    every = list(sketches_by_length())
    assert [one.name for one in every if one.in_table1] == [
        "ring",
        "arc",
        "rings in rings",
        "lattice",
        "lattice, 1 guard",
    ]
    outside = [one for one in every if not one.in_table1]
    for one in (one for one in every if one.in_table1):
        numbers = len({hole.name or hole.path for hole in one.sketch.holes})
        for other in outside:
            if len({hole.name or hole.path for hole in other.sketch.holes}) == numbers:
                assert one.bits < other.bits


def test_what_has_a_constant_that_table1_lacks_is_no_part_of_it() -> None:
    lattice = next(one for one in sketches_by_length() if one.name == "lattice, moved")
    assert not lattice.in_table1
    assert departures(lattice.sketch.template)


def test_rows_and_spirals_have_no_family() -> None:
    alone = {one.name for one in sketches_by_length() if one.family is None}
    assert alone == {"row", "spiral", "spiral with a phase"}

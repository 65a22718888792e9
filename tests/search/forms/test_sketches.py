"""The sketches that the exhaustive search walks through."""

import itertools

from p3i.grammar.departures import departures
from p3i.grammar.sketch import Sketch, format_sketch
from p3i.search.forms.sketches import sketches_by_length
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


def test_rows_and_spirals_have_no_family() -> None:
    alone = {one.name for one in sketches_by_length() if one.family is None}
    assert alone == {"row", "spiral", "spiral with a phase"}

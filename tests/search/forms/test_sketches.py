"""Which sketches there are, and what a search takes up."""

from p3i.grammar.sketch import Sketch, format_sketch, parse_sketch
from p3i.search.config import SearchConfig
from p3i.search.forms.length import NUMBER_BITS, PRODUCTION_BITS
from p3i.search.forms.sketches import every_sketch, sketches
from p3i.search.forms.spelled import lattice_filling, ring_filling, rings_filling
from p3i.search.propose.proposers import proposers


def test_each_shape_is_spelled_once() -> None:
    every = every_sketch()
    texts = [format_sketch(one.sketch) for one in every]
    assert len(set(texts)) == len(texts)
    assert len({one.name for one in every}) == len({one.shape for one in every}) == len(every)


def test_a_sketch_has_the_structure_of_its_shape() -> None:
    structures = {one.shape: one.structure for one in every_sketch()}
    assert structures == {
        "lattice": "lattice", "ring": "circular", "arc": "circular",
        "rings in rings": "hybrid", "fan": "hybrid", "rings in a row": "hybrid",
        "row": "lattice", "spiral": "circular",
    }  # fmt: skip


def test_what_proposers_write_of_a_shape_is_its_sketch_but_for_bounds_and_guards() -> None:
    said = {
        "lattice": lattice_filling(),
        "ring": ring_filling(7),
        "arc": ring_filling(0, drawn=7),
        "rings in rings": rings_filling(0, 3, 5, fan=False, grows=True, moves=False),
        "fan": rings_filling(1, 3, 5, fan=True, grows=True, moves=False),
        "rings in a row": rings_filling(0, 3, 5, fan=False, grows=False, moves=True),
    }
    for one in every_sketch():
        if one.shape in said:
            paths = {hole.path for hole in one.sketch.holes if hole.path.startswith(("camera.", "draw."))}
            closed = "ring" in one.shape
            counted = {f"draw.{axis}.angle.j" for axis in "xy"} if closed else set()
            assert {path for free in said[one.shape].moving for path in free.paths} == paths - counted


def test_the_length_is_of_the_holes_and_productions_that_the_text_has() -> None:
    for one in every_sketch():
        numbers = len({hole.name or hole.path for hole in one.sketch.holes})
        lines, text = len(format_sketch(one.sketch).splitlines()[1:]), format_sketch(one.sketch)
        curved = text.count("Cos") + text.count("Sin")
        assert one.bits == NUMBER_BITS * numbers + PRODUCTION_BITS * (lines + curved), one.name


def test_a_search_takes_up_each_shape_once_and_starts_with_lattices() -> None:
    shapes = [one.shape for one in sketches(SearchConfig())]
    assert shapes == ["lattice", "ring", "arc", "rings in rings", "fan", "rings in a row"]


def test_rows_and_spirals_are_walked_last_and_only_where_somebody_asks() -> None:
    shapes = [one.shape for one in sketches(SearchConfig(exhaustive_s=9))]
    assert shapes[-2:] == ["row", "spiral"] and len(shapes) == 8


def test_every_shape_has_a_proposer() -> None:
    written = frozenset().union(*(proposer.writes for proposer in proposers(SearchConfig())))
    assert written >= {one.shape for one in every_sketch()}


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

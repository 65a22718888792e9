"""The laws of the language (docs/language.md), over random programs and over strings of both grammars."""

import ast
import random

import pytest
import strategies
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.lark import from_lark
from lark import Lark

from p3i import language
from p3i.grammar import reader
from p3i.grammar.ast import Program
from p3i.grammar.departures import departures
from p3i.grammar.diagnostics import CODES
from p3i.grammar.leaves import comments, leaves, with_leaves
from p3i.grammar.parse_error import ParseError
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.grammar.sketch import Sketch, format_sketch, parse_sketch
from p3i.grammar.strict import read_strictly


def parsed(draw: str, *, loops: int) -> Program:
    """The program that draws `draw` for so many i and j."""
    program = parse(f"for i in range(0, {loops}):\n  for j in range(0, {loops}):\n    {draw}")
    assert isinstance(program, Program)
    return program


lenient = settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]
)


@given(strategies.programs())
@lenient
def test_parse_of_format_is_identity(program: Program) -> None:
    assert parse(format_program(program)) == program


@given(strategies.programs())
@lenient
def test_format_is_idempotent(program: Program) -> None:
    once = format_program(program)
    again = parse(once)
    assert isinstance(again, Program)
    assert format_program(again) == once


@given(strategies.programs())
@lenient
def test_comments_survive_in_order(program: Program) -> None:
    again = parse(format_program(program))
    assert isinstance(again, Program)
    assert comments(again) == comments(program)


@given(strategies.programs(header=False))
@lenient
def test_canonical_text_is_python_syntax(program: Program) -> None:
    ast.parse(format_program(program))


@given(strategies.sketches())
@lenient
def test_parse_of_format_is_identity_for_sketches(sketch: Sketch) -> None:
    text = format_sketch(sketch)
    again = parse_sketch(text)
    assert again == sketch
    assert format_sketch(again) == text


@given(strategies.table1_programs())
@lenient
def test_a_program_of_table_1_prints_as_table_1(program: Program) -> None:
    assert departures(program) == ()
    text = format_program(program, layout="table1")
    assert read_strictly(text) == program
    assert parse(text) == parse(text, strict=True) == program
    assert format_program(program, layout="table1") == text


@given(strategies.programs(remarks=False))
@lenient
def test_layout_table1_holds_what_has_no_departure_and_refuses_the_rest(program: Program) -> None:
    left = departures(program)
    if left:
        with pytest.raises(ParseError) as refused:
            format_program(program, layout="table1")
        assert refused.value.diagnostics == left
    else:
        assert parse(format_program(program, layout="table1"), strict=True) == program


@given(strategies.programs(), st.data())
@lenient
def test_with_leaves_writes_what_leaves_reads(program: Program, data: st.DataObject) -> None:
    values = leaves(program)
    assert with_leaves(program, values) == program
    path = data.draw(st.sampled_from(sorted(values)))
    assert leaves(with_leaves(program, {path: 12.5})) == {**values, path: 12.5}


def _table1() -> Lark:
    return Lark(reader.grammar_text("table1.lark"), start="program")


SPACED = {
    "COMMENT": "# note\n",
    "FOR": "For ",
    "IN": " in ",
    "I": " i ",
    "J": " j ",
    "ZERO": "0 ",
    "IF": "If ",
}
NUMERALS = {
    "REAL": st.one_of(
        st.floats(allow_nan=False, allow_infinity=False).map(repr),
        st.sampled_from(["1.", ".5", "+2.5e-3", "1E5"]),
    ),
    "INTEGER": st.one_of(st.integers().map(str), st.sampled_from(["+5", "-0", "007"])),
}


@given(
    from_lark(
        _table1(),
        start="program",
        explicit={**{name: st.just(text) for name, text in SPACED.items()}, **NUMERALS},
    )
)
@lenient
def test_strict_and_superset_agree_on_every_string_of_table_1(text: str) -> None:
    meant = read_strictly(text)
    assert isinstance(meant, Program), text
    assert parse(text, strict=True) == parse(text) == meant


LAYOUT = {"_NL": st.just("\n"), "_INDENT": st.just("    "), "_DEDENT": st.just("")}


@given(from_lark(reader.build_superset(), start="program", explicit=LAYOUT))
@settings(lenient, max_examples=25)  # such strings take long to draw
def test_parse_is_total_on_strings_of_the_superset(text: str) -> None:
    outcome = parse(text)
    if isinstance(outcome, Program):
        assert parse(format_program(outcome)) == outcome
    else:
        assert outcome


@given(st.binary() | st.text())
@example(b"\xff\xfe")
@example("for i in range(0, 4):\n\tDraw(x=\x00")
@example("\ufefffor i in range(0, 4):\r    Draw(x=i, y=2*i)")
@example('Draw("' + "\\" + '", x=1, y=2)')
@example("#" * 5)
@example("}" * 20 + "{" * 20)
@lenient
def test_parse_is_total_on_anything(source: str | bytes) -> None:
    outcome = parse(source)
    assert isinstance(outcome, Program) or (outcome and all(found.severity == "error" for found in outcome))


@given(st.integers(0, 2**32), strategies.programs(number=strategies.tame_numbers))
@lenient
def test_parse_is_total_on_damaged_programs(seed: int, program: Program) -> None:
    outcome = parse(damaged(format_program(program), random.Random(seed)))
    assert isinstance(outcome, Program) or outcome


@given(strategies.programs(number=strategies.reaching_numbers))
@example(parsed("Draw(x=8*i, y=-7e301*j)", loops=5))
@example(parsed("Draw(x=1e308*i, y=1e308*j)", loops=2))
@example(parsed("Draw(x=1e-300*i, y=1e-320*j)", loops=5))
@example(parsed("Draw(x=1e308*Cos(1e300*j)*i + 1e308, y=1e308*Sin(72*j)*i)", loops=3))
@lenient
def test_check_is_total_on_programs_that_reach_as_far_as_numbers_do(program: Program) -> None:
    assert all(found.code in CODES for found in language.check(program))


@given(strategies.header_texts())
@example("# /// p3p\n# focal = 1" + "0" * 309 + "\n# ///\n")
@example("# /// p3p\n# [fit]\n# score = -9" + "9" * 309 + "\n# ///\n")
@lenient
def test_check_and_format_are_total_on_headers_of_any_kind(header: str) -> None:
    source = header + "Draw(x=1, y=2)\n"
    found = language.check(source)
    if all(each.severity == "warning" for each in found):
        text = language.format(source)
        assert language.loads(text) == language.loads(source)
        assert language.format(text) == text


@given(st.integers(0, 2**32), strategies.programs(number=strategies.reaching_numbers))
@lenient
def test_check_is_total_on_damaged_programs(seed: int, program: Program) -> None:
    source = damaged(format_program(program), random.Random(seed))
    assert all(found.code in CODES for found in language.check(source))


@given(
    strategies.sketches(), st.sampled_from(["??", "?r(1, 1e308)", "360/?n", "~1e308", "?r(-1e308, 1e308)"])
)
@lenient
def test_check_is_total_on_sketches(sketch: Sketch, hole: str) -> None:
    text = format_sketch(sketch)
    for source in (text, text.replace("??", hole), text.replace("1", hole, 1)):
        assert all(found.code in CODES for found in language.check(source))


def damaged(text: str, chance: random.Random) -> str:
    """The text with a few characters taken out, doubled, swapped or replaced."""
    characters = list(text)
    for _ in range(chance.randint(1, 5)):
        place = chance.randrange(len(characters) + 1)
        match chance.randrange(4):
            case 0:
                del characters[place : place + chance.randint(1, 8)]
            case 1:
                characters[place:place] = characters[place : place + 12]
            case 2:
                characters.insert(place, chance.choice("()[]{}:;,=*+-/<>~?\"'# \n\tij019e.\0é"))
            case _:
                characters[place : place + 1] = chance.choice(
                    ["for", "if", "Draw", "\n", "    ", "Cos(", ")", "1e999"]
                )
    return "".join(characters)

"""Reading: limits, the places of errors, spans and comments."""

import pickle
import random
from pathlib import Path

import pytest

import p3i
from p3i.errors import SketchError
from p3i.grammar.ast import Affine, Draw, For, If, Polar, Program, Span
from p3i.grammar.diagnostics import Diagnostic
from p3i.grammar.parse_error import ParseError
from p3i.grammar.parser import parse

SEEDS = sorted((Path(__file__).parent.parent / "golden").rglob("*.p3p"))


def program(text: str) -> Program:
    found = parse(text)
    assert isinstance(found, Program), found
    return found


def problems(text: str | bytes) -> tuple[Diagnostic, ...]:
    found = parse(text)
    assert isinstance(found, tuple)
    return found


def test_spans_point_into_the_text() -> None:
    text = "for i in range(0, 2 + 1):\n  if i >= 1 :\n    Draw(x=3*i, y= 2*Cos( 3*i ) )\n"

    def quoted(span: Span | None) -> str:
        assert span is not None
        return text[span.start : span.end]

    loop = program(text).world
    assert isinstance(loop, For) and isinstance(loop.body, If) and isinstance(loop.body.body, Draw)
    draw = loop.body.body
    assert quoted(loop.span) == "for i in range(0, 2 + 1)"
    assert quoted(loop.stop.span) == "2 + 1"
    assert quoted(loop.body.span) == "if i >= 1"
    assert quoted(draw.span) == "Draw(x=3*i, y= 2*Cos( 3*i ) )"
    assert quoted(draw.x.span) == "3*i"
    assert isinstance(draw.y, Polar)
    assert quoted(draw.y.span) == "2*Cos( 3*i )"
    assert quoted(draw.y.angle.span) == "3*i"


def test_spans_and_comments_do_not_count_for_equality() -> None:
    assert program("for j in range(0, 2): Draw(x=j, y=2*j)") == program(
        "# a\nfor j in range(2): # b\n   Draw( y = j*2, x = j )"
    )


@pytest.mark.parametrize(
    ("text", "code", "place"),
    [
        ("for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n", "P104", (36, 37)),
        ("for j in range(0, 4):\n    Draw(x=j*j, y=4*j)\n", "P106", (33, 36)),
        ("for k in range(0, 4):\n    Draw(x=1, y=4)\n", "P107", (4, 5)),
        ("Draw(x=1, x=2, y=3)", "P108", (10, 13)),
        ("Draw(x=1e999, y=3)", "P109", (7, 12)),
        ("Draw(x=1, y=Cos(Sin(3)))", "P110", (16, 22)),
        ("for i in range(0, 0.5):\n    Draw(x=1, y=4)\n", "P113", (18, 21)),
        ("Draw(x=1, y=3 % 2)", "P114", (14, 15)),
        ("Draw(x=1, y=3$)", "P102", (13, 14)),
        ("Draw(x=1, y=2 3)", "P101", (12, 15)),
    ],
)
def test_an_error_points_at_its_place(text: str, code: str, place: tuple[int, int]) -> None:
    found = problems(text)[0]
    assert (found.code, found.span) == (code, Span(*place))


def test_a_text_that_is_too_long_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    long = "# " + "x" * 100_000
    assert [found.code for found in problems(long)] == ["P120"]
    assert "the limit of 100,000" in problems(long)[0].message
    assert [found.code for found in problems(b"\xc3" * 400_001)] == ["P120"]
    monkeypatch.setenv("P3I_MAX_SOURCE", "2000000")
    assert [found.code for found in problems(long)] == ["P111"]


@pytest.mark.parametrize(
    "text",
    [
        "Draw(x=" + "(" * 10_000 + "1" + ")" * 10_000 + ", y=2)",
        "Draw(x=" + "Cos(" * 4_000 + "1" + ")" * 4_000 + ", y=2)",
        "if 1 >= 0:\n" * 4_000 + "Draw(x=1, y=2)",
        "if " + "(" * 4_000 + "1 >= 0" + ")" * 4_000 + ":\n Draw(x=1, y=2)",
        "if 1 >= 0" + " and 1 >= 0" * 4_000 + ": Draw(x=1, y=2)",
        "for i in range(0, 2) { " * 4_000,
    ],
    ids=["parentheses", "calls", "guards", "conditions", "and", "braces"],
)
def test_deep_nesting_is_refused_by_name(text: str) -> None:
    found = problems(text)
    assert [finding.code for finding in found] == ["P121"]
    assert "100" in found[0].message and "P3I_MAX_NESTING" in (found[0].help or "")


def test_the_highest_nesting_that_can_be_allowed_is_read_and_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P3I_MAX_NESTING", "1000000")
    text = "if 1 >= 0" + " and 1 >= 0" * 198 + ":\n    Draw(x=" + "(" * 198 + "1" + ")" * 198 + ", y=2)"
    deep = program(text)
    assert program(p3i.format(deep)) == deep
    assert [finding.code for finding in problems(text.replace(":", " and 1 >= 0" * 2 + ":"))] == ["P121"]


def test_long_sums_and_signs_need_no_deep_stack() -> None:
    draw = program("Draw(x=" + "1 + " * 20_000 + "1, y=" + "-" * 19_001 + "2)").world
    assert isinstance(draw, Draw)
    assert (draw.x, draw.y) == (Affine(constant=20_001), Affine(constant=-2))


def test_loads_raises_with_all_findings_and_a_line() -> None:
    with pytest.raises(ParseError, match=r"row\.p3p:2:15: P104: `i` is not bound here") as raised:
        p3i.loads("for j in range(0, 4):\n    Draw(x=10*i, y=4*j)\n", path="row.p3p")
    assert raised.value.exit_code == 4
    assert " | " in raised.value.report()
    assert '"code": "P104"' in raised.value.report(as_json=True)


def test_load_and_dump_are_each_others_inverse(tmp_path: Path) -> None:
    path = tmp_path / "a.p3p"
    text = "# note\nSetCameraPose(rx=1, ry=2)\nfor j in range(0, 3):\n    Draw(x=j, y=2*j)\n"
    p3i.dump(p3i.loads(text), path)
    assert path.read_text() == text
    assert p3i.load(path) == p3i.loads(text)
    with pytest.raises(p3i.FileError, match="there is no file"):
        p3i.load(tmp_path / "none.p3p")


@pytest.mark.parametrize("kind", ["bytes", "programs"])
def test_check_takes_anything(kind: str) -> None:
    """A short run of benchmarks/fuzz_check.py."""
    chance = random.Random(7)
    for _ in range(150):
        if kind == "bytes":
            source = chance.randbytes(chance.randint(0, 300))
        else:
            text = bytearray(chance.choice(SEEDS).read_bytes())
            for _ in range(chance.randint(1, 4)):
                place = chance.randrange(len(text) + 1)
                text[place : place + chance.randint(0, 6)] = chance.randbytes(chance.randint(0, 3))
            source = bytes(text)
        for strict in (False, True):
            assert all(
                found.span is None or found.span.start <= len(source)
                for found in p3i.check(source, strict=strict)
            )


def test_errors_go_from_process_to_process_with_all_they_hold() -> None:
    with pytest.raises(ParseError) as raised:
        p3i.loads("Draw(x=10*i, y=4*j)\n", path="row.p3p")
    again = pickle.loads(pickle.dumps(raised.value))
    assert (str(again), again.report()) == (str(raised.value), raised.value.report())
    sketch = SketchError(place="a.p3p", reason="no", mend="yes")
    assert vars(pickle.loads(pickle.dumps(sketch))) == vars(sketch)

"""The tuned numbers of the search may only become fewer; the benchmark that tries them changes each."""

import ast
import importlib
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "sensitivity.py"

MOST_CONSTANTS = 300
"""How many constants of p3i/search hold numbers. Lower it with every one that goes; it never rises."""


@pytest.fixture(scope="module")
def sensitivity() -> dict[str, Any]:
    return runpy.run_path(str(SCRIPT))


def test_the_search_has_no_more_tuned_constants_than_it_had(sensitivity: dict[str, Any]) -> None:
    count = len(sensitivity["names_of"](sensitivity["all_constants"]()))
    assert count <= MOST_CONSTANTS, "a new number is a debt: derive it, or take another one away"
    assert count > MOST_CONSTANTS - 12, "fewer than they were: lower MOST_CONSTANTS to what is left"


TEXT = """
_A = 0.5
_B, C_PX = 3, -2.0
SHARES: tuple[float, ...] = (1.0, 0.9)
WEIGHTS = {"x": 5.0, "y": 0.0}
_CORNERS = [[0, 1], [1, 1]]
_NAME = "7"
_FLAG = True
_HALF_TURN = 2 * _A
_MOST = 0.95 * _A
_MADE = Effort(60, rounds=2)
lower = 4
def f() -> int:
    _INNER = 3
    return 5
"""


def test_numbers_are_found_alone_in_tuples_dictionaries_and_calls_and_geometry_is_left_out(
    sensitivity: dict[str, Any],
) -> None:
    found = [(one.name, one.place, one.value) for one in sensitivity["constants_of"](TEXT, "p3i.search.x")]
    assert found == [
        ("_A", 0, 0.5),
        ("_B", 0, 3),
        ("C_PX", 0, 2.0),
        ("SHARES", 0, 1.0),
        ("SHARES", 1, 0.9),
        ("WEIGHTS", 0, 5.0),
        ("_MOST", 0, 0.95),
        ("_MADE", 0, 60),
        ("_MADE", 1, 2),
    ]


@pytest.mark.parametrize(
    ("value", "factor", "changed"),
    [(0.5, 1.4, 0.7), (10, 0.7, 7), (2, 1.4, 3), (1, 1.4, 2), (1, 0.7, 1), (2, 0.7, 1)],
)
def test_whole_numbers_stay_whole_above_nothing_and_move(
    value: float, factor: float, changed: float, sensitivity: dict[str, Any]
) -> None:
    said = sensitivity["changed_value"](value, factor)
    assert said == pytest.approx(changed) and type(said) is type(value)


def test_every_number_of_the_search_can_be_put_in_its_place(sensitivity: dict[str, Any]) -> None:
    for constant in sensitivity["all_constants"]():
        path = SCRIPT.parent.parent.joinpath(*constant.module.split(".")).with_suffix(".py")
        tree = sensitivity["changed_text"](path.read_text(encoding="utf-8"), constant, 12345)
        assert sum(isinstance(node, ast.Constant) and node.value == 12345 for node in ast.walk(tree)) == 1


def test_a_changed_number_is_what_those_who_import_it_get_and_what_is_derived_follows() -> None:
    """In a fresh process, as the benchmark does it; the written module stays as it is."""
    code = (
        f"import runpy\ns = runpy.run_path({str(SCRIPT)!r})\n"
        "c = next(c for c in s['all_constants']() if c.title == 'p3i.search.result:NEEDED')\n"
        "s['put'](c, 0.75)\n"
        "from p3i.search.result import NEEDED\nprint(NEEDED)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "0.75"
    assert importlib.import_module("p3i.search.result").NEEDED != 0.75


def line(constant: str | None, factor: float, f1: float, answered: float = 1.0) -> dict[str, Any]:
    return {
        "constant": constant,
        "factor": factor,
        "f1_free": f1,
        "answered": answered,
        "pictures": {"a": f1},
    }


def test_the_report_puts_first_what_breaks_off_then_what_moves_most(sensitivity: dict[str, Any]) -> None:
    told = sensitivity["report"](
        [
            line(None, 1.0, 0.9),
            line("p3i.search.a:CALM", 0.7, 0.895),
            line("p3i.search.b:LOUD", 1.4, 0.7, 0.8),
            {"constant": "p3i.search.c:DEAD", "factor": 0.7, "error": "ValueError: no"},
            line("p3i.search.d:ELSE", 0.7, 0.1) | {"pictures": {"b": 0.1}},
        ]
    ).splitlines()
    assert [row.split()[1] for row in told[3:6]] == ["c:DEAD", "b:LOUD", "a:CALM"]
    assert "-0.200" in told[4] and "-0.20 |" in told[4]
    assert "3 numbers tried, 2 move" in told[6] and "1 lines" in told[7]

"""The scripts in benchmarks/ keep up with the code: what they import or replace by name is there."""

import ast
import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SCRIPTS = sorted((Path(__file__).parent.parent / "benchmarks").glob("*.py"))


def names_of_p3i(path: Path) -> Iterator[str]:
    """Every name of p3i that a script imports, and every string that spells one."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "p3i":
            yield from (f"{node.module}:{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"\Ap3i(?:\.\w+)+\Z", node.value)


def is_there(name: str) -> bool:
    module, _, inner = name.partition(":")
    try:
        if not inner:
            pkgutil.resolve_name(name)
        elif not hasattr(importlib.import_module(module), inner):
            importlib.import_module(f"{module}.{inner}")
    except (ImportError, AttributeError):
        return False
    return True


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_what_a_script_takes_from_p3i_is_there(path: Path) -> None:
    assert [name for name in names_of_p3i(path) if not is_there(name)] == []


def test_the_ablations_replace_functions_by_names_that_this_test_sees() -> None:
    names = set(names_of_p3i(next(path for path in SCRIPTS if path.stem == "ablations")))
    assert "p3i.search.fit.grow.refine" in names
    assert not is_there("p3i.search.fit.grow.no_such") and not is_there("p3i.search:register")

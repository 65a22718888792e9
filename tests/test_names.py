"""Whoever follows the documents finds each name where they say, and can make each value that a call needs."""

import builtins
import dataclasses
import importlib
import re
import typing
from pathlib import Path

import pytest

import p3i

ROOT = Path(__file__).parent.parent
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
RECORDS = [name for name in p3i.__all__ if name.endswith(("Options", "Config"))]


def used_in(path: Path) -> set[str]:
    """The dotted names of p3i that a document's code and text use."""
    text = path.read_text(encoding="utf-8")
    found = set(re.findall(r"\b(?<![/.\-])p3i(?:\.[A-Za-z_]\w*)+(?=\()", text))
    for module, names in re.findall(r"from (p3i[\w.]*) import \(?([\w, ]+)", text):
        found |= {f"{module}.{name.strip()}" for name in names.split(",") if name.strip()}
    return found


def test_the_documents_use_names_at_all() -> None:
    assert {"p3i.synth", "p3i.format", "p3i.load"} <= set().union(*map(used_in, DOCUMENTS))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_name_that_a_document_uses_can_be_imported(path: Path) -> None:
    for dotted in used_in(path):
        parts = dotted.split(".")
        value, rest = p3i, parts[1:]
        if len(parts) > 2:
            module = importlib.import_module(".".join(parts[:-1]))
            value, rest = module, parts[-1:]
        for part in rest:
            assert hasattr(value, part), f"{path.name} uses {dotted}"
            value = getattr(value, part)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_value_that_a_documented_call_makes_is_exported(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    calls = re.findall(r"`[^`\n]*\bp3i\.\w+\([^`\n]*`", text)
    for name in {name for call in calls for name in re.findall(r"\b(?<!\.)([A-Z]\w+)\(", call)}:
        assert name in p3i.__all__, f"{path.name} makes a {name}"


@pytest.mark.parametrize("record", RECORDS)
def test_every_type_that_an_option_may_have_is_exported(record: str) -> None:
    def inside(hint: object) -> set[type]:
        if isinstance(hint, type):
            return {hint}
        return {kind for part in typing.get_args(hint) for kind in inside(part)}

    exported = {getattr(p3i, name) for name in p3i.__all__}
    hints = typing.get_type_hints(getattr(p3i, record))
    for field in dataclasses.fields(getattr(p3i, record)):
        for kind in inside(hints[field.name]):
            assert not kind.__module__.startswith("p3i.") or kind in exported, f"{record}.{field.name}"


@pytest.mark.parametrize("name", p3i.__all__)
def test_every_error_and_function_that_a_docstring_names_is_exported(name: str) -> None:
    text = getattr(p3i, name).__doc__ or ""
    for error in re.findall(r"\b[A-Z]\w+Error\b", text):
        assert error in p3i.__all__ or hasattr(builtins, error), f"{name} raises {error}"
    for call in re.findall(r"\b(parse_\w+|load\w*|read_\w+)\(", text):
        assert call in p3i.__all__, f"{name} tells to call {call}"

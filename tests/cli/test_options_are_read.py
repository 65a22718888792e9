"""Every option that a command declares is read: by its name, or as a field of a record that something reads.

A command's body is followed through the functions that its values are handed to.
"""

import ast
import dataclasses
import importlib
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeGuard

import pytest

from p3i.cli.main import COMMANDS

PACKAGE = Path(__file__).parents[2] / "p3i"
# What a record of options is called where it is used.
RECEIVERS = {"options", "asked", "config"}


def tree_of(function: Callable[..., Any]) -> ast.FunctionDef:
    """The syntax tree of a function, without its decorators."""
    (found,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(found, ast.FunctionDef)
    found.decorator_list = []
    return found


def resolved(node: ast.expr, scope: dict[str, Any]) -> Any:
    """What a dotted name means in a module; None where it is none, or means nothing."""
    match node:
        case ast.Name(id=name):
            return scope.get(name)
        case ast.Attribute(value=value, attr=name):
            return getattr(resolved(value, scope), name, None)
    return None


def is_record(value: object) -> TypeGuard[type]:
    """Whether a value is a record of options."""
    return (
        isinstance(value, type)
        and dataclasses.is_dataclass(value)
        and value.__name__.endswith(("Options", "Config"))
    )


def records_in(tree: ast.AST, scope: dict[str, Any]) -> Iterator[type]:
    """The records of options that a function makes or lists the fields of."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute):
            found = resolved(node, scope)
            if is_record(found):
                yield found


def read_by(function: Callable[..., Any], given: str, seen: set[object]) -> set[str]:
    """The keys of its mapping `given` that a function reads, itself or through those that it hands it to."""
    function = inspect.unwrap(getattr(function, "__func__", function))
    if function in seen or not getattr(function, "__module__", "").startswith("p3i."):
        return set()
    seen.add(function)
    tree, scope = tree_of(function), function.__globals__
    found: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str(key))) if name == given:
                found.add(key)
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Name()) if name == given:
                # In a loop over names that are written out.
                found |= {str(each.value) for each in ast.walk(tree) if isinstance(each, ast.Constant)}
            case ast.Call(func=called, args=args):
                place = next((k for k, one in enumerate(args) if getattr(one, "id", None) == given), None)
                target = resolved(called, scope)
                if place is not None and callable(target) and not isinstance(target, type):
                    found |= read_by(target, list(inspect.signature(target).parameters)[place], seen)
    for record in records_in(tree, scope):
        found |= {field.name for field in dataclasses.fields(record)}
    return found


def consumed(function: Callable[..., Any]) -> set[str]:
    """The parameters of a command that its body reads."""
    tree = tree_of(function)
    used = {
        node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    }
    found = {each.arg for each in (*tree.args.args, *tree.args.kwonlyargs)} & used
    if tree.args.kwarg is not None and tree.args.kwarg.arg in used:
        found |= read_by(function, tree.args.kwarg.arg, set())
    return found


@pytest.mark.parametrize("name", COMMANDS)
def test_every_declared_option_is_read(name: str) -> None:
    command = importlib.import_module(COMMANDS[name].module).command
    declared = {each.name for each in command.params if each.expose_value}
    declared -= {"error_format"}  # read from the bare words by p3i.cli.main, for every command
    assert declared - consumed(command.callback) == set()


def records() -> list[type]:
    """Every record whose fields are options of some command."""
    found: dict[str, type] = {}
    for entry in COMMANDS.values():
        module = importlib.import_module(entry.module)
        for value in vars(module).values():
            if is_record(value):
                found[value.__name__] = value
    return list(found.values())


def test_there_are_records_of_options() -> None:
    assert {"SearchConfig", "RectifyOptions", "PointsOptions"} <= {record.__name__ for record in records()}


@pytest.mark.parametrize("record", records(), ids=lambda record: record.__name__)
def test_every_field_of_a_record_of_options_is_read_by_what_does_the_work(record: type) -> None:
    read: set[str] = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        others = set(re.findall(r"\b[A-Z]\w+(?:Options|Config)\b", text))
        if others and record.__name__ not in others:
            continue  # what is called options there is of another kind
        for node in ast.walk(ast.parse(text)):
            match node:
                # A record's own file says `self`: to check a value is no use of it.
                case ast.Attribute(value=ast.Name(id=holder) | ast.Attribute(attr=holder), attr=name):
                    if holder in RECEIVERS:
                        read.add(name)
    for name, value in vars(record).items():
        if isinstance(value, property) and name in read:  # what it reads of the record is read through it
            source = textwrap.dedent(inspect.getsource(value.fget))
            read |= {node.attr for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Attribute)}
    fields = {field.name for field in dataclasses.fields(record)}
    assert fields - read == set()

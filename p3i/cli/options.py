"""Options made from the fields of records, and those that several commands share: each is written once."""

import types
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

import click

from p3i.cli.grouped import Decorator
from p3i.errors import UsageError
from p3i.records import Field, fields_of

Record = TypeVar("Record")

error_format: Decorator = click.option(
    "--error-format",
    type=click.Choice(["human", "json"]),
    default="human",
    show_default=True,
    help="How to write errors: as text, or one JSON object a line.",
)
"""`--error-format human|json`."""

force: Decorator = click.option("--force", is_flag=True, help="Overwrite files that exist.")
"""`--force`."""

quiet: Decorator = click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors on stderr.")
"""`-q`."""

verbose: Decorator = click.option("-v", "--verbose", count=True, help="Say more on stderr.")
"""`-v`, counted."""


def output(sentence: str) -> Decorator:
    """`-o FILE|DIR|-`; arrives as `output: str | None`, where None is stdout.

    It stays text, since a slash at its end says "a folder" even where none exists yet.
    """
    return click.option(
        "-o",
        "--output",
        metavar="FILE|DIR|-",
        default=None,
        callback=lambda _context, _option, value: None if value == "-" else value,
        help=sentence,
    )


def of(record: type, *names: str, **changes: Mapping[str, Any]) -> Decorator:
    """The options for the fields `names` of a record of options, by default for all, in that order.

    A Literal becomes a choice, a bool `--x/--no-x`, a number beside a Literal takes a number or those words;
    `Spelt` in the field's Annotated says what cannot be told from the type. `changes` are, by field, what
    click.option takes instead: `of(Record, size={"metavar": "WxH"})`. `chosen` reads the values back.
    """
    fields = fields_of(record)

    def declare(function: Callable[..., Any]) -> Callable[..., Any]:
        for name in reversed(names or tuple(fields)):
            function = _option(fields[name], changes.get(name, {}))(function)
        return function

    return declare


def chosen(record: type[Record], given: Mapping[str, Any], **changes: Any) -> Record:
    """The record that the values of its options make; `changes` come before them.

    Fields that are no option of the command keep their default. Raises what the record raises.
    """
    return record(**{name: given[name] for name in fields_of(record) if name in given} | changes)


class Value(click.ParamType):
    """What a field's `read` makes of a text; its UsageError or ValueError is one of the option."""

    def __init__(self, read: Callable[[str], Any], name: str) -> None:
        self.read, self.name = read, name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        if value == "":
            self.fail("it is empty", param, ctx)
        try:
            return self.read(value)
        except (UsageError, ValueError) as error:
            self.fail(str(error), param, ctx)


class FilePath(click.ParamType):
    """The name of a file, as a Path; an empty one is none."""

    name = "FILE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        if value == "":  # Path("") would be the working folder
            self.fail("it is empty", param, ctx)
        return Path(value)


class NumberOrWord(click.ParamType):
    """A number, or one of the words, each of which means a value."""

    def __init__(self, unit: str, words: Mapping[str, str | None]) -> None:
        self.name = "|".join((unit, *words))
        self.words = words

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | str | None:
        if value == "":
            self.fail("it is empty", param, ctx)
        word = str(value).strip().lower()
        if word in self.words:
            return self.words[word]
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is neither a number nor {' nor '.join(self.words)}", param, ctx)


def _option(found: Field, changes: Mapping[str, Any]) -> Decorator:
    """The option of one field."""
    rest = dict(changes)
    kind = _without_none(found.kind)
    words = rest.pop("flags", None) or _flags(found, is_bool=kind is bool)
    if kind is not bool and "type" not in rest:
        rest["type"] = _type(kind, found)
    if found.spelt.metavar is not None:
        rest.setdefault("metavar", found.spelt.metavar)
    elif isinstance(rest.get("type"), Value | FilePath | NumberOrWord):
        rest.setdefault("metavar", rest["type"].name)
    if kind is bool and not any("/" in word for word in words):
        rest["is_flag"] = True
    default = {"default": found.default, "show_default": _shown(found.default)}
    return click.option(*words, found.name, help=found.sentence, **{**default, **rest})


def _flags(found: Field, *, is_bool: bool) -> tuple[str, ...]:
    if found.spelt.flags:
        return (found.spelt.flags,)
    word = found.name.replace("_", "-")
    return (f"--{word}/--no-{word}",) if is_bool else (f"--{word}",)


def _without_none(kind: Any) -> Any:
    """A type, or the union of several, with None taken out."""
    if get_origin(kind) not in (Union, types.UnionType):
        return kind
    return Union[tuple(one for one in get_args(kind) if one is not type(None))]  # noqa: UP007


def _type(kind: Any, found: Field) -> Any:
    """What click reads a field's value with; TypeError for a type that needs a `Spelt.read`."""
    spelt = found.spelt
    if spelt.read is not None:
        return Value(spelt.read, spelt.metavar or "TEXT")
    if kind is Path:
        return FilePath()
    if kind in (int, float, str) and spelt.none is None:
        return kind
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    parts = get_args(kind) or (kind,)
    words = [word for part in parts if get_origin(part) is Literal for word in get_args(part)]
    if float in parts and len(parts) == 1 + bool(words):
        none = {} if spelt.none is None else {spelt.none: None}
        unit = (spelt.metavar or "NUMBER").partition("|")[0]
        return NumberOrWord(unit, {word: word for word in words} | none)
    raise TypeError(f"the field {found.name} is a {kind}: say in a Spelt how its text is read")


def _shown(default: Any) -> bool:
    """Whether `--help` can show a default as it is: a word or a number."""
    return isinstance(default, str | int | float)

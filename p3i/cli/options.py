"""The options that several commands share, each written once."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

from p3i.records import told

Record = TypeVar("Record")
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

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


def field(record: type, name: str, *flags: str, **rest: Any) -> Decorator:
    """An option in the words of a record's field `name`, with the field's default, which `--help` shows.

    `flags` are the option's names where it is not called like the field, `rest` what click.option takes.
    """
    sentence, default = told(record)
    flags = flags or (f"--{name.replace('_', '-')}",)
    return click.option(*flags, default=default(name), show_default=True, help=sentence(name), **rest)


def focal(record: type) -> Decorator:
    """`--focal MM`, in the words of a record's field `focal_mm`."""
    sentence, _ = told(record)
    return click.option("--focal", "focal_mm", type=float, metavar="MM", help=sentence("focal_mm"))


def max_px(record: type) -> Decorator:
    """`--max-px N`, in the words of a record's field `max_px`."""
    return field(record, "max_px", type=int, metavar="N")


def chosen(record: type[Record], given: Mapping[str, Any], **changes: Any) -> Record:
    """The record that the values of its options make; `changes` come before them.

    Fields that are no option of the command keep their default. Raises what the record raises.
    """
    names = {each.name for each in dataclasses.fields(record)}  # pyright: ignore[reportArgumentType]
    return record(**{name: given[name] for name in given if name in names} | changes)

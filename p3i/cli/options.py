"""The options that several commands share, each written once."""

from collections.abc import Callable
from typing import Any

import click

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

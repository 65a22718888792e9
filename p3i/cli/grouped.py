"""A command of p3i: options in groups of `--help`, and no argument or option that is empty."""

from collections.abc import Callable, Iterator
from typing import Any

import click

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

_REST = "General"


class Command(click.Command):
    """A click command whose `--help` lists options by the groups that `group` put them in."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        rest = super().parse_args(ctx, args)
        for param in self.get_params(ctx):
            if any(word == "" for word in _words(ctx.params.get(param.name or ""))):
                # An unset variable of the shell, mostly; as a path it would mean the working folder.
                raise click.BadParameter("it is empty", ctx, param)
        return rest

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        groups: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if not isinstance(param, click.Option):
                continue
            if (record := param.get_help_record(ctx)) is not None:
                groups.setdefault(getattr(param, "group", _REST), []).append(record)
        if len(groups) < 2:
            super().format_options(ctx, formatter)
            return
        groups[_REST] = groups.pop(_REST, [])  # the last of all
        for title, records in groups.items():
            with formatter.section(title):
                formatter.write_dl(records)


def command(name: str) -> Callable[[Callable[..., Any]], Command]:
    """Make a function the command `name`; what `p3i --help` says of it stands in p3i.cli.main.COMMANDS."""
    return click.command(name, cls=Command)


def group(title: str, *decorators: Decorator) -> Decorator:
    """The options that `decorators` declare, in this order, under one heading of `--help`."""

    def declare(function: Callable[..., Any]) -> Callable[..., Any]:
        before = len(_declared(function))
        for decorator in reversed(decorators):
            function = decorator(function)
        for param in _declared(function)[before:]:
            setattr(param, "group", title)  # noqa: B010  # click's class does not know it
        return function

    return declare


def _declared(function: Callable[..., Any]) -> list[click.Parameter]:
    """What click's decorators have put on a function so far."""
    return getattr(function, "__click_params__", [])


def _words(value: object) -> Iterator[object]:
    """A value, or each of several."""
    if isinstance(value, tuple | list):
        yield from value
    else:
        yield value

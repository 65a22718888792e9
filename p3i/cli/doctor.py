"""`p3i doctor`: what is installed here."""

import json
from typing import Any

import click

from p3i.cli import grouped, options


@grouped.command("doctor")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@options.error_format
def command(as_json: bool, error_format: str) -> None:
    """Say which versions of p3i, Python and the libraries are here, and what else a bug report needs.

    Works where a library is missing or broken too, and says so.
    """
    from p3i.cli.installed import facts

    found = facts()
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    width = max(map(len, found)) + 2
    for name, value in found.items():
        click.echo(f"{name:{width}}{_shown(value)}")


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_shown(inner)}" for name, inner in value.items()) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "-" if value is None else str(value)

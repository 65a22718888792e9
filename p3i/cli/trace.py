"""`p3i trace`: the search as a picture."""

from pathlib import Path

import click

from p3i import api, files
from p3i.cli import grouped, options, report
from p3i.errors import UsageError

_KINDS = (".gif", ".png")


@grouped.command("trace")
@click.argument("trace", metavar="TRACE", type=click.Path())
@options.output("Where to draw: a .gif moves, a .png is a contact sheet.")
@click.option("--image", metavar="PHOTO", help="The photo, where it is not where the trace says; or which.")
@options.force
@options.quiet
@options.error_format
def command(
    trace: str, *, output: str | None, image: str | None, force: bool, quiet: bool, error_format: str
) -> None:
    """Draw what `p3i synth --trace TRACE` tried, step by step, over its photo.

    Orange is what was proposed, blue what was refined, green the answer. Of more than 60 steps so many are
    shown, evenly chosen; the answer stays longest.
    """
    if output is None or Path(output).suffix.lower() not in _KINDS:
        raise UsageError(f"-o FILE names a picture, {' or '.join(_KINDS)}")
    files.check_writable(Path(output), force=force)
    film = api.trace(trace, image=image)
    files.write_bytes(output, film.encode(Path(output).suffix.lower()), force=force)
    for note in () if quiet else film.notes:
        as_json = error_format == "json"
        report.line(note if as_json else f"{trace}: {note}", as_json=as_json, kind="note")

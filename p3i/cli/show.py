"""`p3i show`: a photo in, the overlay out that tells whether its program is right."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import click

from p3i import api, files
from p3i.cli import options, progress, report
from p3i.errors import UsageError
from p3i.paint.options import KINDS, kind_of
from p3i.paint.show_options import LABELS, ShowOptions
from p3i.records import told

sentence, default = told(ShowOptions)


@click.command("show", short_help="Draw the program over its photo: objects, cells, names, horizon, extent.")
@click.argument("photo", metavar="PHOTO", type=options.INPUT)
@click.argument("program", metavar="[PROG]", type=options.INPUT, required=False)
@options.output("Where to draw, the kind by the suffix; - is stdout.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(KINDS),
    default=None,
    help="The kind of picture. [default: by the name of -o, else png]",
)
@options.force
@options.field(ShowOptions, "labels", type=click.Choice(LABELS))
@click.option("--points/--no-points", default=default("points"), help=sentence("points"))
@click.option("--cells/--no-cells", default=default("cells"), help=sentence("cells"))
@click.option("--horizon/--no-horizon", default=default("horizon"), help=sentence("horizon"))
@click.option("--extent/--no-extent", default=default("extent"), help=sentence("extent"))
@click.option(
    "--presence/--no-presence",
    default=default("presence"),
    help=sentence("presence"),
)
@options.field(ShowOptions, "longer", type=int, metavar="N")
@options.focal(ShowOptions)
@options.quiet
@options.error_format
def command(photo: str, program: str | None, **given: Any) -> int:
    """Draw the program PROG over its PHOTO; without PROG it is found first, as by `p3i synth`.

    Each object has a dot and its name, or a cross where the photo does not show it; thin lines are the cells,
    the yellow line goes around all of them, the dashed red one is the horizon of the plane.
    """
    from p3i.vision.write import write_bytes

    chosen = ShowOptions(**{field.name: given[field.name] for field in dataclasses.fields(ShowOptions)})
    as_json = given["error_format"] == "json"
    output: str = given["output"] or "-"
    kind = given["kind"] or ("png" if output == "-" else kind_of(output))
    if output == "-" and kind != "svg" and sys.stdout.isatty():
        raise UsageError(f"a {kind.upper()} picture does not belong on a terminal: name a file with -o")
    if output != "-":
        files.check_writable(Path(output), force=given["force"])
    with progress.bar(Path(photo).name, wanted=not given["quiet"]) as update:
        picture = api.show(photo, program, chosen, progress=update)
    write_bytes(output, picture.encode(kind), force=given["force"])
    if not given["quiet"]:
        for note in picture.notes:
            report.line(f"{photo}: {note}", as_json=as_json, kind="note", image=photo)
    return 0

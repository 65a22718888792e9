"""`p3i extend`: photos in, larger pictures out, continued by their programs."""

from typing import Any

import click

from p3i import api
from p3i.cli import batch, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
from p3i.errors import UsageError
from p3i.paint.extend_options import ExtendOptions, parse_margins
from p3i.records import told

sentence, default = told(ExtendOptions)


@click.command("extend", short_help="Continue a photo beyond its frame by its pattern.")
@inputs.words("PHOTO... [PROG]")
@targets.written(PICTURES, "Where to write the picture.")
@click.option("--by", metavar="N%|N|L,T,R,B", help=sentence("by"))
@click.option(
    "--cells", metavar="N|L,T,R,B", help="How many more cells to each side, counted at the sides' middles."
)
@options.max_px(ExtendOptions)
@options.focal(ExtendOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Continue PHOTO beyond its frame: where the frame cuts the pattern of PROG, the pattern goes on.

    The photo's own pixels stay as they are, to the bit. Where the pattern ends inside the photo nothing of it
    is added; what is not pattern is continued smoothly. Without PROG the program is searched for.
    """
    if given["by"] is not None and given["cells"] is not None:
        raise UsageError("--by and --cells both say how far: give one of them")
    by = default("by")
    for option in ("by", "cells"):
        if given[option] is not None:
            by = parse_margins(given[option], option=f"--{option}")
    asked = options.chosen(ExtendOptions, given, by=by)

    def widen(job: Job) -> batch.Answer:
        found = api.extend(job.photo, job.program, asked, progress=job.update)
        left, top, right, bottom = found.margins
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind, keeps="the photo's"),
            facts=found.record,
            notes=(*found.photo.notes, *found.notes),
            more=[f"grown by {left}, {top}, {right}, {bottom} pixels, {found.added} objects added"],
        )

    return each_photo(given, widen)

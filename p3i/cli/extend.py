"""`p3i extend`: a photo in, a larger picture out, continued by its program."""

from typing import Any

import click

from p3i import api
from p3i.cli import options, progress
from p3i.cli.pictures import Outputs, json_option, kind_option
from p3i.errors import UsageError
from p3i.paint.extend_options import ExtendOptions, parse_margins
from p3i.records import told

sentence, default = told(ExtendOptions)


@click.command("extend", short_help="Continue a photo beyond its frame by its pattern.")
@options.photo_and_program
@options.output("Where to write the picture, the kind by the suffix; - is stdout.")
@kind_option
@json_option
@options.force
@click.option("--by", metavar="N%|N|L,T,R,B", help=sentence("by"))
@click.option(
    "--cells", metavar="N|L,T,R,B", help="How many more cells to each side, counted at the sides' middles."
)
@options.max_px(ExtendOptions)
@options.focal(ExtendOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Continue PHOTO beyond its frame: where the frame cuts the pattern of PROG, the pattern goes on.

    The photo's own pixels stay as they are, to the bit. Where the pattern ends inside the photo nothing of it
    is added; what is not pattern is continued smoothly. Without PROG the program is searched for.
    """
    photo, program = given["photo"], given["program"]
    if given["by"] is not None and given["cells"] is not None:
        raise UsageError("--by and --cells both say how far: give one of them")
    by = default("by")
    for option in ("by", "cells"):
        if given[option] is not None:
            by = parse_margins(given[option], option=f"--{option}")
    asked = ExtendOptions(by=by, max_px=given["max_px"], focal_mm=given["focal_mm"])
    outputs = Outputs.of(given, inputs=(photo, program))
    with progress.bar(photo, wanted=not given["quiet"]) as update:
        found = api.extend(photo, program, asked, progress=update)
    outputs.say((*found.photo.notes, *found.notes), name=photo)
    if outputs.kind in ("jpg", "webp"):
        kind = outputs.kind.upper()
        outputs.say([f"{kind} stores every pixel anew: write PNG or TIFF to keep the photo's"], name=photo)
    outputs.write(found.paint(), found.record(), name=photo)
    if given["verbose"]:
        left, top, right, bottom = found.margins
        grown = f"grown by {left}, {top}, {right}, {bottom} pixels, {found.added} objects added"
        outputs.say([grown], name=photo, kind="info")

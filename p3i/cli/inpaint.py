"""`p3i inpaint`: a photo with a hole in, the photo without it out."""

import dataclasses
from pathlib import Path
from typing import Any

import click

from p3i import api
from p3i.cli import options, progress
from p3i.cli.pictures import Outputs, kind_option
from p3i.paint.inpaint_options import METHODS, InpaintOptions
from p3i.records import told

sentence, default = told(InpaintOptions)


@click.command("inpaint", short_help="Fill a hole in a photo by its pattern.")
@options.photo_and_program
@click.option("--mask", metavar="FILE", type=options.INPUT, help="A picture whose white pixels are filled.")
@click.option(
    "--remove",
    metavar="I,J|NAME",
    multiple=True,
    help="Fill the cell of this object, by its indices or by its name in `p3i points`; may be given again.",
)
@options.output("Where to write the picture, the kind by the suffix; - is stdout.")
@kind_option
@options.force
@options.field(InpaintOptions, "method", type=click.Choice(METHODS))
@options.field(InpaintOptions, "steps", type=int, metavar="N")
@click.option("--time", "time_s", type=float, metavar="SECONDS", help=sentence("time_s"))
@click.option("--checkpoint", type=click.Path(), metavar="FILE", help=sentence("checkpoint"))
@options.field(InpaintOptions, "seed", type=int)
@options.field(InpaintOptions, "device")
@options.field(InpaintOptions, "threads", type=int)
@options.focal(InpaintOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Fill a hole in PHOTO with what its pattern shows elsewhere, by the program PROG.

    The hole is what --mask marks and the cells that --remove names; without either it is what is transparent.
    All else stays as it is, to the bit. Without PROG the program is searched for, outside of the hole.
    """
    names = {field.name for field in dataclasses.fields(InpaintOptions)}
    chosen = {name: value for name, value in given.items() if name in names}
    if chosen["checkpoint"] is not None:
        chosen["checkpoint"] = Path(chosen["checkpoint"])
    asked = InpaintOptions(**chosen)
    photo, program, mask = given["photo"], given["program"], given["mask"]
    outputs = Outputs.of({**given, "json_to": None}, inputs=(photo, program, mask))
    with progress.bar(photo, wanted=not given["quiet"]) as update:
        found = api.inpaint(photo, program, asked, mask=mask, remove=given["remove"], progress=update)
    outputs.say((*found.photo.notes, *found.notes), name=photo)
    if outputs.kind in ("jpg", "webp"):
        kind = outputs.kind.upper()
        outputs.say([f"{kind} stores every pixel anew: write PNG or TIFF to keep the others"], name=photo)
    outputs.write(found.paint(), {}, name=photo)
    if given["verbose"]:
        outputs.say([f"{int(found.hole.sum()):,} pixels filled"], name=photo, kind="info")

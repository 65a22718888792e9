"""`p3i edit`: a photo and two programs in, the photo with its objects laid anew out."""

from typing import Any

import click

from p3i import api
from p3i.cli import options, progress
from p3i.cli.pictures import Outputs, json_option, kind_option
from p3i.paint.edit_options import EditOptions, parse_scale
from p3i.records import told

sentence, _ = told(EditOptions)


@click.command("edit", short_help="Lay a photo's objects anew by a changed program.")
@click.argument("photo", metavar="PHOTO", type=options.INPUT)
@click.argument("old", metavar="OLD", type=options.INPUT)
@click.argument("new", metavar="NEW", type=options.INPUT)
@options.output("Where to write the picture, the kind by the suffix; - is stdout.")
@kind_option
@json_option
@options.force
@click.option("--scale", metavar="auto|S", default="auto", help=sentence("scale"))
@options.focal(EditOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Lay the objects that the program OLD finds on PHOTO anew, as the program NEW says.

    What stands where it stood keeps its pixels; the rest of OLD's objects give way to the ground, and copies
    are put where NEW draws. NEW is seen by OLD's camera unless it names its own.
    """
    photo, old, new = given["photo"], given["old"], given["new"]
    asked = EditOptions(scale=parse_scale(given["scale"]), focal_mm=given["focal_mm"])
    outputs = Outputs.of(given, inputs=(photo, old, new))
    with progress.bar(photo, wanted=not given["quiet"]) as update:
        found = api.edit(photo, old, new, asked, progress=update)
    outputs.say((*found.photo.notes, *found.notes), name=photo)
    if outputs.kind in ("jpg", "webp"):
        kind = outputs.kind.upper()
        outputs.say([f"{kind} stores every pixel anew: write PNG or TIFF to keep the others"], name=photo)
    outputs.write(found.paint(), found.record(), name=photo)

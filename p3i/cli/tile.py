"""`p3i tile`: a photo in, a seamless texture of its pattern's cell out."""

from typing import Any

from p3i import api
from p3i.cli import grouped, options, progress
from p3i.cli.pictures import Outputs, json_option, kind_option
from p3i.errors import UsageError
from p3i.paint.tile_options import TileOptions


@grouped.command("tile")
@options.photo_and_program
@grouped.group("Tile", options.of(TileOptions))
@grouped.group(
    "Output",
    options.output("Where to write the picture, the kind by the suffix; - is stdout."),
    kind_option,
    json_option,
    options.force,
)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Make the smallest rectangle that the pattern of PHOTO repeats in, by the program PROG, into a texture.

    Without PROG the program is searched for. Of rings it is the sector of one object, unrolled: the angle to
    the right, the radius down; that wraps from side to side. How well the texture wraps is said on stderr.
    """
    asked = options.chosen(TileOptions, given)
    photo, program = given["photo"], given["program"]
    if photo == "-" and program == "-":
        raise UsageError("only one input can be standard input")
    outputs = Outputs.of(given, inputs=(photo, program))
    with progress.bar(photo, wanted=not given["quiet"]) as update:
        found = api.tile(photo, program, asked, progress=update)
    outputs.say(found.notes, name=photo)
    outputs.say([found.seam.sentence()], name=photo, kind="info")
    outputs.write(found.paint() if outputs.picture is not None else None, found.record(), name=photo)
    if given["verbose"]:
        record = found.record()
        size = f"{found.size.width} x {found.size.height} px of {len(found.used)} cells"
        shear = "" if record["shear_deg"] is None else f", skewed by {record['shear_deg']:.1f} degrees"
        outputs.say([f"{size}{shear}"], name=photo, kind="info")

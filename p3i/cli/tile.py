"""`p3i tile`: a photo in, a seamless texture of its pattern's cell out."""

import dataclasses
import re
from typing import Any

import click

from p3i import api
from p3i.cli import options, progress
from p3i.cli.pictures import Outputs, json_option, kind_option
from p3i.cli.render import SizeType
from p3i.paint.tile_options import SOURCES, TileOptions
from p3i.records import told

sentence, default = told(TileOptions)


class RepeatType(click.ParamType):
    """`NxM`: times across and down."""

    name = "NxM"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"\s*(\d{1,9})\s*[xX×*,]\s*(\d{1,9})\s*", str(value))  # noqa: RUF001
        if found is None:
            self.fail(f"{value!r} is no number of times: write across and down, as in 3x2")
        return int(found[1]), int(found[2])


@click.command("tile", short_help="Make a seamless texture of a photo's pattern.")
@options.photo_and_program
@options.output("Where to write the picture, the kind by the suffix; - is stdout.")
@kind_option
@json_option
@options.force
@options.field(TileOptions, "source", "--from", "source", type=click.Choice(SOURCES))
@click.option("--size", type=SizeType(), metavar="WxH", help=sentence("size"))
@click.option("--repeat", type=RepeatType(), metavar="NxM", default=(1, 1), help=sentence("repeat"))
@options.field(TileOptions, "light", "--even-light/--keep-light", "light")
@options.focal(TileOptions)
@options.max_px(TileOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Make the smallest rectangle that the pattern of PHOTO repeats in, by the program PROG, into a texture.

    Without PROG the program is searched for. Of rings it is the sector of one object, unrolled: the angle to
    the right, the radius down; that wraps from side to side. How well the texture wraps is said on stderr.
    """
    names = {field.name for field in dataclasses.fields(TileOptions)}
    asked = TileOptions(**{name: value for name, value in given.items() if name in names})
    photo, program = given["photo"], given["program"]
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

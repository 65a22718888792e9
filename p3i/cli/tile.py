"""`p3i tile`: a photos in, seamless textures of their patterns' cells out."""

import re
from typing import Any

import click

from p3i import api
from p3i.cli import batch, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
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
@inputs.words("PHOTO... [PROG]")
@targets.written(PICTURES, "Where to write the picture.")
@options.field(TileOptions, "source", "--from", "source", type=click.Choice(SOURCES))
@click.option("--size", type=SizeType(), metavar="WxH", help=sentence("size"))
@click.option("--repeat", type=RepeatType(), metavar="NxM", default=(1, 1), help=sentence("repeat"))
@options.field(TileOptions, "light", "--even-light/--keep-light", "light")
@options.focal(TileOptions)
@options.max_px(TileOptions)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Make the smallest rectangle that the pattern of PHOTO repeats in, by the program PROG, into a texture.

    Without PROG the program is searched for. Of rings it is the sector of one object, unrolled: the angle to
    the right, the radius down; that wraps from side to side. How well the texture wraps is said on stderr.
    """
    asked = options.chosen(TileOptions, given)

    def cut(job: Job) -> batch.Answer:
        found = api.tile(job.photo, job.program, asked, progress=job.update)
        shear = found.record()["shear_deg"]
        skewed = "" if shear is None else f", skewed by {shear:.1f} degrees"
        size = f"{found.size.width} x {found.size.height} px of {len(found.used)} cells"
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind),
            facts=found.record,
            notes=found.notes,
            info=[found.seam.sentence()],
            more=[f"{size}{skewed}"],
        )

    return each_photo(given, cut)

"""`p3i show`: photos in, the overlays out that tell whether their programs are right."""

from typing import Any

import click

from p3i import api
from p3i.cli import batch, inputs, options, targets
from p3i.cli.pictures import DRAWINGS, Job, drawn, each_photo
from p3i.paint.show_options import LABELS, ShowOptions
from p3i.records import told

sentence, default = told(ShowOptions)


@click.command("show", short_help="Draw the program over its photo: objects, cells, names, horizon, extent.")
@inputs.words("PHOTO... [PROG]")
@targets.written(DRAWINGS, "Where to draw.")
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
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Draw the program PROG over its PHOTO; without PROG it is found first, as by `p3i synth`.

    Each object has a dot and its name, or a cross where the photo does not show it; thin lines are the cells,
    the yellow line goes around all of them, the dashed red one is the horizon of the plane.
    """
    asked = options.chosen(ShowOptions, given)

    def draw(job: Job) -> batch.Answer:
        return drawn(api.show(job.photo, job.program, asked, progress=job.update), job.kind)

    return each_photo(given, draw, kinds=DRAWINGS)

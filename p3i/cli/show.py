"""`p3i show`: photos in, the overlays out that tell whether their programs are right."""

from typing import Any

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import DRAWINGS, Job, drawn, each_photo
from p3i.options.show import ShowOptions


@grouped.command("show")
@inputs.words("PHOTO... [PROG]")
@grouped.group("What to draw", options.of(ShowOptions))
@targets.written(DRAWINGS, "Where to draw.")
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

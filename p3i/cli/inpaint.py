"""`p3i inpaint`: photos with a hole in, the photos without it out."""

from typing import Any

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
from p3i.options.inpaint import InpaintOptions


@grouped.command("inpaint")
@inputs.words("PHOTO... [PROG]")
@grouped.group(
    "The hole",
    click.option(
        "--mask", metavar="FILE", type=inputs.INPUT, help="A picture whose white pixels are filled."
    ),
    click.option(
        "--remove",
        metavar="I,J|NAME",
        multiple=True,
        help="Fill the cell of this object, by its indices or its name in `p3i points`; may be given again.",
    ),
)
@grouped.group("How to fill it", options.of(InpaintOptions))
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Fill a hole in each PHOTO with what its pattern shows elsewhere, by the program PROG.

    The hole is what --mask marks and the cells that --remove names; without either it is what is transparent.
    All else stays as it is, to the bit. Without PROG the program is searched for, outside of the hole.
    """
    asked = options.chosen(InpaintOptions, given)
    mask: str | None = given["mask"]

    def fill(job: Job) -> batch.Answer:
        found = api.inpaint(
            job.photo, job.program, asked, mask=mask, remove=given["remove"], progress=job.update
        )
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind, keeps="the others"),
            facts=found.record,
            notes=(*found.photo.notes, *found.notes),
            more=[f"{int(found.hole.sum()):,} pixels filled"],
        )

    # Standard input can be read once; a mask in a file serves all photos of its size.
    return each_photo(given, fill, alone={"--mask -": mask == "-"}, read=(mask,))

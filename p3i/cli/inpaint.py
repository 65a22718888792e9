"""`p3i inpaint`: photos with a hole in, the photos without it out."""

from typing import Any

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
from p3i.errors import UsageError
from p3i.options.inpaint import InpaintOptions


@grouped.command("inpaint")
@inputs.words("PHOTO... [PROG]")
@grouped.group(
    "The hole",
    inputs.mask(),
    click.option(
        "--restore",
        metavar="I,J|NAME",
        multiple=True,
        help="Fill the cell of this object as the others' are, by its indices or its name in `p3i points`; "
        "may be given again.",
    ),
    click.option(
        "--remove",
        metavar="I,J|NAME",
        multiple=True,
        help="Take this object away, the ground goes on under it; may be given again. (--remove of earlier "
        "versions is --restore.)",
    ),
    click.option(
        "--find",
        is_flag=True,
        help="Fill nothing, find what is marred: cells that differ from all others (a stain, a broken tile, "
        "a sign in front). It is told, and written as a mask for --mask.",
    ),
)
@grouped.group("How to fill it", options.of(InpaintOptions))
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Fill a hole in each PHOTO with what its pattern shows elsewhere, by the program PROG.

    The hole is what --mask marks and the cells of the objects that --restore names; without either it is what
    is transparent. Objects that --remove names are taken away. All else stays as it is, to the bit. Without
    PROG the program is searched for, outside of the hole. With --find nothing is filled: a mask is proposed.
    """
    asked = options.chosen(InpaintOptions, given)
    mask: str | None = given["mask"]

    def look(job: Job) -> batch.Answer:
        found = api.find_marred(job.photo, job.program, focal_mm=asked.focal_mm, progress=job.update)
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind),
            facts=found.record,
            notes=(*found.photo.notes, *found.notes),
            more=[f"{int(found.mask.sum()):,} pixels proposed, none filled"],
        )

    def fill(job: Job) -> batch.Answer:
        named = {"restore": given["restore"], "remove": given["remove"]}
        found = api.inpaint(job.photo, job.program, asked, mask=mask, **named, progress=job.update)
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind, keeps="the others"),
            facts=found.record,
            notes=(*found.photo.notes, *found.notes),
            more=[f"{int(found.hole.sum()):,} pixels filled"],
        )

    if given["find"]:
        for option in ("mask", "restore", "remove", "only_pattern"):
            if given[option]:
                word = option.replace("_", "-")
                raise UsageError(f"--find looks for what is marred and fills nothing: leave out --{word}")
        return each_photo(given, look)
    # Standard input can be read once; a mask in a file serves all photos of its size.
    return each_photo(given, fill, alone={"--mask -": mask == "-"}, read=(mask,))

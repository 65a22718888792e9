"""`p3i extend`: photos in, larger pictures out, continued by their programs."""

from functools import partial
from typing import Any

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
from p3i.errors import UsageError
from p3i.options.extend import ExtendOptions, Margins, parse_margins


@grouped.command("extend")
@inputs.words("PHOTO... [PROG]")
@grouped.group(
    "How far",
    options.of(ExtendOptions, "by", by={"default": None}),  # None tells that it was not given
    click.option(
        "--cells",
        type=options.Value(partial(parse_margins, option="--cells"), "N|L,T,R,B"),
        metavar="N|L,T,R,B",
        help="How many more cells to each side, counted at the sides' middles.",
    ),
    options.of(ExtendOptions, "beyond", "max_px", "focal_mm"),
)
@grouped.group("What is hidden", inputs.mask(), options.of(ExtendOptions, "keep_transparent"))
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Continue PHOTO beyond its frame: where the frame cuts the pattern of PROG, the pattern goes on.

    The photo's own pixels stay as they are, to the bit. The picture grows where the pattern does; --beyond
    says what becomes of ground that is not pattern. What is transparent or masked is filled as well, where it
    is pattern. Without PROG the program is searched for.
    """
    if given["by"] is not None and given["cells"] is not None:
        raise UsageError("--by and --cells both say how far: give one of them")
    by: Margins = given["by"] or given["cells"] or ExtendOptions().by
    asked = options.chosen(ExtendOptions, given, by=by)
    mask: str | None = given["mask"]

    def widen(job: Job) -> batch.Answer:
        found = api.extend(job.photo, job.program, asked, mask=mask, progress=job.update)
        left, top, right, bottom = found.margins
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind, keeps="the photo's"),
            facts=found.record,
            notes=(*found.photo.notes, *found.notes),
            more=[f"grown by {left}, {top}, {right}, {bottom} pixels, {found.added} objects added"],
        )

    return each_photo(given, widen, alone={"--mask -": mask == "-"}, read=(mask,))

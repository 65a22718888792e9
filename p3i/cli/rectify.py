"""`p3i rectify`: photos in, their planes straightened out, and back again."""

from typing import Any

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made, stored_anew
from p3i.errors import UsageError
from p3i.options.rectify import RectifyOptions


@grouped.command("rectify")
@inputs.words("PHOTO... [PROG]")
@grouped.group(
    "The view",
    options.of(RectifyOptions),
    click.option(
        "--back",
        metavar="EDITED",
        type=inputs.INPUT,
        help="Write the photo instead, with what was edited in this picture of the same view.",
    ),
)
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Show the plane of each PHOTO as seen straight on, by the program PROG; without one it is searched for.

    With --back an edited view goes back into the photo: use the options that the view was made with. What was
    not edited stays as it is, to the bit.
    """
    asked = options.chosen(RectifyOptions, given)
    edited: str | None = given["back"]
    if asked.tolerance is not None and edited is None:
        raise UsageError("--tolerance belongs to --back")

    def straighten(job: Job) -> batch.Answer:
        found = api.rectify(job.photo, job.program, asked, progress=job.update)

        def picture() -> batch.Made:
            job.update("painting", 0.9)
            if edited is None:
                return made(found.paint(), job.kind)
            returned = found.back(api.read_image(edited))
            plain = made(returned.picture, job.kind)
            said = (*returned.notes, *_remarks(returned.changed, job.kind), *plain.notes)
            return batch.Made(plain.data, said)

        camera, size = found.view.placed.camera, found.size
        view = f"{size.width} x {size.height} px, rx {camera.rx_deg:.4g}, ry {camera.ry_deg:.4g}"
        more = [f"{view}, focal {camera.focal_mm:.4g} mm"]
        info: list[str] = []
        if found.view.mm_per_px is not None and found.view.dpi is not None:
            info.append(f"{1 / found.view.mm_per_px:.4g} pixels per mm ({found.view.dpi:.4g} dpi)")
        return batch.Answer(make=picture, facts=found.record, notes=found.notes, info=info, more=more)

    return each_photo(given, straighten, alone={"--back": edited}, read=(edited,))


def _remarks(changed: int, kind: str) -> list[str]:
    if not changed:
        return ["the edited picture does not differ from the view: the photo is unchanged"]
    return [f"{changed:,} pixels of the photo changed", *stored_anew(kind, "the others to the bit")]

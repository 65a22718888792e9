"""`p3i rectify`: a photo in, its plane straightened out, and back again."""

import dataclasses
from typing import Any

import click

from p3i import api
from p3i.cli import options, progress
from p3i.cli.pictures import Outputs, json_option, kind_option
from p3i.errors import UsageError
from p3i.paint.rectify_options import CROPS, RectifyOptions, parse_cell
from p3i.records import told

sentence, default = told(RectifyOptions)


@click.command("rectify", short_help="Straighten a photo by its program.")
@options.photo_and_program
@options.output("Where to write the picture, the kind by the suffix; - is stdout.")
@kind_option
@json_option
@options.force
@options.field(RectifyOptions, "crop", type=click.Choice(CROPS))
@click.option("--scale", type=float, metavar="S", help=sentence("scale"))
@options.max_px(RectifyOptions)
@click.option("--cell", metavar="WxHmm", help=sentence("cell"))
@options.field(RectifyOptions, "upright", "--upright/--as-seen")
@options.focal(RectifyOptions)
@click.option(
    "--back",
    metavar="EDITED",
    type=options.INPUT,
    help="Write the photo instead, with what was edited in this picture of the same view.",
)
@click.option("--tolerance", type=float, metavar="T", help=sentence("tolerance"))
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> None:
    """Show the plane of PHOTO as seen straight on, by the program PROG; without one it is searched for.

    With --back an edited view goes back into the photo: use the options that the view was made with. What was
    not edited stays as it is, to the bit.
    """
    names = {field.name for field in dataclasses.fields(RectifyOptions)}
    chosen = {name: value for name, value in given.items() if name in names}
    chosen["cell"] = None if given["cell"] is None else parse_cell(given["cell"])
    asked = RectifyOptions(**chosen)
    if asked.tolerance is not None and given["back"] is None:
        raise UsageError("--tolerance belongs to --back")
    photo, program, edited = given["photo"], given["program"], given["back"]
    outputs = Outputs.of(given, inputs=(photo, program, edited))
    with progress.bar(photo, wanted=not given["quiet"]) as update:
        found = api.rectify(photo, program, asked, progress=update)
    outputs.say(found.notes, name=photo)
    picture = None
    if outputs.picture is not None and edited is not None:
        returned = found.back(api.read_image(edited))
        picture = returned.picture
        outputs.say((*returned.notes, *_remarks(returned.changed, outputs.kind)), name=photo)
    elif outputs.picture is not None:
        picture = found.paint()
    outputs.write(picture, found.record(), name=photo)
    if given["verbose"]:
        camera, size = found.view.placed.camera, found.size
        facts = f"{size.width} x {size.height} px, rx {camera.rx_deg:.4g}, ry {camera.ry_deg:.4g}, focal "
        outputs.say([f"{facts}{camera.focal_mm:.4g} mm"], name=photo, kind="info")


def _remarks(changed: int, kind: str) -> list[str]:
    if not changed:
        return ["the edited picture does not differ from the view: the photo is unchanged"]
    found = [f"{changed:,} pixels of the photo changed"]
    if kind in ("jpg", "webp"):
        found.append(
            f"{kind.upper()} stores every pixel anew: write PNG or TIFF to keep the others to the bit"
        )
    return found

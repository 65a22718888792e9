"""`p3i points`: programs, or photos, in; lists of their objects out."""

from collections.abc import Sequence
from typing import Any

import click

from p3i import api
from p3i.carried import kind_of, read_program
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.inputs import PROGRAMS, Inputs, files, names_one, photos_and_programs
from p3i.cli.photos import SUFFIXES
from p3i.cli.pictures import prepared
from p3i.cli.targets import Kinds
from p3i.files import make_folder
from p3i.options.points import BY_SUFFIX, FORMATS, PointsOptions
from p3i.size import parse_size

UNEXPECTED = 1
"""The exit code where `--expect` does not hold: like `fmt --check`, a check was asked for and it says no."""

LISTS = Kinds(
    by_suffix={f".{suffix}": kind for suffix, kind in BY_SUFFIX.items()},
    asked=FORMATS,
    endings={"coco": ".coco.json", "labelme": ".json", "yolo": ".txt"},
    text=frozenset(FORMATS),
    what="format",
)
"""The lists, and what their files are called in a folder where the format has no ending of its own."""


@grouped.command("points")
@inputs.words("PHOTO... [PROG] | PROG...")
@grouped.group(
    "The list",
    click.option(
        "--image",
        type=inputs.INPUT,
        metavar="PHOTO",
        help="The photo of the program: says which objects are there.",
    ),
    options.of(PointsOptions),
    click.option(
        "--expect",
        type=options.Value(parse_size, "CxR"),
        metavar="CxR",
        help=f"Exit with {UNEXPECTED} where the listed objects do not stand in C columns and R rows.",
    ),
)
@grouped.group(
    "Crops",
    click.option(
        "--crops", metavar="DIR", help="Write a picture of each object into this folder, by its name."
    ),
    click.option(
        "--straight/--plain", default=True, help="Crops seen straight on, or cut from the photo as it is."
    ),
)
@targets.written(LISTS, "Where to write the list.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """List the objects of each PHOTO by the program PROG, row by row; without PROG it is found first.

    With a photo each object has a presence between 0 and 1: from 0.5 on it is there, below its place is empty
    or hidden. Programs alone are listed without, or over the one photo --image. The counts go to stderr.
    """
    asked = options.chosen(PointsOptions, given)
    found = _sorted(given["words"], over_image=given["image"] is not None)
    crops, expected = given["crops"], given["expect"]
    to = prepared(given, found, kinds=LISTS, alone={"--crops": crops}, read=(given["image"],))
    program = None if found.program is None else read_program(found.program)
    if crops is not None:  # refused now rather than after a search
        make_folder(crops)

    def listed(name: str, update: batch.Update) -> batch.Answer:
        # A word alone may be a photo or a program; beside a program it is a photo.
        image = given["image"] if program is None else name
        each = api.points(program or name, asked, image=image, progress=update)
        if crops is not None:
            update("cutting crops", 0.9)
            each.write_crops(crops, straight=given["straight"], force=given["force"])
        wrong = "" if expected is None else each.differs_from(expected)
        camera, size = each.camera, each.size
        seen = f"{size.width} x {size.height} px, rx {camera.rx_deg:.4g}, ry {camera.ry_deg:.4g}"
        return batch.Answer(
            make=lambda: batch.Made(each.encode(to.kind)),
            facts=each.record,
            notes=each.notes,
            info=[each.counts],
            more=[f"{seen}, focal {camera.focal_mm:.4g} mm"],
            code=UNEXPECTED if wrong else 0,
            refusal=wrong,
        )

    return batch.run(found.photos, listed, to=to, talk=batch.Talk.of(given))


def _sorted(words: Sequence[str], *, over_image: bool) -> Inputs:
    """Photos and the one program for them; programs alone stand in the photos' place."""
    alike = {kind_of(word, pictures=SUFFIXES) if names_one(word) else "several" for word in words}
    if over_image or alike <= {"program", "drawing"} or alike == {"stream"}:
        return Inputs(files(words, suffixes=PROGRAMS))
    return photos_and_programs(words, suffixes=SUFFIXES | PROGRAMS)

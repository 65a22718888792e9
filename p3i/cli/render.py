"""`p3i render`: programs in, pictures out."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.inputs import PROGRAMS, files
from p3i.cli.pictures import DRAWINGS, drawn
from p3i.errors import UsageError
from p3i.options.render import RenderOptions

_POLL_S = 0.2


@grouped.command("render")
@inputs.words("PROG...")
@grouped.group(
    "What to draw",
    click.option("--image", type=inputs.INPUT, metavar="PHOTO", help="Draw over this photo."),
    click.option(
        "--sprite",
        type=inputs.INPUT,
        metavar="FILE",
        help="A picture to stand at each object, warped by the camera.",
    ),
    options.of(RenderOptions),
)
@targets.written(DRAWINGS, "Where to draw.")
@click.option("--watch", is_flag=True, help="Draw again whenever a file that was read changes, until Ctrl-C.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Draw each program PROG, alone or over a photo.

    Dots are coloured by the loop index i, from red to violet, or in the order of drawing where there is one
    loop.
    """
    asked = options.chosen(RenderOptions, given)
    image, sprite = given["image"], given["sprite"]
    programs = files(given["words"], suffixes=PROGRAMS)
    talk = batch.Talk.of(given)

    def draw(program: str, update: batch.Update) -> batch.Answer:
        update("drawing", 0.1)
        return drawn(api.render(program, asked, image=image, sprite=sprite), to.kind)

    watched = [path for path in (*programs, image, sprite) if path is not None]
    if given["watch"] and (len(programs) > 1 or given["output"] is None or "-" in watched):
        raise UsageError("--watch needs a program's file and -o FILE")
    to = targets.targets(given, inputs=programs, kinds=DRAWINGS, read=(image, sprite))
    if given["watch"]:

        def draw_once(force: bool) -> int:
            return batch.run(programs, draw, to=replace(to, force=force), talk=talk)

        _watch(watched, draw_once, to.force)
    return batch.run(programs, draw, to=to, talk=talk)


def _watch(watched: Sequence[str], draw: Callable[[bool], int], force: bool) -> NoReturn:
    """Draw whenever one of the files changes; ends by Ctrl-C only."""
    before = None
    while True:
        now = [_stamp(Path(path)) for path in watched]
        if now != before:
            before = now
            if draw(force) == 0:  # half-typed programs come by every second
                force = True  # what was drawn by this call may be drawn over
        time.sleep(_POLL_S)


def _stamp(path: Path) -> tuple[int, int] | None:
    """What changes when a file does; None where there is none at the moment."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_mtime_ns, facts.st_size

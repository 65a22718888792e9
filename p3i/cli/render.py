"""`p3i render`: programs in, pictures out."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import click

from p3i import api
from p3i.cli import batch, inputs, options, targets
from p3i.cli.inputs import PROGRAMS, files
from p3i.cli.pictures import DRAWINGS, drawn
from p3i.errors import UsageError
from p3i.paint.options import RenderOptions
from p3i.records import told
from p3i.size import Size

sentence, default = told(RenderOptions)

_POLL_S = 0.2


class SizeType(click.ParamType):
    """`WxH` in pixels, such as 640x480."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Size:
        if isinstance(value, Size):
            return value
        found = re.fullmatch(r"\s*(\d{1,18})\s*[xX×*,]\s*(\d{1,18})\s*", str(value))  # noqa: RUF001
        if found is None or not (int(found[1]) and int(found[2])):
            self.fail(f"{value!r} is no size: write the width and the height in pixels, as in 640x480")
        return Size(int(found[1]), int(found[2]))


@click.command("render", short_help="Draw a program as PNG, SVG or PDF, also over its photo.")
@inputs.words("PROG...")
@targets.written(DRAWINGS, "Where to draw.")
@click.option("--image", type=inputs.INPUT, metavar="PHOTO", help="Draw over this photo.")
@click.option(
    "--sprite",
    type=inputs.INPUT,
    metavar="FILE",
    help="A picture to stand at each object, warped by the camera.",
)
@click.option("--sprite-units", type=float, metavar="U", help=sentence("sprite_units"))
@click.option(
    "--size",
    type=SizeType(),
    metavar="WxH",
    default=default("size"),
    help=sentence("size"),
)
@click.option("--plane", is_flag=True, default=default("plane"), help=sentence("plane"))
@click.option(
    "--markers/--no-markers",
    default=default("markers"),
    help=sentence("markers"),
)
@click.option("--cells/--no-cells", default=default("cells"), help=sentence("cells"))
@click.option(
    "--horizon",
    is_flag=True,
    default=default("horizon"),
    help=sentence("horizon"),
)
@options.focal(RenderOptions)
@options.max_px(RenderOptions)
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

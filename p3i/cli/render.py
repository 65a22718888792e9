"""`p3i render`: programs in, pictures out."""

import dataclasses
import re
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from p3i import api, files
from p3i.cli import options, report
from p3i.cli.targets import targets
from p3i.errors import P3IError, UsageError
from p3i.paint.options import KINDS, RenderOptions, kind_of
from p3i.records import told
from p3i.size import Size

sentence, default = told(RenderOptions)

_SUFFIXES = frozenset({".p3p"})
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
@click.argument("programs", metavar="PROG...", type=options.INPUT, nargs=-1, required=True)
@options.output("Where to draw, the kind by the suffix; - is stdout. Several programs need a folder.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(KINDS),
    default=None,
    help="The kind of picture. [default: by the name of -o, else png]",
)
@options.force
@click.option("--image", type=options.INPUT, metavar="PHOTO", help="Draw over this photo.")
@click.option(
    "--sprite",
    type=options.INPUT,
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
    """Draw each program PROG: a file, a glob or a folder.

    PROG may also be a PNG or SVG that was drawn here: both carry their program. Dots are coloured by the
    loop index i, from red to violet, or in the order of drawing where there is one loop.
    """
    return run(Call.of(given))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One call of `p3i render`, with all that can be known before a program is read."""

    programs: tuple[Path, ...]
    options: RenderOptions
    image: str | None
    sprite: str | None
    output: str
    """A file, or - for stdout; a folder where `into_folder`."""
    into_folder: bool
    kind: str
    force: bool
    watch: bool
    quiet: bool
    verbose: bool
    errors_as_json: bool

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Call":
        """The call that the options of the command line mean; raises UsageError or FileError."""
        names = {field.name for field in dataclasses.fields(RenderOptions)}
        chosen = RenderOptions(**{name: value for name, value in given.items() if name in names})
        words: tuple[str, ...] = given["programs"]
        programs = (Path("-"),) if words == ("-",) else tuple(files.gather(words, suffixes=_SUFFIXES))
        output: str = given["output"] or "-"
        into_folder = output != "-" and files.names_folder(output)
        kind: str | None = given["kind"]
        if kind is None:
            kind = "png" if output == "-" or into_folder else kind_of(output)
        if len(programs) > 1 and not into_folder:
            raise UsageError(f"{len(programs)} programs need -o FOLDER/")
        if given["watch"] and (output == "-" or into_folder or programs == (Path("-"),)):
            raise UsageError("--watch needs a program's file and -o FILE")
        if output == "-" and kind != "svg" and sys.stdout.isatty():
            raise UsageError(f"a {kind.upper()} picture does not belong on a terminal: name a file with -o")
        return cls(
            programs=programs,
            options=chosen,
            image=given["image"],
            sprite=given["sprite"],
            output=output,
            into_folder=into_folder,
            kind=kind,
            force=given["force"],
            watch=given["watch"],
            quiet=given["quiet"],
            verbose=given["verbose"] > 0,
            errors_as_json=given["error_format"] == "json",
        )


def run(call: Call) -> int:
    """Draw the programs in order and return the exit code: 6 where some of many failed."""
    names = [f"{program.stem or program.name}.{call.kind}" for program in call.programs]
    found = targets(
        call.output,
        names,
        into_folder=call.into_folder,
        clash="two programs would both be drawn to",
        force=call.force,
    )
    if len(found) == 1:
        if call.watch:
            _watch(call, found[0])
        _draw(call, call.programs[0], found[0], force=call.force)
        return 0
    failed = 0
    for program, target in zip(call.programs, found, strict=True):
        try:
            _draw(call, program, target, force=call.force)
        except P3IError as error:
            failed += 1
            report.p3i_error(error, as_json=call.errors_as_json)
    return 6 if failed else 0


def _draw(call: Call, program: Path, target: str, *, force: bool) -> None:
    picture = api.render(program, call.options, image=call.image, sprite=call.sprite)
    picture.save(target, kind=call.kind, force=force)
    if call.quiet:
        return
    for note in picture.notes:
        report.line(f"{program}: {note}", as_json=call.errors_as_json, kind="note")
    if call.verbose:
        size, camera = picture.size, picture.camera
        facts = f"{size.width} x {size.height} px, focal {camera.focal_mm:g} mm ({picture.focal_source})"
        report.line(f"{target}: {facts}", as_json=call.errors_as_json, kind="info")


def _watch(call: Call, target: str) -> None:
    """Draw whenever the program, the photo or the sprite changes; ends by Ctrl-C only."""
    watched = [path for path in (call.programs[0], call.image, call.sprite) if path is not None]
    force, before = call.force, None
    while True:
        now = [_stamp(Path(path)) for path in watched]
        if now != before:
            before = now
            try:
                _draw(call, call.programs[0], target, force=force)
                force = True  # what was drawn by this call may be drawn over
            except P3IError as error:  # half-typed programs come by every second
                report.p3i_error(error, as_json=call.errors_as_json)
        time.sleep(_POLL_S)


def _stamp(path: Path) -> tuple[int, int] | None:
    """What changes when a file does; None where there is none at the moment."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_mtime_ns, facts.st_size

"""`p3i points`: programs, or photos, in; lists of their objects out."""

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from p3i import api, files
from p3i.cli import options, photos, progress, report
from p3i.cli.render import SizeType
from p3i.cli.targets import targets
from p3i.errors import P3IError, UsageError
from p3i.paint.points_options import FORMATS, PointsOptions, format_of
from p3i.records import told
from p3i.size import Size

sentence, default = told(PointsOptions)

UNEXPECTED = 1
"""The exit code where `--expect` does not hold: like `fmt --check`, a check was asked for and it says no."""

_SUFFIXES = frozenset({".p3p"})
_ENDINGS = {"coco": ".coco.json", "labelme": ".json"}


@click.command("points", short_help="List the objects: places, names, cells, and whether each is there.")
@click.argument("programs", metavar="PROG|PHOTO...", type=options.INPUT, nargs=-1, required=True)
@options.output("Where to write, the format by the suffix; - is stdout. Several inputs need a folder.")
@click.option(
    "--format",
    "form",
    type=click.Choice(FORMATS),
    default=None,
    help="How to write the list. [default: by the name of -o, else csv]",
)
@options.force
@click.option(
    "--image",
    type=options.INPUT,
    metavar="PHOTO",
    help="The photo of the program: says which objects are there.",
)
@click.option(
    "--size",
    type=SizeType(),
    metavar="WxH",
    default=default("size"),
    help=sentence("size"),
)
@click.option(
    "--min-presence",
    type=float,
    metavar="P",
    default=default("min_presence"),
    help=sentence("min_presence"),
)
@click.option(
    "--all",
    "outside",
    is_flag=True,
    default=default("outside"),
    help=sentence("outside"),
)
@click.option("--clip", is_flag=True, default=default("clip"), help=sentence("clip"))
@options.field(PointsOptions, "label", metavar="WORD")
@click.option(
    "--expect",
    type=SizeType(),
    metavar="CxR",
    help=f"Exit with {UNEXPECTED} where the listed objects do not stand in C columns and R rows.",
)
@click.option("--crops", metavar="DIR", help="Write a picture of each object into this folder, by its name.")
@click.option(
    "--straight/--plain", default=True, help="Crops seen straight on, or cut from the photo as it is."
)
@options.focal(PointsOptions)
@options.quiet
@options.error_format
def command(**given: Any) -> int:
    """List the objects of each program PROG, row by row: a file, a glob or a folder.

    Of a PHOTO the program is found first, as by `p3i synth`. With a photo each object has a presence between
    0 and 1: from 0.5 on it is there, below its place is empty or hidden. The counts go to stderr.
    """
    return run(Call.of(given))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One call of `p3i points`, with all that can be known before a file is read."""

    programs: tuple[str, ...]
    options: PointsOptions
    image: str | None
    form: str
    output: str
    """A file, or - for stdout; a folder where `into_folder`."""
    into_folder: bool
    expect: Size | None
    crops: Path | None
    straight: bool
    force: bool
    quiet: bool
    errors_as_json: bool

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Call":
        """The call that the options of the command line mean; raises UsageError or FileError."""
        names = {field.name for field in dataclasses.fields(PointsOptions)}
        chosen = PointsOptions(**{name: value for name, value in given.items() if name in names})
        words: tuple[str, ...] = given["programs"]
        suffixes = _SUFFIXES if given["image"] else _SUFFIXES | photos.SUFFIXES
        programs = words if words == ("-",) else tuple(map(str, files.gather(words, suffixes=suffixes)))
        output: str = given["output"] or "-"
        into_folder = output != "-" and files.names_folder(output)
        form: str | None = given["form"]
        if form is None:
            form = "csv" if output == "-" or into_folder else format_of(output)
        if len(programs) > 1 and not into_folder:
            raise UsageError(f"{len(programs)} inputs need -o FOLDER/")
        if len(programs) > 1 and given["crops"]:
            raise UsageError("--crops takes one program or photo: names of objects are the same in each")
        return cls(
            programs=programs,
            options=chosen,
            image=given["image"],
            form=form,
            output=output,
            into_folder=into_folder,
            expect=given["expect"],
            crops=Path(given["crops"]) if given["crops"] else None,
            straight=given["straight"],
            force=given["force"],
            quiet=given["quiet"],
            errors_as_json=given["error_format"] == "json",
        )


def run(call: Call) -> int:
    """List the objects of each input and return the exit code: 6 where some of many failed."""
    ending = _ENDINGS.get(call.form, f".{call.form}")
    names = [f"{Path(program).stem or 'stdin'}{ending}" for program in call.programs]
    found = targets(
        call.output,
        names,
        into_folder=call.into_folder,
        clash="two inputs would both be written to",
        force=call.force,
    )
    if len(found) == 1:
        return _list(call, call.programs[0], found[0])
    codes = []
    for program, target in zip(call.programs, found, strict=True):
        try:
            codes.append(_list(call, program, target))
        except P3IError as error:
            codes.append(report.p3i_error(error, as_json=call.errors_as_json))
    return 0 if not any(codes) else codes[0] if len(set(codes)) == 1 else 6


def _list(call: Call, program: str, target: str) -> int:
    """Write one list; returns the exit code."""
    from p3i.vision.write import write_bytes

    with progress.bar(Path(program).name, wanted=not call.quiet) as update:
        found = api.points(program, call.options, image=call.image, progress=update)
    write_bytes(target, found.encode(call.form), force=call.force)
    if call.crops is not None:
        found.write_crops(call.crops, straight=call.straight, force=call.force)
    if not call.quiet:
        for note in found.notes:
            report.line(f"{program}: {note}", as_json=call.errors_as_json, kind="note")
        if call.errors_as_json or target != "-" or not sys.stdout.isatty():
            report.line(f"{program}: {found.counts}", as_json=call.errors_as_json, kind="info")
        else:
            report.line(found.counts, kind="info")
    if call.expect is not None and (sentence_ := found.differs_from(call.expect)):
        report.line(f"{program}: {sentence_}", as_json=call.errors_as_json, code=UNEXPECTED)
        return UNEXPECTED
    return 0

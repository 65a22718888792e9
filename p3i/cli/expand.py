"""`p3i expand`: the objects that a program draws."""

import json

import click

from p3i import language
from p3i.cli import grouped, options, programs
from p3i.cli.inputs import INPUT
from p3i.grammar.parse_error import ParseError
from p3i.grammar.printer import number_text
from p3i.interp.unroll import Point


@grouped.command("expand")
@click.argument("file", metavar="FILE", type=INPUT)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "csv", "json"]),
    default="text",
    show_default=True,
    help="How to write the list.",
)
@options.error_format
def command(file: str, form: str, error_format: str) -> int:
    """List every draw of the program FILE with its loop indices and its place.

    FILE is a program, a PNG or SVG that carries it, - for standard input, or a glob, a folder or @LIST that
    names one.

    x and y are in program units: hundredths of the longer side of the canvas, from its middle, x to the
    right and y down, before the camera tilts the plane. A variable without a loop counts as 0. Draws that
    coincide are all listed; nothing is left out because it lies behind the camera.
    """
    path, source = programs.one(file)
    try:
        points = language.expand(source, path=programs.shown(path))
    except ParseError as error:
        return programs.write_errors(error, as_json=error_format == "json")
    programs.write_out(_WRITERS[form](points))
    return 0


def _text(points: list[Point]) -> str:
    rows = [("i", "j", "x", "y")] + [(str(i), str(j), f"{x:.6g}", f"{y:.6g}") for x, y, i, j in points]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(lines) + "\n"


def _csv(points: list[Point]) -> str:
    return "i,j,x,y\n" + "".join(f"{i},{j},{number_text(x)},{number_text(y)}\n" for x, y, i, j in points)


def _json(points: list[Point]) -> str:
    lines = ",\n ".join(json.dumps({"i": i, "j": j, "x": x, "y": y}) for x, y, i, j in points)
    return f"[{lines}]\n"


_WRITERS = {"text": _text, "csv": _csv, "json": _json}

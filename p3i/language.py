"""The functions behind `check`, `fmt` and `expand`, and reading and writing of programs: no torch, no numpy.

`source` is a program's text, as str or bytes, wherever it stands below; most take a `Program` as well.
"""

import os
from collections.abc import Iterator

from p3i import files
from p3i.errors import P3IError, UsageError
from p3i.grammar import checker
from p3i.grammar.ast import Program, Span
from p3i.grammar.diagnostics import Diagnostic, in_order, warning
from p3i.grammar.layout import most_bytes, source_text
from p3i.grammar.leaves import comments
from p3i.grammar.parse_error import ParseError
from p3i.grammar.parser import parse, parse_with_holes
from p3i.grammar.printer import Layout, format_program
from p3i.grammar.sketch import Sketch, format_sketch, parse_sketch, sketch_of
from p3i.interp import unroll
from p3i.interp.unroll import Point

FOCAL_MM = 35.0
"""The focal of a program whose header gives none (the paper's f)."""


def check(source: str | bytes | Program, *, strict: bool = False) -> tuple[Diagnostic, ...]:
    """Everything that p3i has to say about a program or a sketch, in the order of the text.

    No input raises. With `strict`, what leaves Table 1 is an error too. A sketch is checked as far as its
    holes allow: what it draws is not known yet.
    """
    if isinstance(source, Program):
        return check(format_program(source), strict=strict)
    if strict:
        program = parse(source, strict=True)
        if isinstance(program, tuple):
            return program
    parsed = parse_with_holes(source)
    if isinstance(parsed, tuple):
        return parsed
    if parsed.holes:
        sketch = sketch_of(parsed)
        return in_order((*parsed.warnings, *(sketch if isinstance(sketch, tuple) else ())))
    found = (
        *parsed.warnings,
        *checker.warnings(parsed.program, source=source_text(source)),
        *_drawing(parsed.program),
    )
    return in_order(found)


def loads(source: str | bytes, *, strict: bool = False, path: str = "<program>") -> Program:
    """The program that `source` spells. Raises ParseError, which holds every error with its place."""
    program = parse(source, strict=strict)
    if isinstance(program, tuple):
        raise ParseError(program, source=source_text(source), path=path)
    return program


def dumps(program: Program, *, layout: Layout = "python") -> str:
    """The program's text. Raises ParseError for layout "table1" outside Table 1."""
    return format_program(program, layout=layout)


def load(path: str | os.PathLike[str], *, strict: bool = False) -> Program:
    """The program in the file at `path`. Raises FileError for the file, ParseError for its text."""
    return loads(read(path), strict=strict, path=os.fspath(path))


def load_sketch(path: str | os.PathLike[str]) -> Sketch:
    """The sketch in the file at `path`; a program without holes is one too.

    Raises FileError for the file, ParseError for its text.
    """
    source = read(path)
    sketch = parse_sketch(source)
    if isinstance(sketch, tuple):
        raise ParseError(sketch, source=source_text(source), path=os.fspath(path))
    return sketch


def dump(program: Program, path: str | os.PathLike[str], *, layout: Layout = "python") -> None:
    """Write the program's text to `path`, whole or not at all, over what is there. Raises FileError."""
    write(path, dumps(program, layout=layout))


def format(
    source: str | bytes | Program | Sketch,
    *,
    layout: Layout | None = None,
    strict: bool = False,
    path: str = "<program>",
) -> str:
    """The canonical text of a program or a sketch: comments and header stay, in order.

    With `strict` the source must be spelt as in Table 1, and so is the result. `path` names the source in
    errors. Raises ParseError for a text with errors and for layout "table1" outside Table 1, UsageError for
    `strict` with layout "python", in which Table 1 has no text, and for a sketch in layout "table1".
    """
    if strict and layout == "python":
        raise UsageError("strict text exists in layout table1 only: leave out the layout, or strict")
    layout = layout or ("table1" if strict else "python")
    if isinstance(source, Program):
        return format_program(source, layout=layout)
    if isinstance(source, Sketch):
        return _format_sketch(source, layout)
    read = _sketch_without_holes(source) if strict else parse_sketch(source)
    if isinstance(read, tuple):
        raise ParseError(read, source=source_text(source), path=path)
    try:
        return _format_sketch(read, layout)
    except ParseError as outside:
        raise ParseError(outside.diagnostics, source=source_text(source), path=path) from None


def _sketch_without_holes(source: str | bytes) -> Sketch | tuple[Diagnostic, ...]:
    """The program that `source` spells in strict mode, as a sketch."""
    program = parse(source, strict=True)
    return program if isinstance(program, tuple) else Sketch(program, ())


def verify_format(
    source: str | bytes, text: str, *, layout: Layout | None = None, strict: bool = False
) -> None:
    """Hold `text`, the format of `source` with these options, to the first two laws of the language.

    Comments are held too, in their order. Raises FormatLawError where `text` means something else than
    `source`, or is no fixed point.
    """
    before, after = parse_sketch(source), parse_sketch(text)
    if isinstance(before, tuple) or isinstance(after, tuple) or not _same(before, after):
        raise FormatLawError("p3i would have changed the meaning of this program; it was left alone")
    if format(text, layout=layout, strict=strict) != text:
        raise FormatLawError("p3i would format this program differently a second time; it was left alone")


def _same(before: Sketch, after: Sketch) -> bool:
    blocks = [sketch.template.header.lines if sketch.template.header else () for sketch in (before, after)]
    remarks = [comments(sketch.template) for sketch in (before, after)]
    return before == after and blocks[0] == blocks[1] and remarks[0] == remarks[1]


class FormatLawError(P3IError):
    """A bug of the printer, caught before it touched a file."""


def expand(source: str | bytes | Program, *, path: str = "<program>") -> list[Point]:
    """Every draw as (x, y, i, j) in program units, in the order of the loops, coinciding draws included.

    Raises ParseError for a text with errors, for loops that turn too often and coordinates that overflow.
    """
    if isinstance(source, Program):
        return unroll.points(source)
    try:
        return unroll.points(loads(source, path=path))
    except ParseError as refused:
        raise ParseError(refused.diagnostics, source=source_text(source), path=path) from None


def read(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file, as far as a program's text may reach. Raises FileError with a reason."""
    return files.read_bytes(path, most=most_bytes() + 1, cut=True)


def write(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` to `path`, whole or not at all, over what is there. Raises FileError."""
    with files.replacing(path, force=True) as stream:
        stream.write(text)


def _format_sketch(sketch: Sketch, layout: Layout) -> str:
    if layout == "table1":
        if sketch.holes:
            raise UsageError("layout table1 holds programs of Table 1 only: this is a sketch")
        return format_program(sketch.template, layout=layout)
    return format_sketch(sketch)


def _drawing(program: Program) -> Iterator[Diagnostic]:
    """Findings about what is drawn; the loops are unrolled for them."""
    try:
        points = unroll.points(program)
    except ParseError as refused:
        yield from refused.diagnostics
        return
    parts = unroll.nest(program)
    draw = parts.draw.span
    if not points:
        yield _nothing_drawn(parts)
        return
    objects = len(unroll.distinct(points))
    if objects < len(points):
        message = f"{len(points) - objects} of {len(points)} draws coincide with others"
        help = "they count as one object; narrow the bounds, or spread the coordinates"
        yield warning("P203", message, draw, help=help)
    if unroll.on_one_line(points):
        message = (
            f"all {objects} objects lie on one line" if objects > 1 else "a single object is drawn"
        ) + ": one direction cannot fix a plane"
        yield warning("P202", message, draw, help="let `i` and `j` move the draw in two directions")
    focal_mm = program.header.focal_mm if program.header and program.header.focal_mm else FOCAL_MM
    hidden = unroll.in_front(program, points, focal_mm=focal_mm).count(False)
    if hidden:
        message = f"{hidden} of {len(points)} points lie at or behind the camera and are not drawn"
        help = "tilt the camera less, or move the points towards the middle"
        yield warning("P204", message, program.camera.span or draw, help=help)


def _nothing_drawn(parts: unroll.Nest) -> Diagnostic:
    """Which statement keeps the program from drawing anything."""
    empty = [loop for loop in (parts.for_i, parts.for_j) if loop and _never_turns(loop)]
    if empty or not parts.guards:
        loop = empty[0] if empty else parts.for_j or parts.for_i
        span: Span | None = loop.span if loop else None
        help = "a range holds the whole numbers from its first bound up to, not with, its second"
        return warning("P201", "nothing is drawn: this loop never turns", span, help=help)
    help = "turn `>=` into `<=`, or widen the bounds"
    return warning(
        "P201", "nothing is drawn: the guards never hold together", parts.guards[0].span, help=help
    )


def _never_turns(loop: unroll.For) -> bool:
    bounds = (loop.start, loop.stop)
    return all(bound.i == 0 for bound in bounds) and loop.start.constant >= loop.stop.constant

"""What can be said of a program from its tree alone: scope and bounds (errors), suspicious rings (warnings).

What needs the loops unrolled (empty loops, points on a line, behind the camera) is in p3i/language.py.
"""

import math
import re
from collections.abc import Iterator

from p3i.grammar.ast import Draw, For, Polar, Program, Span
from p3i.grammar.diagnostics import Diagnostic, error, warning
from p3i.grammar.leaves import affines, statements
from p3i.grammar.source import line_and_column, line_starts


def errors(program: Program, *, source: str = "") -> tuple[Diagnostic, ...]:
    """Why the program has no meaning; empty where it has one. With its `source` the places are exact."""
    return (*_loop_errors(program), *_scope_errors(program, source))


def warnings(program: Program, *, source: str = "") -> tuple[Diagnostic, ...]:
    """What is legal and probably not meant. With its `source` the places are exact."""
    return (*_reads_as_one(program, source), *_uneven_ring(program))


def _loop_errors(program: Program) -> Iterator[Diagnostic]:
    order = "`for i` may enclose `for j`, never the reverse, and each stands once"
    seen: list[str] = []
    for _, statement in statements(program):
        if not isinstance(statement, For):
            continue
        if statement.variable in seen:
            yield error("P112", f"there is a second `for {statement.variable}`", statement.span, help=order)
        elif seen == ["j"]:
            yield error("P112", "`for i` stands inside `for j`", statement.span, help=order)
        seen.append(statement.variable)
        if statement.variable == "i":
            for bound in (statement.start, statement.stop):
                below = math.floor(bound.constant)
                if bound.constant != below:
                    message = "a bound of `for i` is a whole number"
                    help = f"write {below} or {below + 1}"
                    yield error("P113", message, bound.span, help=help)


def _scope_errors(program: Program, source: str) -> Iterator[Diagnostic]:
    bound: set[str] = set()
    lenient = _ring_at_the_top(program)
    for path, affine in affines(program):
        name, _, part = path.partition(".")
        allowed = bound | {"i"} if part and lenient else bound  # in bounds and coordinates, not in guards
        for variable, coefficient in (("i", affine.i), ("j", affine.j)):
            if coefficient != 0 and variable not in allowed:
                place = _place_for(variable, program, source)
                yield error(
                    "P104",
                    f"`{variable}` is not bound here",
                    _narrowed(affine.span, variable, source),
                    label=f"no enclosing `for {variable}`",
                    help=f"put `for {variable} in range(0, n):` around {place}, or write a number",
                )
        if name.startswith("for_") and part == "stop":
            bound = bound | {name.removeprefix("for_")}


def _narrowed(span: Span | None, variable: str, source: str) -> Span | None:
    """The place of the variable itself inside an expression."""
    if span is None:
        return None
    found = re.compile(rf"(?<![A-Za-z_]){variable}(?![A-Za-z0-9_])").search(source, span.start, span.end)
    return Span(*found.span()) if found else span


def _place_for(variable: str, program: Program, source: str) -> str:
    """What a loop over `variable` would go around: everything for i, what is below `for i` for j."""
    world = program.world
    inner = world.body if variable == "j" and isinstance(world, For) and world.variable == "i" else world
    if inner.span is None or not source:
        return "the draw"
    return f"line {line_and_column(inner.span.start, line_starts(source))[0]}"


def _ring_at_the_top(program: Program) -> bool:
    """Whether `for j` is outermost and both coordinates are Polar: Table 1's top-level ring."""
    world = program.world
    draw = _draw(program)
    return (
        isinstance(world, For)
        and world.variable == "j"
        and isinstance(draw.x, Polar)
        and isinstance(draw.y, Polar)
    )


def _reads_as_one(program: Program, source: str) -> Iterator[Diagnostic]:
    if not _ring_at_the_top(program):
        return
    for path, affine in affines(program):
        if affine.i != 0 and not path.startswith("if_"):
            yield warning(
                "P105",
                "`i` is not bound here and reads as 1",
                _narrowed(affine.span, "i", source),
                label="no enclosing `for i`",
                help="write the number without `i`, or put `for i in range(1, n):` around the ring",
            )
            return  # once a program: the first place stands for all


def _uneven_ring(program: Program) -> Iterator[Diagnostic]:
    draw = _draw(program)
    if not (isinstance(draw.x, Polar) and isinstance(draw.y, Polar)):
        return
    span = draw.y.span
    if draw.x.radius != draw.y.radius:
        yield warning(
            "P205",
            "the radius differs between x and y: the ring is an ellipse",
            span,
            help="write the same radius in x and y",
        )
    if draw.x.angle != draw.y.angle:
        yield warning(
            "P206",
            "the angle differs between x and y: the points do not run round a ring",
            span,
            help="write the same angle in x and y",
        )


def _draw(program: Program) -> Draw:
    *_, (_, draw) = statements(program)
    assert isinstance(draw, Draw)
    return draw

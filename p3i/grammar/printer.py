"""Program -> text, in one spelling for each of the two layouts. `parse(format_program(p)) == p` is the law.

The canonical layout "python" is also valid Python 3 syntax; "table1" is the spelling of the supplement's
Table 1 and exists for programs inside Table 1 only.
"""

import json
from collections.abc import Mapping
from typing import Literal

from p3i.grammar.ast import Affine, Coordinate, Draw, For, If, Polar, Program
from p3i.grammar.departures import departures
from p3i.grammar.header import header_lines
from p3i.grammar.leaves import statements
from p3i.grammar.parse_error import ParseError

Layout = Literal["python", "table1"]
_INDENT = "    "
_NO_HOLES: Mapping[str, str] = {}


def format_program(program: Program, *, layout: Layout = "python") -> str:
    """The program's text, ending in a newline.

    Raises ParseError for layout "table1" where the program lies outside Table 1: every place, as P301.
    """
    if layout == "python":
        return python_text(program)
    left = departures(program)
    if left:
        raise ParseError(left)
    return _table1_text(program)


def python_text(program: Program, holes: Mapping[str, str] = _NO_HOLES) -> str:
    """The canonical text; a number whose path is in `holes` prints as the text given there."""
    lines = list(header_lines(program.header)) if program.header else []
    camera = program.camera
    rx, ry = (
        holes.get(f"camera.{name}") or number_text(angle)
        for name, angle in (("rx", camera.rx_deg), ("ry", camera.ry_deg))
    )
    lines += [*camera.comments, f"SetCameraPose(rx={rx}, ry={ry})"]
    indent = ""
    for path, statement in statements(program):
        lines += [indent + comment for comment in statement.comments]
        match statement:
            case For(variable=variable, start=start, stop=stop):
                bounds = f"{_affine(start, f'{path}.start', holes)}, {_affine(stop, f'{path}.stop', holes)}"
                lines.append(f"{indent}for {variable} in range({bounds}):")
            case If(guard=guard):
                lines.append(f"{indent}if {_guard(guard, path, holes)}:")
            case Draw():
                lines.append(indent + _draw(statement, path, holes))
        indent += _INDENT
    lines += program.trailing_comments
    return "\n".join(lines) + "\n"


def number_text(value: float) -> str:
    """The shortest text that reads back as `value`; whole numbers without `.0`."""
    return str(int(value)) if value == int(value) and abs(value) < 1e16 else repr(value)


def brief(value: float) -> str:
    """A number to a hundredth, in as few characters as it takes: what pictures need of pixels."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def affine_text(affine: Affine) -> str:
    """An affine in canonical spelling, as messages quote it."""
    return _affine(affine, "", _NO_HOLES)


def _terms(affine: Affine, path: str, holes: Mapping[str, str]) -> list[str]:
    """The signed terms in the order i, j, constant; zeros are left out, holes are not."""
    found: list[str] = []
    for part, value in (("i", affine.i), ("j", affine.j), ("1", affine.constant)):
        hole = holes.get(f"{path}.{part}")
        if hole is not None:
            found.append(hole if part == "1" else f"{hole}*{part}")
        elif value != 0:
            found.append(number_text(value) if part == "1" else _times(value, part))
    return found


def _times(value: float, factor: str) -> str:
    if abs(value) == 1:
        return factor if value > 0 else f"-{factor}"
    return f"{number_text(value)}*{factor}"


def _sum(terms: list[str]) -> str:
    text = terms[0] if terms else "0"
    for term in terms[1:]:
        text += f" - {term[1:]}" if term.startswith("-") else f" + {term}"
    return text


def _affine(affine: Affine, path: str, holes: Mapping[str, str]) -> str:
    return _sum(_terms(affine, path, holes))


def _coordinate(coordinate: Coordinate, path: str, holes: Mapping[str, str]) -> str:
    if isinstance(coordinate, Affine):
        return _affine(coordinate, path, holes)
    call = f"{coordinate.function}({_affine(coordinate.angle, f'{path}.angle', holes)})"
    radius = _terms(coordinate.radius, f"{path}.radius", holes)
    match radius:
        case ["1"]:
            ring = call
        case ["-1"]:
            ring = f"-{call}"
        case [] | [_]:
            ring = f"{_sum(radius)}*{call}"
        case _:
            ring = f"({_sum(radius)})*{call}"
    return _sum([ring, *_terms(coordinate.offset, f"{path}.offset", holes)])


def _guard(guard: Affine, path: str, holes: Mapping[str, str]) -> str:
    """Variables left, constant right, the first coefficient positive; `c >= 0` where there is no variable."""
    if any(f"{path}.{part}" in holes for part in "ij1"):
        return f"{_affine(guard, path, holes)} >= 0"  # a hole keeps its sign, so it stays on the left
    variables = Affine(guard.i, guard.j)
    if variables == Affine():
        return f"{number_text(guard.constant)} >= 0"
    if (guard.i or guard.j) > 0:
        return f"{affine_text(variables)} >= {number_text(0.0 - guard.constant)}"
    return f"{affine_text(Affine(-guard.i, -guard.j))} <= {number_text(guard.constant)}"


def _draw(draw: Draw, path: str, holes: Mapping[str, str]) -> str:
    picture = f"{json.dumps(draw.picture, ensure_ascii=False)}, " if draw.picture is not None else ""
    x, y = (_coordinate(part, f"{path}.{name}", holes) for name, part in (("x", draw.x), ("y", draw.y)))
    return f"Draw({picture}x={x}, y={y})"


def _table1_text(program: Program) -> str:
    """Table 1's own spelling: the camera on one line, the world on the next, its comments above it."""
    lines = list(header_lines(program.header)) if program.header else []
    camera = program.camera
    lines += [
        *camera.comments,
        f"SetCameraPose(rx={number_text(camera.rx_deg)}, ry={number_text(camera.ry_deg)});",
    ]
    opened: list[str] = []
    for _, statement in statements(program):
        lines += statement.comments
        match statement:
            case For(variable=variable, start=start, stop=stop):
                ring = isinstance(_innermost(program).x, Polar) and variable == "j"
                bounds = ", ".join(
                    f"{number_text(bound.i)} * i" if ring else str(int(bound.constant))
                    for bound in (start, stop)
                )
                opened.append(f"For ({variable} in range({bounds})) {{")
            case If(guard=guard):
                opened.append(f"If ({_table1_expr(guard)} >= 0) {{")
            case Draw(x=x, y=y):
                opened.append(f"Draw(x={_table1_coordinate(x)}, y={_table1_coordinate(y)})")
    lines.append(" ".join(opened) + " }" * (len(opened) - 1))
    lines += program.trailing_comments
    return "\n".join(lines) + "\n"


def _innermost(program: Program) -> Draw:
    *_, (_, draw) = statements(program)
    assert isinstance(draw, Draw)
    return draw


def _table1_expr(affine: Affine) -> str:
    return f"{number_text(affine.i)} * i + {number_text(affine.j)} * j"


def _table1_coordinate(coordinate: Coordinate) -> str:
    if isinstance(coordinate, Affine):
        return _table1_expr(coordinate)
    call = f"{coordinate.function}({number_text(coordinate.angle.j)} * j)"
    grows = coordinate.radius.i != 0
    radius = coordinate.radius.i if grows else coordinate.radius.constant
    offset = number_text(coordinate.offset.constant)
    return f"{number_text(radius)} * {call}{' * i' if grows else ''} + {offset}"

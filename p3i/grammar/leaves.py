"""Every number of a program under its path: the keystone that programs, gradients, holes and traces share.

Paths read `camera.rx`, `for_j.stop.i`, `if_1.j` (the outermost guard is `if_1`), `draw.x.1`,
`draw.y.radius.i`, `draw.y.angle.j`, `draw.y.offset.1`; the last part is the loop variable that the number
multiplies, or `1`. Zeros are leaves too, so programs of one shape have the same paths.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping

from p3i.errors import ProgramError
from p3i.grammar.ast import Affine, Coordinate, Draw, For, If, Polar, Program, Statement

_AFFINE_FIELDS = {"i": "i", "j": "j", "1": "constant"}


def leaves(program: Program) -> dict[str, float]:
    """All numbers of the program by path, in the order of the text."""
    found = {"camera.rx": program.camera.rx_deg, "camera.ry": program.camera.ry_deg}
    for path, affine in affines(program):
        for part, name in _AFFINE_FIELDS.items():
            found[f"{path}.{part}"] = getattr(affine, name)
    return found


def with_leaves(program: Program, values: Mapping[str, float]) -> Program:
    """The program with the numbers at the given paths replaced; the rest, spans and comments stay.

    Raises ProgramError where the program has no such path, ValueError for a number that is not finite.
    """
    unknown = values.keys() - leaves(program).keys()
    if unknown:
        raise ProgramError(f"this program has no number at {', '.join(sorted(unknown))}")

    def fill(path: str, affine: Affine) -> Affine:
        changes = {
            name: values[f"{path}.{part}"]
            for part, name in _AFFINE_FIELDS.items()
            if f"{path}.{part}" in values
        }
        return dataclasses.replace(affine, **changes)

    camera = dataclasses.replace(
        program.camera,
        rx_deg=values.get("camera.rx", program.camera.rx_deg),
        ry_deg=values.get("camera.ry", program.camera.ry_deg),
    )
    return map_affines(dataclasses.replace(program, camera=camera), fill)


def statements(program: Program) -> Iterator[tuple[str, Statement]]:
    """The statements from the outside in, each with its path: `for_i`, `for_j`, `if_1`, ..., `draw`."""
    guards = 0
    statement: Statement | None = program.world
    while statement is not None:
        match statement:
            case For(variable=variable, body=body):
                yield f"for_{variable}", statement
                statement = body
            case If(body=body):
                guards += 1
                yield f"if_{guards}", statement
                statement = body
            case Draw():
                yield "draw", statement
                statement = None


def affines(program: Program) -> Iterator[tuple[str, Affine]]:
    """Every affine of the program with its path, in the order of the text."""
    for path, statement in statements(program):
        match statement:
            case For(start=start, stop=stop):
                yield f"{path}.start", start
                yield f"{path}.stop", stop
            case If(guard=guard):
                yield path, guard
            case Draw(x=x, y=y):
                yield from _coordinate_affines(f"{path}.x", x)
                yield from _coordinate_affines(f"{path}.y", y)


def comments(program: Program) -> tuple[str, ...]:
    """All comments of the program in the order of the text, those of the header block aside."""
    above = program.header.comments if program.header else ()
    inside = (comment for _, statement in statements(program) for comment in statement.comments)
    return (*above, *program.camera.comments, *inside, *program.trailing_comments)


def map_affines(program: Program, change: Callable[[str, Affine], Affine]) -> Program:
    """The program with every affine replaced by `change(path, affine)`."""

    def coordinate(path: str, old: Coordinate) -> Coordinate:
        if isinstance(old, Affine):
            return change(path, old)
        parts = {part: change(f"{path}.{part}", getattr(old, part)) for part in ("radius", "angle", "offset")}
        return dataclasses.replace(old, **parts)

    rebuilt: Statement | None = None
    for path, old in reversed(list(statements(program))):
        match old:
            case Draw(x=x, y=y):
                rebuilt = dataclasses.replace(old, x=coordinate(f"{path}.x", x), y=coordinate(f"{path}.y", y))
            case If(guard=guard):
                assert isinstance(rebuilt, If | Draw)
                rebuilt = dataclasses.replace(old, guard=change(path, guard), body=rebuilt)
            case For(start=start, stop=stop):
                assert rebuilt is not None
                rebuilt = dataclasses.replace(
                    old, start=change(f"{path}.start", start), stop=change(f"{path}.stop", stop), body=rebuilt
                )
    assert rebuilt is not None
    return dataclasses.replace(program, world=rebuilt)


def _coordinate_affines(path: str, coordinate: Coordinate) -> Iterator[tuple[str, Affine]]:
    match coordinate:
        case Affine():
            yield path, coordinate
        case Polar(radius=radius, angle=angle, offset=offset):
            yield f"{path}.radius", radius
            yield f"{path}.angle", angle
            yield f"{path}.offset", offset

"""From the heads of a program to the program: arguments, bounds and guards get their places in the tree."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from p3i.grammar.ast import (
    Affine,
    CameraPose,
    Coordinate,
    Draw,
    For,
    If,
    Polar,
    Program,
    Span,
    Statement,
    Variable,
)
from p3i.grammar.diagnostics import Diagnostic, error
from p3i.grammar.header import HeaderReading
from p3i.grammar.heads import Argument, CameraHead, DrawHead, ForHead, Head, IfHead, Picture
from p3i.grammar.normal import Blank, Broken, Circular, Linear, Slot, Value

UNFILLED = 1.0
"""What stands in a tree where the text has a hole, until sketch.py writes the value to start from."""


@dataclass(slots=True)
class Planting:
    """What grew so far: the holes by path, and the problems met."""

    holes: dict[str, Blank] = field(default_factory=dict[str, Blank])
    problems: list[Diagnostic] = field(default_factory=list[Diagnostic])

    def refuse(
        self, code: str, message: str, span: Span, *, help: str | None = None, label: str | None = None
    ) -> None:
        self.problems.append(error(code, message, span, help=help, label=label))

    def number(self, slot: Slot, path: str) -> float:
        """The number of a slot; a hole is noted under its path."""
        if isinstance(slot, Blank):
            self.holes[path] = slot
            return UNFILLED
        return slot

    def affine(self, value: Value, path: str, *, what: str) -> Affine:
        match value:
            case Linear():
                i, j, constant = (
                    self.number(slot, f"{path}.{part}")
                    for slot, part in ((value.i, "i"), (value.j, "j"), (value.constant, "1"))
                )
                return Affine(i, j, constant, span=value.span)
            case Circular():
                self.refuse("P110", f"{what} holds no Cos or Sin", value.span, help="write it as `a*i + b`")
            case Broken():
                self.problems.extend(value.diagnostics)
        return Affine(span=value.span)

    def coordinate(self, value: Value, path: str) -> Coordinate:
        if not isinstance(value, Circular):
            return self.affine(value, path, what="a coordinate")
        radius, angle, offset = (
            self.affine(part, f"{path}.{name}", what="a coordinate")
            for part, name in ((value.radius, "radius"), (value.angle, "angle"), (value.offset, "offset"))
        )
        return Polar(value.function, radius, angle, offset, span=value.span)


@dataclass(frozen=True, slots=True)
class Tree:
    """A program with the holes of its text by path; `program` is None where there are problems."""

    program: Program | None
    holes: dict[str, Blank]
    problems: tuple[Diagnostic, ...]


def plant(heads: Sequence[Head], reading: HeaderReading, *, end: int, whole: bool = True) -> Tree:
    """Make the program of its heads, which come in the order of the text. `end` is the text's length.

    `whole` is false where some heads could not be read, so that what is missing proves nothing.
    """
    planting = Planting()
    in_order = _in_order(heads, planting, end=end, whole=whole)
    comments = _comments_by_head(heads, reading)
    camera = CameraPose(comments=tuple(comments[0]))
    chain: list[Statement] = []
    guards = 0
    for place, head in enumerate(heads, start=1):
        own = tuple(comments[place])
        match head:
            case CameraHead():
                rx, ry = _camera_angles(head, planting)
                camera = CameraPose(rx, ry, span=head.span, comments=(*camera.comments, *own))
            case ForHead():
                chain.append(_for(head, planting, own))
            case IfHead():
                for guard in head.guards:
                    guards += 1
                    value = planting.affine(guard, f"if_{guards}", what="a guard")
                    chain.append(If(value, _NOTHING, span=head.span, comments=own))
                    own = ()
            case DrawHead():
                chain.append(_draw(head, planting, own))
    if planting.problems or not in_order:
        return Tree(None, planting.holes, tuple(planting.problems))
    program = Program(camera, _nested(chain), reading.header, trailing_comments=tuple(comments[-1]))
    return Tree(program, planting.holes, ())


_NOTHING = Draw(Affine(), Affine())
"""What a loop or guard holds until `_nested` puts the next statement into it."""


def _nested(chain: Sequence[Statement]) -> Statement:
    """The statements inside one another; `_in_order` made sure that they fit."""
    inner = chain[-1]
    for outer in reversed(chain[:-1]):
        match outer, inner:
            case For(), _:
                inner = replace(outer, body=inner)
            case If(), If() | Draw():
                inner = replace(outer, body=inner)
            case _:
                raise AssertionError("statements out of order")
    return inner


def _in_order(heads: Sequence[Head], planting: Planting, *, end: int, whole: bool) -> bool:
    """Whether the heads are a camera (or none), loops, guards and one draw, in this order."""
    before = len(planting.problems)
    nested = "a program is one camera, at most `for i` around `for j`, guards, and one Draw"
    draws = [place for place, head in enumerate(heads) if isinstance(head, DrawHead)]
    for place, head in enumerate(heads):
        match head:
            case CameraHead() if place > 0:
                message = "SetCameraPose comes first, and once"
                planting.refuse("P111", message, head.span, help="move it to the first line")
            case ForHead() | IfHead() | DrawHead() if draws and place > draws[0]:
                message = "a program has one statement after the camera, and it ends with its Draw"
                planting.refuse("P111", message, head.span, label="one statement too many", help=nested)
            case ForHead() if any(isinstance(earlier, IfHead) for earlier in heads[:place]):
                message = "`if` stands directly above `Draw` or another `if`"
                planting.refuse(
                    "P111",
                    message,
                    head.span,
                    label="a loop below an `if`",
                    help="move the `if` below the loops",
                )
            case _:
                pass
    if not draws and whole:
        span = heads[-1].span if heads else Span(end, end)
        message = "nothing is drawn: the program has no Draw" if heads else "the program is empty"
        planting.refuse("P111", message, span, help="write `Draw(x=10*i, y=10*j)` inside the loops")
    return whole and len(planting.problems) == before


def _comments_by_head(heads: Sequence[Head], reading: HeaderReading) -> list[list[str]]:
    """Comments before the first head, at each head, and after the last one: len(heads) + 2 lists.

    A comment belongs to the head that stands on its line or around it, else to the next one, so that their
    order stays when the printer puts each on a line above its statement.
    """
    groups: list[list[str]] = [[] for _ in range(len(heads) + 2)]
    begun = group = 0
    for comment in reading.comments:
        while begun < len(heads) and heads[begun].span.start < comment.span.start:
            begun += 1
        inside = begun > 0 and (comment.span.start < heads[begun - 1].span.end or not comment.alone)
        following = 0 if begun == 0 else begun if inside else begun + 1
        group = max(group, following)  # a comment beside a late `}` does not overtake those before it
        groups[group].append(comment.text)
    return groups


def _camera_angles(head: CameraHead, planting: Planting) -> tuple[float, float]:
    values = _named(
        head.arguments,
        {"rx": "rx", "pitch": "rx", "ry": "ry", "yaw": "ry"},
        head.span,
        planting,
        what="SetCameraPose",
    )
    angles: list[float] = []
    for name in ("rx", "ry"):
        value = values.get(name)
        match value:
            case None:
                angles.append(0.0)
            case Linear(i=0.0, j=0.0):
                angles.append(planting.number(value.constant, f"camera.{name}"))
            case Broken():
                planting.problems.extend(value.diagnostics)
                angles.append(0.0)
            case _:
                message = f"`{name}` of the camera is a number of degrees"
                planting.refuse("P106", message, value.span, help=f"write a number, as in `{name}=-30`")
                angles.append(0.0)
    return angles[0], angles[1]


def _for(head: ForHead, planting: Planting, comments: tuple[str, ...]) -> For:
    variable: Variable = "j" if head.variable == "j" else "i"
    if head.variable not in {"i", "j"}:
        message = f"a loop runs over `i` or `j`, not `{head.variable}`"
        help = "write `for i in range(0, n):` outside, `for j in range(0, n):` inside"
        planting.refuse("P107", message, head.variable_span, help=help)
    if len(head.bounds) > 2:
        message = "`range` takes a start and a stop, no step"
        help = "leave the step out and multiply in Draw: `2*i` walks in twos"
        planting.refuse("P108", message, head.bounds[2].span, help=help)
    start, stop = head.bounds[:2] if len(head.bounds) > 1 else (Linear(span=head.span), *head.bounds)
    what = f"a bound of `for {head.variable}`"
    return For(
        variable,
        planting.affine(start, f"for_{variable}.start", what=what),
        planting.affine(stop, f"for_{variable}.stop", what=what),
        _NOTHING,
        span=head.span,
        comments=comments,
    )


def _draw(head: DrawHead, planting: Planting, comments: tuple[str, ...]) -> Draw:
    arguments = list(head.arguments)
    picture: str | None = None
    if arguments and isinstance(arguments[0].value, Picture):
        written = arguments.pop(0).value
        assert isinstance(written, Picture)
        planting.problems.extend(written.diagnostics)
        picture = written.path or None
    values = _named(arguments, {"x": "x", "y": "y"}, head.span, planting, what="Draw")
    x, y = (
        planting.coordinate(values[name], f"draw.{name}") if name in values else Affine(span=head.span)
        for name in ("x", "y")
    )
    return Draw(x, y, picture, span=head.span, comments=comments)


def _named(
    arguments: Sequence[Argument], names: dict[str, str], span: Span, planting: Planting, *, what: str
) -> dict[str, Value]:
    """The values by canonical name; each must be given once, and by name."""
    wanted = list(dict.fromkeys(names.values()))
    example = f"write `{what}({', '.join(f'{name}=...' for name in wanted)})`"
    values: dict[str, Value] = {}
    for argument in arguments:
        name = names.get(argument.name) if argument.name is not None else None
        if isinstance(argument.value, Picture):
            message = "a picture is the first argument of Draw, and the only text in it"
            planting.refuse("P108", message, argument.span, help='write `Draw("mouse.png", x=..., y=...)`')
        elif argument.name is None:
            planting.refuse("P108", f"an argument of {what} has no name", argument.span, help=example)
        elif name is None:
            message = f"{what} has no argument `{argument.name}`"
            planting.refuse("P108", message, argument.span, help=example)
        elif name in values:
            other = f" (as `{argument.name}`)" if argument.name != name else ""
            planting.refuse("P108", f"`{name}` is given twice{other}", argument.span, help=example)
        else:
            values[name] = argument.value
    unnamed = any(argument.name not in names for argument in arguments)
    for name in wanted:
        if name not in values and not unnamed:
            planting.refuse("P108", f"{what} needs `{name}`", span, help=example)
    return values

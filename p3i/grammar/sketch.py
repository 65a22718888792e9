"""Sketches: programs with holes. In memory a template program and the paths of its holes, never a half tree.

A hole is written `??` (free), `??(10, 40)` (bounds), `?r` or `?r(10, 40)` (equal names are one number), or
`~18.7` (start here and refine). `360/?n*j` in an angle ties the step of a ring to its count.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from p3i.grammar.ast import Program, Span
from p3i.grammar.diagnostics import Diagnostic, error, in_order
from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.normal import Blank
from p3i.grammar.parser import Parsed, parse_with_holes
from p3i.grammar.printer import number_text, python_text


@dataclass(frozen=True, slots=True)
class Hole:
    """A number to be found, at a path of the template (grammar/leaves.py names the paths).

    `lower` and `upper` bound it, `start` is where to begin, `whole` says that it is a whole number; holes of
    one `name` are one number. The number at the path is the hole's, or `over` divided by it.
    """

    path: str
    name: str | None = None
    lower: float | None = None
    upper: float | None = None
    start: float | None = None
    whole: bool = False
    over: float | None = None
    span: Span | None = field(default=None, compare=False, repr=False)

    def leaf(self, value: float) -> float:
        """The number at the path when the hole holds `value`."""
        return value if self.over is None else self.over / value

    def first_value(self) -> float:
        """A value within the hole's bounds: its start, else the middle of the bounds, else 1."""
        if self.start is not None:
            return self.start
        if self.lower is None or self.upper is None:
            return 1.0
        middle = self.lower / 2 + self.upper / 2
        inside = float(round(middle)) if self.whole else middle
        return inside if self.over is None or inside != 0 else self.upper or self.lower or 1.0


@dataclass(frozen=True, slots=True)
class Sketch:
    """A program and its holes, in the order of the leaves. The template holds each hole's first value."""

    template: Program
    holes: tuple[Hole, ...]

    def fill(self, values: Mapping[str, float]) -> Program:
        """The program with every hole filled, `values` by path; a named hole may be given at one path only.

        Raises KeyError for a hole without a value.
        """
        by_name = {hole.name: values[hole.path] for hole in self.holes if hole.name and hole.path in values}
        filled: dict[str, float] = {}
        for hole in self.holes:
            value = by_name[hole.name] if hole.name and hole.name in by_name else values[hole.path]
            filled[hole.path] = hole.leaf(value)
        return with_leaves(self.template, filled)


def parse_sketch(source: str | bytes) -> Sketch | tuple[Diagnostic, ...]:
    """The sketch that `source` spells (a program is a sketch without holes), or all errors in it."""
    parsed = parse_with_holes(source)
    return parsed if isinstance(parsed, tuple) else sketch_of(parsed)


def sketch_of(parsed: Parsed) -> Sketch | tuple[Diagnostic, ...]:
    """The sketch of a text already read: its holes get bounds, starts and kinds, and are held to them."""
    order = [path for path in leaves(parsed.program) if path in parsed.holes]
    named: dict[str, list[str]] = {}
    for path in order:
        name = parsed.holes[path].name
        if name is not None:
            named.setdefault(name, []).append(path)
    holes: list[Hole] = []
    problems: list[Diagnostic] = []
    for path in order:
        blank = parsed.holes[path]
        family = named[blank.name] if blank.name is not None else [path]
        first = next(
            (parsed.holes[other] for other in family if parsed.holes[other].lower is not None), blank
        )
        whole = any(_stands_in_bound(other) or parsed.holes[other].over is not None for other in family)
        hole = Hole(path, blank.name, first.lower, first.upper, blank.start, whole, blank.over, blank.span)
        problems += _problems(hole, blank, first)
        holes.append(hole)
    if problems:
        return in_order(problems)
    return Sketch(template(parsed.program, holes), tuple(holes))


def template(program: Program, holes: Iterable[Hole]) -> Program:
    """The program with each hole's first value at its path."""
    return with_leaves(program, {hole.path: hole.leaf(hole.first_value()) for hole in holes})


def format_sketch(sketch: Sketch) -> str:
    """The canonical text of a sketch; bounds of a named hole stand where the name comes first."""
    seen: set[str] = set()
    texts: dict[str, str] = {}
    for hole in sketch.holes:
        texts[hole.path] = _hole_text(hole, bounded=hole.name not in seen)
        if hole.name is not None:
            seen.add(hole.name)
    return python_text(sketch.template, texts)


def _stands_in_bound(path: str) -> bool:
    return path.startswith("for_")


def _problems(hole: Hole, blank: Blank, first: Blank) -> Sequence[Diagnostic]:
    found: list[Diagnostic] = []
    if blank.lower is not None and (blank.lower, blank.upper) != (first.lower, first.upper):
        message = f"`?{hole.name}` has other bounds elsewhere: equal names are one number"
        found.append(error("P117", message, blank.span, help="write the bounds once"))
    if hole.over is not None and ".angle." not in hole.path:
        message = "a number divided by a hole stands in an angle only"
        found.append(error("P117", message, blank.span, help="write the hole itself"))
    bounds = [bound for bound in (blank.lower, blank.upper, blank.start) if bound is not None]
    if hole.whole and any(bound != int(bound) for bound in bounds):
        message = "a hole in a bound is a whole number, and so are its limits"
        found.append(error("P117", message, blank.span, help="write whole numbers, as in `?n(4, 24)`"))
    if hole.over is not None and not _divides(hole):
        message = "a number is divided by this hole, which may be zero, or too close to it"
        found.append(error("P117", message, blank.span, help="let its bounds begin at 1"))
    return found


def _divides(hole: Hole) -> bool:
    """Whether a number can be divided by whatever the hole may hold."""
    if hole.start == 0 or (hole.lower is not None and hole.lower <= 0):
        return False
    return math.isfinite(hole.leaf(hole.first_value()))


def _hole_text(hole: Hole, *, bounded: bool) -> str:
    if hole.start is not None:
        text = f"~{number_text(hole.start)}"
    else:
        text = f"?{hole.name}" if hole.name is not None else "??"
        if bounded and hole.lower is not None and hole.upper is not None:
            text += f"({number_text(hole.lower)}, {number_text(hole.upper)})"
    return text if hole.over is None else f"{number_text(hole.over)}/{text}"

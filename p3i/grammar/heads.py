"""From the rules of p3p.lark to the heads of a program: camera, loops, guards and draw, one after another.

A program is a chain (each statement holds exactly one), so its heads in order say everything. The reader
here gives every expression its value (normal.py); tree.py makes the program of the heads.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lark import Token, Transformer

from p3i.grammar.ast import Function, Span, is_path
from p3i.grammar.diagnostics import Diagnostic, error
from p3i.grammar.normal import (
    Blank,
    Broken,
    Circular,
    Linear,
    Operator,
    Value,
    call,
    combine,
    negate,
    number,
    respan,
)


@dataclass(frozen=True, slots=True)
class Picture:
    """The text of a `Draw`'s first argument, or what is wrong with it."""

    path: str
    span: Span
    diagnostics: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of `SetCameraPose` or `Draw`; `name` is None where it was given by position."""

    name: str | None
    value: Value | Picture
    span: Span


@dataclass(frozen=True, slots=True)
class CameraHead:
    """`SetCameraPose(...)`."""

    arguments: tuple[Argument, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class ForHead:
    """`for variable in range(bounds)`."""

    variable: str
    variable_span: Span
    bounds: tuple[Value, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class IfHead:
    """One `if`; each of its guards, joined by `and`, holds where the value is >= 0."""

    guards: tuple[Value, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class DrawHead:
    """`Draw(...)`."""

    arguments: tuple[Argument, ...]
    span: Span


Head = CameraHead | ForHead | IfHead | DrawHead


def span_of(token: Token) -> Span:
    """The place of a token."""
    start = token.start_pos or 0
    return Span(start, start + len(token))


class HeadReader(Transformer[Token, Any]):
    """The callbacks of p3p.lark's rules; lark calls them bottom up while it parses, without recursion."""

    def program(self, children: list[Head]) -> tuple[Head, ...]:
        return tuple(children)

    def camera(self, children: list[Any]) -> CameraHead:
        word, *arguments, close = children
        return CameraHead(tuple(arguments), _between(word, close))

    def for_head(self, children: list[Any]) -> ForHead:
        word, variable, _, _, bounds, close = children
        return ForHead(str(variable), span_of(variable), bounds, _between(word, close))

    def bounds(self, children: list[Value]) -> tuple[Value, ...]:
        return tuple(children)

    def if_head(self, children: list[Any]) -> IfHead:
        word, *_ = children
        guards = _guards(children[1:])
        return IfHead(guards, Span(span_of(word).start, guards[-1].span.end))

    def conjunction(self, children: list[Any]) -> tuple[Value, ...]:
        return _guards(children[1:-1])

    def comparison(self, children: list[Any]) -> tuple[Value, ...]:
        left, sign, right = children
        smaller, larger = (right, left) if sign.type == "GE" else (left, right)
        guard = combine(larger, "-", smaller)
        if isinstance(guard, Circular):
            message = "a guard holds no Cos or Sin"
            guard = Broken((error("P110", message, Span(left.span.start, right.span.end), help=GUARD_HELP),))
        return (_respan(guard, Span(left.span.start, right.span.end)),)

    def draw(self, children: list[Any]) -> DrawHead:
        word, *arguments, close = children
        return DrawHead(tuple(arguments), _between(word, close))

    def named(self, children: list[Any]) -> Argument:
        name, value = children
        return Argument(str(name), value, Span(span_of(name).start, value.span.end))

    def positional(self, children: list[Value]) -> Argument:
        return Argument(None, children[0], children[0].span)

    def picture(self, children: list[Token]) -> Argument:
        written = _picture(children[0])
        return Argument(None, written, written.span)

    def expr(self, children: list[Any]) -> Value:
        return _left_to_right(children)

    def term(self, children: list[Any]) -> Value:
        return _left_to_right(children)

    def unary(self, children: list[Any]) -> Value:
        *signs, value = children
        span = Span(span_of(signs[0]).start, value.span.end)
        minus = sum(sign.type == "MINUS" for sign in signs) % 2 == 1
        return negate(value, span) if minus else _respan(value, span)

    def number(self, children: list[Token]) -> Value:
        return number(str(children[0]), span_of(children[0]))

    def variable(self, children: list[Token]) -> Value:
        name, span = str(children[0]), span_of(children[0])
        if name == "i":
            return Linear(i=1.0, span=span)
        if name == "j":
            return Linear(j=1.0, span=span)
        return Broken(
            (error("P107", f"`{name}` is not a name of the language", span, help=_name_help(name)),), span
        )

    def call(self, children: list[Any]) -> Value:
        word, angle, close = children
        function: Function = "Cos" if word.type == "COS" else "Sin"
        return call(function, angle, _between(word, close))

    def parentheses(self, children: list[Any]) -> Value:
        opening, value, close = children
        return _respan(value, _between(opening, close))

    def hole(self, children: list[Any]) -> Value:
        word, *bounds = children
        name = str(word)[1:] if str(word) != "??" else None
        if not bounds:
            return Linear(constant=Blank(name, span=span_of(word)), span=span_of(word))
        lower, upper, close = bounds
        span = _between(word, close)
        ends: list[float] = []
        for bound in (lower, upper):
            match bound:
                case Linear(i=0.0, j=0.0, constant=float(end)):
                    ends.append(end)
                case Broken():
                    return bound
                case _:
                    message = "the bounds of a hole are two numbers"
                    return Broken((error("P117", message, bound.span, help="write `??(10, 40)`"),), span)
        if ends[0] > ends[1]:
            message = "the lower bound of a hole is above its upper bound"
            return Broken((error("P117", message, span, help="write the smaller number first"),), span)
        return Linear(constant=Blank(name, ends[0], ends[1], span=span), span=span)

    def start(self, children: list[Token]) -> Value:
        span = _between(children[0], children[-1])
        value = number(str(children[-1]), span)
        if isinstance(value, Broken):
            return value
        assert isinstance(value, Linear) and isinstance(value.constant, float)
        sign = -1.0 if children[1].type == "MINUS" else 1.0
        return Linear(constant=Blank(start=sign * value.constant + 0.0, span=span), span=span)


GUARD_HELP = "a guard is `a*i + b*j >= c` or `a*i + b*j <= c`"


def _between(first: Token, last: Token) -> Span:
    return Span(span_of(first).start, span_of(last).end)


def _respan(value: Value, span: Span) -> Value:
    return Broken(value.diagnostics, span) if isinstance(value, Broken) else respan(value, span)


def _left_to_right(children: Sequence[Any]) -> Value:
    """`a - b + c` and the like: values with operators between them."""
    value: Value = children[0]
    for operator, operand in zip(children[1::2], children[2::2], strict=True):
        sign: Operator = operator.value
        value = combine(value, sign, operand)
    return value


def _guards(children: Sequence[Any]) -> tuple[Value, ...]:
    """The guards of conditions joined by `and` tokens."""
    found: list[Value] = []
    for child in children:
        if not isinstance(child, Token):
            found.extend(child)
    return tuple(found)


_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "\\": "\\", '"': '"', "'": "'", "/": "/"}
_ESCAPE = re.compile(r"\\(u[0-9A-Fa-f]{4}|.)", re.DOTALL)


def _picture(token: Token) -> Picture:
    span = span_of(token)
    written = str(token)[1:-1]
    unknown = [found for found in _ESCAPE.findall(written) if len(found) == 1 and found not in _ESCAPES]
    if unknown:
        message = f"a picture path has no escape `\\{unknown[0]}`"
        return Picture("", span, (error("P115", message, span, help="write `/` between folders, or `\\\\`"),))
    path = _ESCAPE.sub(
        lambda found: _ESCAPES[found[1]] if len(found[1]) == 1 else chr(int(found[1][1:], 16)), written
    )
    if not is_path(path):
        message = "a picture path is empty or holds a character that no path can have"
        return Picture("", span, (error("P115", message, span, help='write a path such as "mouse.png"'),))
    return Picture(path, span)


def _name_help(name: str) -> str:
    if name in {"I", "J"}:
        return f"write `{name.lower()}`: the loop variables are lower case"
    if name.lower() in {"pi", "math", "radians", "degrees", "np"}:
        return "angles are in degrees: a full turn is 360"
    if name.lower() in {"cos", "sin"}:
        return f"write `{name.capitalize()}(...)` with its angle in parentheses"
    return "the names in an expression are `i`, `j`, `Cos(...)` and `Sin(...)`"

"""Arithmetic on the normal form: what the reader computes with while it reads an expression.

A value is `Linear` (a*i + b*j + c), `Circular` (radius * Cos(angle) + offset) or `Broken`, which carries what
was found wrong and swallows whatever it meets, so that one slip is reported once. A coefficient may be a
`Blank`, the hole of a sketch, which is never folded into another number.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from p3i.grammar.ast import Function, Span
from p3i.grammar.diagnostics import Diagnostic, error

AFFINE_HELP = (
    "write `a*i + b*j + c`, or `radius*Cos(angle) + offset` with radius, angle and offset of that form"
)
Operator = Literal["+", "-", "*", "/"]


@dataclass(frozen=True, slots=True)
class Blank:
    """A hole as written: `??`, `?name`, both with bounds, or `~start`; `over / hole` if `over` is given."""

    name: str | None = None
    lower: float | None = None
    upper: float | None = None
    start: float | None = None
    over: float | None = None
    span: Span = field(default=Span(0, 0), compare=False)


Slot = float | Blank


@dataclass(frozen=True, slots=True)
class Linear:
    """`i*i + j*j + constant`, each coefficient a number or a hole."""

    i: Slot = 0.0
    j: Slot = 0.0
    constant: Slot = 0.0
    span: Span = field(default=Span(0, 0), compare=False)


@dataclass(frozen=True, slots=True)
class Circular:
    """`radius * function(angle) + offset`."""

    function: Function
    radius: Linear
    angle: Linear
    offset: Linear
    span: Span = field(default=Span(0, 0), compare=False)


@dataclass(frozen=True, slots=True)
class Broken:
    """An expression with no meaning, and why."""

    diagnostics: tuple[Diagnostic, ...]
    span: Span = field(default=Span(0, 0), compare=False)


Value = Linear | Circular | Broken


class _RefusedError(Exception):
    """Leaves the arithmetic below at once; never leaves this module."""

    def __init__(self, code: str, message: str, help: str = AFFINE_HELP) -> None:
        super().__init__(code, message, help)
        self.code, self.message, self.help = code, message, help


def number(text: str, span: Span) -> Value:
    """The value of a numeral; numerals beyond the range of a double are refused."""
    value = float(text)
    if not math.isfinite(value):
        return Broken(
            (error("P109", "a number is too large", span, help="numbers reach up to 1.7e308"),), span
        )
    return Linear(constant=value, span=span)


def combine(left: Value, operator: Operator, right: Value) -> Value:
    """`left operator right`, or the reasons why there is no such value."""
    span = Span(left.span.start, right.span.end)
    if isinstance(left, Broken) or isinstance(right, Broken):
        reasons = tuple(
            found for side in (left, right) if isinstance(side, Broken) for found in side.diagnostics
        )
        return Broken(reasons, span)
    operations: dict[Operator, Callable[[Linear | Circular, Linear | Circular], Linear | Circular]] = {
        "+": _add,
        "-": lambda a, b: _add(a, _scale(b, -1.0)),
        "*": _multiply,
        "/": _divide,
    }
    return _guarded(lambda: operations[operator](left, right), span)


def negate(value: Value, span: Span) -> Value:
    """`-value`."""
    return value if isinstance(value, Broken) else _guarded(lambda: _scale(value, -1.0), span)


def call(function: Function, angle: Value, span: Span) -> Value:
    """`Cos(angle)` or `Sin(angle)`, the angle in degrees."""
    match angle:
        case Broken():
            return angle
        case Circular():
            message = "the angle of Cos or Sin holds no Cos or Sin"
            return Broken((error("P110", message, angle.span, help=AFFINE_HELP),), span)
        case Linear():
            return Circular(function, Linear(constant=1.0, span=span), angle, Linear(span=span), span)


def _guarded(compute: Callable[[], Linear | Circular], span: Span) -> Value:
    try:
        return respan(compute(), span)
    except _RefusedError as refused:
        return Broken((error(refused.code, refused.message, span, help=refused.help),), span)


def respan(value: Linear | Circular, span: Span) -> Linear | Circular:
    """The value at another place; the angle of a ring keeps its own."""
    if isinstance(value, Linear):
        return dataclasses.replace(value, span=span)
    radius, offset = (dataclasses.replace(part, span=span) for part in (value.radius, value.offset))
    return dataclasses.replace(value, radius=radius, offset=offset, span=span)


def _add(left: Linear | Circular, right: Linear | Circular) -> Linear | Circular:
    match left, right:
        case Linear(), Linear():
            return Linear(
                _slot_sum(left.i, right.i),
                _slot_sum(left.j, right.j),
                _slot_sum(left.constant, right.constant),
            )
        case Circular(), Linear():
            return dataclasses.replace(left, offset=_linear(_add(left.offset, right)))
        case Linear(), Circular():
            return dataclasses.replace(right, offset=_linear(_add(left, right.offset)))
        case Circular(), Circular():
            if left.function != right.function or left.angle != right.angle:
                raise _RefusedError(
                    "P110", "Cos and Sin of different angles cannot be added in one coordinate"
                )
            return dataclasses.replace(
                left,
                radius=_linear(_add(left.radius, right.radius)),
                offset=_linear(_add(left.offset, right.offset)),
            )


def _scale(value: Linear | Circular, factor: float) -> Linear | Circular:
    return _each_slot(value, lambda slot: _slot_product(slot, factor))


def _multiply(left: Linear | Circular, right: Linear | Circular) -> Linear | Circular:
    match left, right:
        case Linear(), Linear():
            return _product(left, right)
        case Linear(), Circular():
            return _swell(right, left)
        case Circular(), Linear():
            return _swell(left, right)
        case Circular(), Circular():
            raise _RefusedError(
                "P110", "a product of two Cos or Sin is not of the form `radius*Cos(angle) + offset`"
            )


def _product(left: Linear, right: Linear) -> Linear:
    for factor, other in ((left, right), (right, left)):
        if _is_constant(factor):
            if not isinstance(factor.constant, Blank):
                return _linear(_scale(other, factor.constant))
            if _is_unit(other):
                return _placed(factor.constant, other)
    if _has_blank(left) or _has_blank(right):
        raise _folded()
    raise _RefusedError("P106", "a product of loop variables is not affine")


def _placed(hole: Blank, unit: Linear) -> Linear:
    """The hole as the coefficient of `i`, `j` or `1`."""
    return _linear(_each_slot(unit, lambda slot: hole if slot == 1.0 else 0.0))


def _swell(ring: Circular, factor: Linear) -> Circular:
    """`factor * ring`: the radius and the offset grow, the angle stays."""
    offset = ring.offset if ring.offset == Linear() else _product(factor, ring.offset)
    return dataclasses.replace(ring, radius=_product(factor, ring.radius), offset=offset)


def _divide(left: Linear | Circular, right: Linear | Circular) -> Linear | Circular:
    if isinstance(right, Circular) or not _is_constant(right):
        raise _RefusedError("P106", "only a number can stand below `/`")
    divisor = right.constant
    if not isinstance(divisor, Blank):
        if divisor == 0:
            raise _RefusedError("P109", "division by zero", "write a number other than 0 below `/`")
        return _each_slot(left, lambda slot: _slot_quotient(slot, divisor))
    slots = (left.i, left.j, left.constant) if isinstance(left, Linear) else ()
    numbers = [slot for slot in slots if slot != 0.0]
    if len(numbers) != 1 or isinstance(numbers[0], Blank) or divisor.over is not None:
        raise _folded()
    quotient = dataclasses.replace(divisor, over=numbers[0])
    return _each_slot(left, lambda slot: 0.0 if slot == 0.0 else quotient)


def _each_slot(value: Linear | Circular, change: Callable[[Slot], Slot]) -> Linear | Circular:
    if isinstance(value, Linear):
        return Linear(change(value.i), change(value.j), change(value.constant))
    return dataclasses.replace(
        value,
        radius=_linear(_each_slot(value.radius, change)),
        offset=_linear(_each_slot(value.offset, change)),
    )


def _slot_sum(left: Slot, right: Slot) -> Slot:
    if not isinstance(left, Blank) and not isinstance(right, Blank):
        return _finite(left + right)
    if left == 0.0:
        return right
    if right == 0.0:
        return left
    raise _folded()


def _slot_product(slot: Slot, factor: float) -> Slot:
    if not isinstance(slot, Blank):
        return _finite(slot * factor)
    if factor == 1.0:
        return slot
    if slot.over is not None:
        return dataclasses.replace(slot, over=_finite(slot.over * factor)) if factor != 0 else _refuse_fold()
    if factor == -1.0 and slot.name is None:
        lower, upper, start = (
            None if bound is None else 0.0 - bound for bound in (slot.upper, slot.lower, slot.start)
        )
        return dataclasses.replace(slot, lower=lower, upper=upper, start=start)
    return _refuse_fold()


def _slot_quotient(slot: Slot, divisor: float) -> Slot:
    if not isinstance(slot, Blank):
        return _finite(slot / divisor)
    return slot if divisor == 1.0 else _refuse_fold()


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise _RefusedError(
            "P109", "the value of this expression is too large", "numbers reach up to 1.7e308"
        )
    return value + 0.0


def _folded() -> _RefusedError:
    return _RefusedError(
        "P117",
        "a hole is a whole coefficient, constant or bound: it cannot be computed with",
        "write it as `??*i`, `?r*Cos(...)`, `+ ??`, or `360/?n*j` in an angle",
    )


def _refuse_fold() -> Slot:
    raise _folded()


def _linear(value: Linear | Circular) -> Linear:
    assert isinstance(value, Linear)
    return value


def _is_constant(value: Linear) -> bool:
    return value.i == 0.0 and value.j == 0.0


def _is_unit(value: Linear) -> bool:
    """Whether the value is exactly `i`, `j` or `1`."""
    return [slot for slot in (value.i, value.j, value.constant) if slot != 0.0] == [1.0]


def _has_blank(value: Linear) -> bool:
    return any(isinstance(slot, Blank) for slot in (value.i, value.j, value.constant))

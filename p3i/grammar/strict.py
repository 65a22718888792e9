"""Strict mode: Table 1 to the letter (table1.lark), and the first word that is spelt otherwise."""

import re
from typing import Any

from lark import Token, Transformer

from p3i.grammar import reader
from p3i.grammar.ast import Affine, CameraPose, Draw, For, If, Polar, Program, Span, Variable
from p3i.grammar.departures import PRODUCTIONS, departures
from p3i.grammar.diagnostics import Diagnostic, error
from p3i.grammar.heads import span_of
from p3i.grammar.leaves import statements
from p3i.grammar.reader import Stopped


def strict_problems(text: str, program: Program) -> tuple[Diagnostic, ...]:
    """Why `text`, which spells `program` in the superset, is no string of Table 1; empty where it is one.

    Where the program itself leaves the table, every such place is named (P301); else the first word that is
    not spelt as the table spells it (P302).
    """
    outcome = read_strictly(text)
    if isinstance(outcome, Program):
        return ()
    return departures(program) or (_misspelt(outcome, text, program),)


def read_strictly(text: str) -> Program | Stopped:
    """The program that `text` spells by table1.lark alone, without spans and comments, or what stopped it.

    Raises ValueError for a numeral beyond the range of a double, which the superset's reader refuses first.
    """
    return reader.read_table1(text, _TableReader())


def _misspelt(problem: Stopped, text: str, program: Program) -> Diagnostic:
    """The first word that Table 1 spells otherwise."""
    span = span_of(problem.token)
    if problem.token.type == "$END":
        span = Span(len(text.rstrip()), len(text.rstrip()) + 1)
    elif word := re.compile(r"\w+").match(text, span.start):
        span = Span(*word.span())
    production = _production_at(program, span.start)
    before = _production_at(program, len(text[: span.start].rstrip()) - 1)
    if before in {"Expr", "RExprX", "RExprY"} and production not in {"Expr", "RExprX", "RExprY"}:
        production = before  # an expression that ends too early
    message = f"this is not spelt as in Table 1: `{PRODUCTIONS[production]}`"
    help = "`p3i fmt --layout table1` writes it so"
    return error("P302", message, span, label=f"in `{production}`", help=help)


def _production_at(program: Program, offset: int) -> str:
    """The production whose text holds the offset."""

    def holds(span: Span | None) -> bool:
        return span is not None and span.start <= offset < span.end

    ring = False
    for _, statement in statements(program):
        ring = isinstance(statement, Draw) and isinstance(statement.x, Polar)
    if holds(program.camera.span):
        return "CameraProgram"
    for _, statement in statements(program):
        match statement:
            case For(variable=variable) if holds(statement.span):
                return "For1Stmt" if variable == "i" else "Rotate2Stmt" if ring else "For2Stmt"
            case If(guard=guard) if holds(statement.span):
                return (
                    "Expr"
                    if holds(guard.span) and offset < (guard.span or Span(0, 0)).end - 1
                    else "CondDrawStmt"
                )
            case Draw(x=x, y=y) if holds(statement.span):
                if holds(x.span):
                    return "RExprX" if ring else "Expr"
                if holds(y.span):
                    return "RExprY" if ring else "Expr"
                return "RotateDrawStmt" if ring else "DrawStmt"
            case _:
                pass
    return "Program"


class _TableReader(Transformer[Token, Any]):
    """The callbacks of table1.lark's rules: a second reader, apart from the superset's."""

    def program(self, children: list[Any]) -> Program:
        camera, world = children
        return Program(camera, world)

    def camera_program(self, children: list[Any]) -> CameraPose:
        _, _, rx, _, ry = children
        return CameraPose(rx, ry)

    def for1_stmt(self, children: list[Any]) -> For:
        return self._loop("i", children)

    def for2_stmt(self, children: list[Any]) -> For:
        return self._loop("j", children)

    def rotate2_stmt(self, children: list[Any]) -> For:
        return self._loop("j", children)

    def _loop(self, variable: Variable, children: list[Any]) -> For:
        *_, start, stop, body = children
        first, last = (
            bound if isinstance(bound, Affine) else Affine(constant=bound) for bound in (start, stop)
        )
        return For(variable, first, last, body)

    def cond_stmt(self, children: list[Any]) -> If:
        _, guard, _, _, body = children
        return If(guard, body)

    def draw_stmt(self, children: list[Any]) -> Draw:
        _, _, x, _, y = children
        return Draw(x, y)

    def rotate_draw_stmt(self, children: list[Any]) -> Draw:
        return self.draw_stmt(children)

    def expr(self, children: list[Any]) -> Affine:
        i, _, j, _ = children
        return Affine(i, j)

    def expr_i(self, children: list[Any]) -> Affine:
        return Affine(children[0])

    def rexpr_x(self, children: list[Any]) -> Polar:
        return self._ring("Cos", children)

    def rexpr_y(self, children: list[Any]) -> Polar:
        return self._ring("Sin", children)

    def _ring(self, function: Any, children: list[Any]) -> Polar:
        radius, _, step, _, *grown, offset = children
        swell = Affine(i=radius) if grown else Affine(constant=radius)
        return Polar(function, swell, Affine(j=step), Affine(constant=offset))

    def real(self, children: list[Token]) -> float:
        return float(children[0])

    def integer(self, children: list[Token]) -> float:
        return float(children[0])

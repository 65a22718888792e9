"""Table 1 as a check on the tree: where and how a program, however it is spelt, leaves it."""

from collections.abc import Iterator

from p3i.grammar.ast import Affine, Coordinate, Draw, For, If, Polar, Program, Span
from p3i.grammar.diagnostics import Diagnostic, error, in_order
from p3i.grammar.leaves import statements

PRODUCTIONS = {
    "Program": "Program -> CameraProgram; WorldProgram",
    "CameraProgram": "CameraProgram -> SetCameraPose(rx=Real, ry=Real)",
    "WorldProgram": "WorldProgram -> For1Stmt | Rotate2Stmt",
    "For1Stmt": "For1Stmt -> For (i in range(Integer, Integer)) { For2Stmt | Rotate2Stmt }",
    "For2Stmt": "For2Stmt -> For (j in range(Integer, Integer)) { CondDrawStmt }",
    "Rotate2Stmt": "Rotate2Stmt -> For (j in range(ExprI, ExprI)) { RotateDrawStmt }",
    "CondDrawStmt": "CondDrawStmt -> If (Expr >= 0) { CondDrawStmt } | DrawStmt",
    "DrawStmt": "DrawStmt -> Draw(x=Expr, y=Expr)",
    "RotateDrawStmt": "RotateDrawStmt -> Draw(x=RExprX, y=RExprY)",
    "Expr": "Expr -> Real * i + Real * j",
    "ExprI": "ExprI -> Real * i",
    "RExprX": "RExprX -> Real * Cos(Real * j) * i + Real | Real * Cos(Real * j) + Real",
    "RExprY": "RExprY -> Real * Sin(Real * j) * i + Real | Real * Sin(Real * j) + Real",
}
"""Table 1, as messages quote it."""


def departures(program: Program) -> tuple[Diagnostic, ...]:
    """Every place where the program, however spelt, lies outside Table 1, with the production it leaves."""
    return in_order(_departures(program))


def _departures(program: Program) -> Iterator[Diagnostic]:
    chain = [statement for _, statement in statements(program)]
    loops = [statement for statement in chain if isinstance(statement, For)]
    guards = [statement for statement in chain if isinstance(statement, If)]
    draw = chain[-1]
    assert isinstance(draw, Draw)
    ring = isinstance(draw.x, Polar) or isinstance(draw.y, Polar)
    variables = [loop.variable for loop in loops]
    if variables != ["i", "j"] and not (ring and variables == ["j"]):
        help = "Table 1 has two loops, `For (i ...)` around `For (j ...)`, or one `For (j ...)` around a ring"
        yield _leaves("WorldProgram", (loops[0] if loops else draw).span, help=help)
    for loop in loops:
        for bound in (loop.start, loop.stop):
            if loop.variable == "j" and ring:
                if bound.constant != 0 or bound.j != 0:
                    yield _leaves("Rotate2Stmt", bound.span, help="write the bounds of a ring as `6 * i`")
            elif (bound.i, bound.j) != (0, 0) or bound.constant != int(bound.constant):
                production = "For1Stmt" if loop.variable == "i" else "For2Stmt"
                yield _leaves(production, bound.span, help="write a whole number")
    for statement in guards:
        if ring:
            yield _leaves("Rotate2Stmt", statement.span, help="a ring of Table 1 has no `If`")
        elif statement.guard.constant != 0:
            help = "a guard of Table 1 has no constant: shift the ranges so that it becomes 0"
            yield _leaves("CondDrawStmt", statement.guard.span, help=help)
    if draw.picture is not None:
        yield _leaves("DrawStmt", draw.span, help="leave the picture out")
    for name, coordinate in (("x", draw.x), ("y", draw.y)):
        yield from _coordinate_departures(name, coordinate, ring=ring)


def _coordinate_departures(name: str, coordinate: Coordinate, *, ring: bool) -> Iterator[Diagnostic]:
    if isinstance(coordinate, Affine):
        if ring:
            yield _leaves(f"RExpr{name.upper()}", coordinate.span, help="a ring has Cos in x and Sin in y")
        elif coordinate.constant != 0:
            yield _leaves("Expr", coordinate.span, help="a coordinate of Table 1 has no constant")
        return
    production = f"RExpr{name.upper()}"
    radius, angle, offset = coordinate.radius, coordinate.angle, coordinate.offset
    if coordinate.function != {"x": "Cos", "y": "Sin"}[name]:
        yield _leaves(production, coordinate.span, help="a ring has Cos in x and Sin in y")
    if radius.j != 0 or (radius.i != 0 and radius.constant != 0):
        yield _leaves(production, radius.span, help="the radius is `Real` or `Real * i`, not a sum")
    if angle.i != 0 or angle.constant != 0:
        yield _leaves(production, angle.span, help="the angle is `Real * j`")
    if offset.i != 0 or offset.j != 0:
        yield _leaves(production, offset.span, help="the middle of a ring is one number")


def _leaves(production: str, span: Span | None, *, help: str) -> Diagnostic:
    message = f"this leaves Table 1 at `{production}`: `{PRODUCTIONS[production]}`"
    return error("P301", message, span, label=f"outside `{production}`", help=help)

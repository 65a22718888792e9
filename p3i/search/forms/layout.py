"""A lattice with its objects: index ranges and guards, and the program that draws them."""

from dataclasses import dataclass

from p3i.grammar.ast import Affine, CameraPose, Draw, For, If, Program
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.lattice import Lattice
from p3i.search.result import Reading


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """A lattice with its objects: half-open index ranges and guards (a, b, c) for a*i + b*j >= c.

    `readings` are the places of the cell that may be its object, the likeliest first.
    """

    lattice: Lattice
    i_range: tuple[int, int]
    j_range: tuple[int, int]
    guards: tuple[tuple[int, int, int], ...] = ()
    readings: tuple[Reading, ...] = ()

    def program(self, *, from_zero: bool = True) -> Program:
        """The program, with both loops starting at 0, or else at the first index of each range.

        Where the origin is 0, the latter needs no constants in `Draw` and guards, of which Table 1 has none.
        """
        (i0, i1), (j0, j1) = self.i_range, self.j_range
        i_start, j_start = (0, 0) if from_zero else (i0, j0)
        i_skip, j_skip = i0 - i_start, j0 - j_start
        u, v = self.lattice.basis
        origin = self.lattice.origin + i_skip * u + j_skip * v

        def length(value: float) -> float:
            return round(float(value), LENGTH_DIGITS)

        body: Draw | If = Draw(
            Affine(length(u[0]), length(v[0]), length(origin[0])),
            Affine(length(u[1]), length(v[1]), length(origin[1])),
        )
        for a, b, c in reversed(self.guards):
            body = If(Affine(a, b, a * i_skip + b * j_skip - c), body)
        inner = For("j", Affine(constant=j_start), Affine(constant=j1 - j_skip), body)
        pose = CameraPose(round(self.lattice.rx_deg, ANGLE_DIGITS), round(self.lattice.ry_deg, ANGLE_DIGITS))
        return Program(pose, For("i", Affine(constant=i_start), Affine(constant=i1 - i_skip), inner))

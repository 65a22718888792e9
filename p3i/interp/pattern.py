"""A compiled program: a function from its numbers to the points that it draws.

The loops and guards of a program are discrete. Once they are walked, what is left is a table of live
indices (i, j) and a closed form for x and y whose numbers theta may move freely:

    centre(i, j) = x(i, j; theta), y(i, j; theta)      each   a*i + b*j + c
                                                         or   radius * Cos(angle) + offset, all three affine

Convention (one alphabet for all shapes): N centres, E edges, P numbers in theta. Coordinates are program
units, x right and y down; angles are degrees. theta may carry any leading dimensions; nothing is written in
place and nothing branches on a value, so torch.func.vmap and jacfwd go through.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.grammar.ast import Affine, Coordinate, Polar, Program
from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.camera import Camera, image_from_plane, project
from p3i.interp.unroll import distinct, edges, nest
from p3i.size import Size


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """A program's generator.

    `paths` [P] names each number of theta (`camera.rx`, `camera.ry`, `draw.x.i`, ...: see grammar/leaves.py);
    `theta` [P] float64 holds the program's own values; `index` [N, 2] int64 the live (i, j) in the order of
    the loops; `edges` [E, 2] int64 the neighbours of equation 2, as positions in `index`. `upright`: what is
    drawn on a curve keeps its direction, as the gondolas of a wheel do, and does not turn with the curve;
    that is nothing that a program says, but how a photo is read by it.
    """

    program: Program
    paths: tuple[str, ...]
    theta: Tensor
    index: Tensor
    edges: Tensor
    upright: bool = False

    @property
    def turning(self) -> int | None:
        """The loop variable that goes round a curve, 0 for i and 1 for j; None where draws stand in rows."""
        draw = nest(self.program).draw
        for form in (draw.x, draw.y):
            if isinstance(form, Polar):
                return 1 if form.angle.j != 0 else 0
        return None

    @property
    def turns(self) -> bool:
        """Whether what is drawn turns with a curve."""
        return self.turning is not None and not self.upright

    def centers(self, theta: Tensor | None = None) -> Tensor:
        """The drawn points: theta [..., P] -> [..., N, 2], in program units."""
        return self.points_at(self.index, theta)

    def points_at(self, index: Tensor, theta: Tensor | None = None) -> Tensor:
        """The points of any (i, j), also of fractions: index [M, 2], theta [..., P] -> [..., M, 2]."""
        theta = self.theta if theta is None else theta
        index = index.to(theta)
        basis = torch.cat([index, torch.ones_like(index[:, :1])], dim=1)  # (i, j, 1), one row a point

        def affine(path: str) -> Tensor:
            first = self.paths.index(f"{path}.i")  # the three numbers of an affine stand together: i, j, 1
            return theta[..., first : first + 3] @ basis.T

        def coordinate(path: str, form: Coordinate) -> Tensor:
            if isinstance(form, Affine):
                return affine(path)
            turn = torch.cos if form.function == "Cos" else torch.sin
            angle = affine(f"{path}.angle") * (math.pi / 180)
            return affine(f"{path}.radius") * turn(angle) + affine(f"{path}.offset")

        draw = nest(self.program).draw
        return torch.stack([coordinate("draw.x", draw.x), coordinate("draw.y", draw.y)], dim=-1)

    def image_from_plane(
        self, theta: Tensor | None = None, *, size: Size, focal_mm: Tensor | float | None = None
    ) -> Tensor:
        """The camera's homography, program units to pixels: theta [..., P] -> [..., 3, 3].

        `focal_mm` None takes the header's focal, and 35 where it names none.
        """
        theta = self.theta if theta is None else theta
        rx_deg, ry_deg = (theta[..., self.paths.index(path)] for path in ("camera.rx", "camera.ry"))
        if focal_mm is None:
            focal_mm = Camera.of(self.program).focal_mm
        return image_from_plane(rx_deg, ry_deg, size=size, focal_mm=focal_mm)

    def centers_px(
        self, theta: Tensor | None = None, *, size: Size, focal_mm: Tensor | float | None = None
    ) -> tuple[Tensor, Tensor]:
        """The drawn points in pixels [..., N, 2], and the mask [..., N] of those in front of the camera."""
        return project(self.image_from_plane(theta, size=size, focal_mm=focal_mm), self.centers(theta))

    def at(self, theta: Tensor | Sequence[float]) -> Program:
        """The program with the numbers theta [P] written into it; bounds and guards stay."""
        values = torch.as_tensor(theta, dtype=torch.float64).tolist()
        return with_leaves(self.program, dict(zip(self.paths, values, strict=True)))


def moving_leaves(program: Program) -> dict[str, float]:
    """The numbers that theta holds, by path: the camera's angles and all in `Draw`, zeros included."""
    return {path: value for path, value in leaves(program).items() if path.startswith(("camera.", "draw."))}


def without_doubles(pattern: Pattern) -> Pattern:
    """The pattern with draws that coincide kept once (DESIGN.md, 2.2)."""
    centers = pattern.centers().tolist()
    kept = distinct([(x, y, 0, 0) for x, y in centers])
    if len(kept) == len(centers):
        return pattern
    live = [tuple(pair) for pair in pattern.index[kept].tolist()]
    neighbours = torch.tensor(edges(live), dtype=torch.int64).reshape(-1, 2)
    return replace(pattern, index=pattern.index[kept], edges=neighbours)

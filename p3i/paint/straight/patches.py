"""The pieces of a photo that a tile is made of: each the same stretch of the pattern, one object on.

Convention: a patch is a canvas of `size`, pixel centres at whole numbers; its middle lies on one object
of the program. In a lattice x and y run along the sides of the super-cell; in a ring x is the angle, y the
radius.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from p3i.errors import ProgramError
from p3i.grammar.ast import Affine, Polar
from p3i.interp.unroll import nest
from p3i.paint.straight.straightened import bent
from p3i.paint.straight.supercell import SuperCell, supercell
from p3i.place.placed import Placed
from p3i.size import Size

Plane = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""x [w] and y [h], from -0.5 to 0.5 over the patch, -> plane points [h, w, 2]."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """One piece: its object's (i, j), its object's plane point, and where its points lie on the plane.

    `plane_from_patch` [3, 3] says the same where the piece is a parallelogram, for speed.
    """

    index: tuple[int, int]
    center: np.ndarray
    plane: Plane
    plane_from_patch: np.ndarray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """All pieces, the best seen first; `extent` [2] is the width and height of one in program units.

    `cell` is a lattice's super-cell, None for rings; `drawn` says which points x [w], y [h] of a
    piece belong to cells that the program draws, [h, w].
    """

    placed: Placed
    pieces: tuple[Patch, ...]
    extent: np.ndarray
    cell: SuperCell | None
    drawn: Callable[[Patch, np.ndarray, np.ndarray], np.ndarray]

    def reframed(self, count: tuple[int, int], middle: tuple[float, float]) -> "Patches":
        """The same pieces, each `count` times as wide and as high, `middle` from its middle, in its sides."""

        def within(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return count[0] * x + middle[0], count[1] * y + middle[1]

        scale = np.array([[count[0], 0, middle[0]], [0, count[1], middle[1]], [0, 0, 1.0]])

        def moved(piece: Patch) -> Patch:
            flat = piece.plane_from_patch
            return Patch(
                piece.index,
                piece.center,
                lambda x, y: piece.plane(*within(x, y)),
                None if flat is None else flat @ scale,
            )

        return Patches(
            self.placed,
            tuple(moved(piece) for piece in self.pieces),
            self.extent * count,
            self.cell,
            lambda piece, x, y: self.drawn(piece, *within(x, y)),
        )


def patches_of(placed: Placed, runs: Callable[[float], float] | None = None) -> Patches:
    """The pieces of a program's objects that lie on the photo; `runs` as for `supercell`.

    Raises ProgramError for a program that is neither a lattice nor rings, or that has no object on the photo.
    """
    seen = placed.in_sight()
    if not seen.any():
        raise ProgramError(
            "none of the program's objects lie on the photo: is it the program of another photo?"
        )
    if placed.basis is not None:
        return _lattice(placed, placed.basis, seen, runs)
    return _rings(placed, seen)


def in_photo(
    placed: Placed, patch: Patch, size: Size, *, k1: float | None, shift: np.ndarray | None = None
) -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The map from a patch's pixels to the photo's, as vision.resample takes it; `shift` [2] is in pixels."""
    moved = np.zeros(2) if shift is None else shift

    def points(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        across, down = (x + moved[0] + 0.5) / size.width - 0.5, (y + moved[1] + 0.5) / size.height - 0.5
        h = placed.image_from_plane
        least = 1e-6 * abs(h[2, 2])
        if patch.plane_from_patch is not None:
            h = h @ patch.plane_from_patch
            u, v, depth = (row[0] * across[None, :] + (row[1] * down[:, None] + row[2]) for row in h)
        else:
            plane = patch.plane(across, down)
            u, v, depth = (row[0] * plane[..., 0] + (row[1] * plane[..., 1] + row[2]) for row in h)
        front = depth > least
        over = 1 / np.where(front, depth, 1.0)
        at_x, at_y = u * over, v * over
        if k1:
            at_x, at_y, shown = bent(at_x, at_y, k1, placed.size)
            front = front & shown
        inside = (at_x >= -0.5) & (at_x <= placed.size.width - 0.5)
        inside &= (at_y >= -0.5) & (at_y <= placed.size.height - 0.5)
        return at_x, at_y, front & inside

    return points


def finest(placed: Placed, points: np.ndarray) -> float:
    """Photo pixels in a program unit at the plane points [K, 2], where and in the direction they are most."""
    h = placed.image_from_plane
    mapped = points @ h[:, :2].T + h[:, 2]
    at = mapped[:, :2] / mapped[:, 2:]
    jacobians = (h[None, :2, :2] - at[:, :, None] * h[2, :2]) / mapped[:, 2, None, None]
    return float(np.linalg.norm(jacobians, ord=2, axis=(1, 2)).max())


def _lattice(
    placed: Placed, basis: np.ndarray, seen: np.ndarray, runs: Callable[[float], float] | None
) -> Patches:
    cell = supercell(basis, runs)
    low, high = placed.index.min(axis=0), placed.index.max(axis=0)
    table = np.zeros(high - low + 3, bool)
    table[tuple((placed.index - low + 1).T)] = True

    def drawn(patch: Patch, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        found = []
        for k in (0, 1):
            steps = np.rint(x[None, :] * cell.steps[0, k] + y[:, None] * cell.steps[1, k]).astype(int)
            found.append(np.clip(steps + patch.index[k] - low[k] + 1, 0, table.shape[k] - 1))
        return table[found[0], found[1]]

    def piece(index: np.ndarray, center: np.ndarray) -> Patch:
        def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return center + x[None, :, None] * cell.sides[0] + y[:, None, None] * cell.sides[1]

        plane_from_patch = np.eye(3)
        plane_from_patch[:2] = np.column_stack([cell.sides[0], cell.sides[1], center])
        return Patch((int(index[0]), int(index[1])), center, plane, plane_from_patch)

    pieces = [piece(placed.index[k], placed.points[k]) for k in _nearest_first(placed, seen)]
    return Patches(placed, tuple(pieces), np.linalg.norm(cell.sides, axis=1), cell, drawn)


def _rings(placed: Placed, seen: np.ndarray) -> Patches:
    draw = nest(placed.pattern.program).draw
    x, y = draw.x, draw.y
    if isinstance(x, Affine) or isinstance(y, Affine):
        raise ProgramError(
            "a tile needs a lattice or a ring; the objects of this program form one row, or a wave"
        )
    turns = [k for k, name in enumerate(("i", "j")) if getattr(x.angle, name)]
    if not turns:
        raise ProgramError("a tile needs a lattice or a ring; this program's angle never changes")
    turn = turns[-1]
    if _along(x, turn) or _along(y, turn):
        raise ProgramError("a tile needs a ring of one radius; this program is a spiral")
    step_deg = getattr(x.angle, "ij"[turn])
    if abs(step_deg) > 360:
        raise ProgramError(f"a tile needs a ring; a step of {step_deg:g} degrees goes round more than once")
    radius = np.array([_at(x.radius, placed.index), _at(y.radius, placed.index)]).T
    sizes = np.round(np.abs(radius).mean(axis=1), 6)
    # Rings of several radii: the one that most objects on the photo belong to, the larger of two.
    counts = {size: int((seen & (sizes == size)).sum()) for size in set(sizes.tolist())}
    size = max(counts, key=lambda found: (counts[found], found))
    if not size > 0:
        raise ProgramError("a tile needs a ring with a radius; this one has none")
    width = size * abs(np.radians(step_deg))
    between = abs(getattr(x.radius, "ij"[1 - turn]))
    height = min(between if between > 1e-6 else width, 1.6 * size)
    direction = 1.0 if step_deg > 0 else -1.0

    def piece(index: np.ndarray) -> Patch:
        middle = np.array([_at(x.offset, index), _at(y.offset, index)])

        def plane(across: np.ndarray, down: np.ndarray) -> np.ndarray:
            places = np.repeat(index[None].astype(float), len(across), axis=0)
            places[:, turn] += direction * across
            arms = placed.at(places) - middle
            return middle + (1 + down * height / size)[:, None, None] * arms[None]

        return Patch((int(index[0]), int(index[1])), placed.at(index[None])[0], plane)

    chosen = seen & (sizes == size)
    pieces = [piece(placed.index[k]) for k in _nearest_first(placed, chosen)]
    return Patches(placed, tuple(pieces), np.array([width, height]), None, _everywhere)


def _everywhere(_patch: Patch, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A sector holds one object, and all of it is drawn."""
    return np.ones((len(y), len(x)), bool)


def _along(form: Polar, turn: int) -> float:
    name = "ij"[turn]
    return getattr(form.radius, name) or getattr(form.offset, name)


def _at(form: Affine, index: np.ndarray) -> np.ndarray:
    return form.i * index[..., 0] + form.j * index[..., 1] + form.constant


def _nearest_first(placed: Placed, chosen: np.ndarray) -> list[int]:
    """The chosen objects by their depth: the photo shows the nearest largest."""
    depth = placed.points @ placed.image_from_plane[2, :2] + placed.image_from_plane[2, 2]
    found = np.flatnonzero(chosen)
    return found[np.argsort(depth[found], kind="stable")].tolist()

"""The objects of a program as a list: where each lies, what it is called, and whether the photo shows it.

Convention: pixels of the photo, pixel centres at whole numbers, x right, y down; the plane in program units.
The formats in p3i/export have their own pixels and say so.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.interp.camera import Camera
from p3i.options.cell import MM_PER, CellSize
from p3i.options.points import PointsOptions
from p3i.place import outlines
from p3i.place.clip import clipped_to_canvas, cut_before_camera, without_straight_corners
from p3i.place.flat import Flat, flat_of
from p3i.place.lens import bent_points
from p3i.place.naming import Arrangement, Naming, named
from p3i.place.placed import Placed, placed
from p3i.place.presence import THERE, presence_of
from p3i.place.upright import upright_from_plane
from p3i.records import changed
from p3i.size import Size
from p3i.vision.image import Image

Polygon = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Object:
    """One object. `row` and `column` count from 0 and are those of its name (p3i/place/naming.py).

    `x_px`, `y_px` is its place on the photo, `x`, `y` that on the plane; `cell_px` and `cell` are the outline
    of its cell on both (`cell_px` is empty where all of the cell lies outside the photo and is cut off, or
    behind the camera). `presence`, 0 to 1, says whether the photo shows it: at least 0.5 is yes; None without
    a photo, or where it lies outside or too little of it is known. `outward` is the direction on the plane
    from the middle of its ring, of length 1; None where there is no ring. `true` and `cell_true`
    are place and cell in lengths, in the unit of the cell's true size, where that was given: upright, x to
    the right, y down, from the place of the object (i, j) = (0, 0).
    """

    name: str
    row: int
    column: int
    i: int
    j: int
    x_px: float
    y_px: float
    x: float
    y: float
    presence: float | None
    inside: bool
    cell_px: Polygon
    cell: Polygon
    outward: tuple[float, float] | None = None
    true: tuple[float, float] | None = None
    cell_true: Polygon = ()


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """The listed objects, row by row; `size` is the photo's, `image` its name, None where there is none.

    `outside` and `faint` count the objects that were left out: beyond the photo, and less present than asked;
    `behind` those that lie behind the camera, which have no place on the photo, `placed.far`
    those too far away. `cell_size` is the true size of a cell, where it was given. `notes` are sentences
    for the user.
    """

    objects: tuple[Object, ...]
    arrangement: Arrangement
    size: Size
    camera: Camera
    program: Program
    image: str | None
    label: str
    judged: bool
    outside: int
    faint: int
    behind: int
    placed: Placed = field(repr=False)
    photo: Image | None = field(repr=False)
    cell_size: CellSize | None = None
    notes: tuple[str, ...] = ()

    @property
    def columns(self) -> int:
        """In how many different columns the listed objects stand."""
        return len({found.column for found in self.objects})

    @property
    def rows(self) -> int:
        """In how many different rows the listed objects stand."""
        return len({found.row for found in self.objects})

    @property
    def there(self) -> int:
        """How many listed objects the photo shows; all of them without a photo."""
        return sum(found.presence is None or found.presence >= THERE for found in self.objects)

    @property
    def counts(self) -> str:
        """What was found, in a line: "96 objects: 94 there, 2 not"."""
        shown = len(self.objects)
        text = f"{shown} object{'' if shown == 1 else 's'}"
        if self.judged:
            unsure = sum(found.presence is None for found in self.objects)
            text += f": {self.there - unsure} there, {shown - self.there} not"
            text += f", {unsure} not to be judged" if unsure else ""
        left = [(self.outside, "outside the photo"), (self.faint, "less present than asked")]
        left += [(self.behind, "behind the camera"), (self.placed.far, "too far away")]
        dropped = [f"{count} {where}" for count, where in left if count]
        return text + (f" (left out: {', '.join(dropped)})" if dropped else "")

    def differs_from(self, expected: Size) -> str:
        """A sentence where the listed objects are not `expected.width` columns x `expected.height` rows."""
        if (self.columns, self.rows) == (expected.width, expected.height):
            return ""
        return (
            f"expected {expected.width} columns x {expected.height} rows, "
            f"but found {self.columns} x {self.rows}"
        )


def objects_of(
    program: Program,
    photo: Image | None,
    options: PointsOptions | None = None,
    *,
    image: str | None = None,
    **changes: Any,
) -> Objects:
    """The objects of `program` on `photo`, in the order of rows and columns; `image` is the photo's name.

    Without a photo they are placed on a canvas of `options.size`, else of the program's header, and nothing
    is said of their presence. `changes` are fields of PointsOptions. Raises UsageError for options that
    cannot be and where no canvas is known, ProgramError for a program that draws nothing in front of its
    camera.
    """
    options = changed(options or PointsOptions(), changes, verb="points")
    canvas = photo if photo is not None else _blank(program, options)
    laid = placed(program, canvas, focal_mm=options.focal_mm)
    lengths = _lengths(laid, options.cell)
    naming = named(laid)
    centers_px, front = laid.shown_px()
    inside = laid.in_sight()
    kept = np.flatnonzero(front if options.outside else inside)
    kept = kept[np.lexsort((naming.columns[kept], naming.rows[kept]))]

    presence: list[float | None] = [None] * len(kept)
    if photo is not None:
        presence = _presence(flat_of(photo, program, focal_mm=laid.camera.focal_mm), kept, inside[kept])
    faint = [score is not None and score < options.min_presence for score in presence]
    chart = outlines.chart_of(laid.pattern)
    cells = outlines.polygons(chart, laid.index[kept])
    found = []
    for place, score, cell, left_out in zip(kept.tolist(), presence, cells, faint, strict=True):
        if left_out:
            continue
        cell = without_straight_corners(cell)
        cell_px = cell_on_photo(laid, cell)
        if options.clip:
            cell_px = clipped_to_canvas(cell_px, laid.size)
        found.append(
            Object(
                naming.names[place],
                int(naming.rows[place]),
                int(naming.columns[place]),
                *laid.index[place].tolist(),
                *(round(value, 3) for value in centers_px[place].tolist()),
                *(round(value, 6) + 0.0 for value in laid.points[place].tolist()),
                presence=score,
                inside=bool(inside[place]),
                cell_px=_rounded(cell_px, 3),
                cell=_rounded(cell, 6),
                outward=_outward(naming, place),
                true=None if lengths is None else lengths(laid.points[place][None])[0],
                cell_true=() if lengths is None else lengths(cell),
            )
        )
    return Objects(
        tuple(found),
        naming.arrangement,
        laid.size,
        laid.camera,
        program,
        image,
        options.label,
        judged=photo is not None,
        outside=0 if options.outside else int((front & ~inside).sum()),
        faint=sum(faint),
        behind=int((~front).sum()),
        placed=laid,
        photo=photo,
        cell_size=options.cell,
        notes=photo.notes if photo is not None else (),
    )


def cell_on_photo(laid: Placed, cell: np.ndarray) -> np.ndarray:
    """The outline [K, 2] of a cell of the plane on the photo, without what lies behind the camera."""
    cell = cut_before_camera(cell, laid.image_from_plane)
    if len(cell) < 3:
        return np.zeros((0, 2))
    at = np.c_[cell, np.ones(len(cell))] @ laid.image_from_plane.T
    pixels = at[:, :2] / at[:, 2:]
    if laid.lens_k1 is None:
        return pixels
    # A straight side is seen bent: in eight parts it is, to a fraction of a pixel.
    parts = np.linspace(0, 1, 9)[:-1, None]
    fine = (pixels[:, None] + parts * (np.roll(pixels, -1, axis=0) - pixels)[:, None]).reshape(-1, 2)
    bent, shown = bent_points(fine, laid.size, laid.lens_k1)
    return bent[shown]


def _lengths(laid: Placed, cell: CellSize | None) -> Callable[[np.ndarray], Polygon] | None:
    """The map from plane points [K, 2] to true lengths; None where no true size is known."""
    if cell is None:
        return None
    linear = upright_from_plane(laid, upright=True, cell=cell) / MM_PER[cell.unit]
    return lambda points: _rounded((points - laid.origin) @ linear.T, cell.digits)


def _outward(naming: Naming, place: int) -> tuple[float, float] | None:
    if naming.outward is None:
        return None
    x, y = naming.outward[place].tolist()
    return x, y


def _blank(program: Program, options: PointsOptions) -> Image:
    """A canvas where there is no photo; it takes no memory."""
    header = program.header.canvas if program.header else None
    size = options.size or (Size(*header) if header else None)
    if size is None:
        raise UsageError("how large is the photo? The program's header names no canvas: --image or --size do")
    pixels = np.broadcast_to(np.float32(0), (size.height, size.width, 3))
    return Image(pixels, np.broadcast_to(np.True_, pixels.shape[:2]))


def _presence(flat: Flat, kept: np.ndarray, inside: np.ndarray) -> list[float | None]:
    scores = np.full(len(kept), np.nan)
    scores[inside] = presence_of(flat.placed, flat.photo, flat.placed.index[kept[inside]])
    return [round(score, 3) if np.isfinite(score) else None for score in scores.tolist()]


def _rounded(points: np.ndarray, digits: int) -> Polygon:
    # Adding 0 turns -0 into 0.
    return tuple((round(x, digits) + 0.0, round(y, digits) + 0.0) for x, y in points.tolist())

"""A photo continued beyond its frame by its program.

Where the frame cut the pattern, the pattern goes on, filled from the photo's own cells (fill/stack.py); what
else comes into the picture continues the photo's border smoothly. The camera stays, so its axis meets the
new picture where it met the old one: only where opposite sides grow alike that is the middle, and only then
there is a program that says the same on the new canvas.

Convention: photos float32 RGB [H, W, 3] in 0..1; pixel (x, y) of the photo is (x + left, y + top) of the new
picture.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Affine, Header, Program
from p3i.grammar.leaves import map_affines
from p3i.grammar.printer import format_program
from p3i.options.extend import SIDES, ExtendOptions, Margins
from p3i.paint.fill.cutout import cutout
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.continued import Continued, continued, widened
from p3i.place.flat import Flat, flat_of
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed, placed
from p3i.records import changed
from p3i.size import Size
from p3i.vision.fill import fill_in
from p3i.vision.image import Image
from p3i.vision.picture import Picture, opacity, reframed, repainted
from p3i.vision.sheet import project

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]
Sides = tuple[int, int, int, int]

# The horizon stays this far from the new picture, as a share of the photo's longer side.
_LEAST_TO_HORIZON = 0.02
# A new picture has many pieces: fewer objects are tried for each than for a hole.
_MOST_TRIED = 24
# Objects that differ from one another by more than this share of their own contrast give ghosts.
_MOST_UNLIKE = 0.8
# Pieces that nothing in the photo was like are tried again beside those that were filled.
_ROUNDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Extended:
    """A photo continued by `margins` (left, top, right, bottom) pixels: `pixels` float32 [H, W, 3].

    `alpha` [H, W] is what was transparent in the photo, None where nothing was.

    `laid` is the program on the new canvas with the objects that were added, the last `added` of them;
    `smooth` is the share of the new pixels that no object's cell covers, or for which no cell was like
    enough: there the border is continued. `program` draws the same on the new canvas, None where none does.
    """

    photo: Image
    pixels: Floats
    alpha: Floats | None
    margins: Sides
    laid: Placed
    added: int
    smooth: float
    program: Program | None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """The size of the new picture."""
        return self.laid.size

    def paint(self) -> Picture:
        """The picture in the photo's depth; what was transparent in the photo still is.

        Its EXIF has the focal of the wider view, where it is known and the axis meets the middle.
        """
        left, top, right, bottom = self.margins
        focal_mm = self.photo.focal_mm if left == right and top == bottom else None
        if focal_mm is not None:
            focal_mm *= self.photo.size.longer / self.size.longer
        return reframed(repainted(self.photo, self.pixels, alpha=self.alpha), focal_mm=focal_mm)

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the picture as Picture.save does."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values; docs/edit.md says what each means."""
        new = self.laid.index[len(self.laid.index) - self.added :]
        return {
            "photo": [self.photo.size.width, self.photo.size.height],
            "size": [self.size.width, self.size.height],
            "margins": dict(zip(SIDES, self.margins, strict=True)),
            "image_from_plane": [[float(f"{one:.10g}") for one in row] for row in self.laid.image_from_plane],
            "added": new.tolist(),
            "smooth": round(self.smooth, 4),
            "program": None if self.program is None else format_program(self.program),
        }


def extend(
    photo: Image,
    program: Program,
    options: ExtendOptions | None = None,
    *,
    progress: Progress | None = None,
    **changes: Any,
) -> Extended:
    """The photo continued beyond its frame by `program`; `changes` are fields of ExtendOptions.

    A photo that its lens bends (header key lens_k1) is straightened first: then its own pixels are resampled,
    and what the straight picture lacks inside the frame is filled as well.

    Raises UsageError where the new picture would reach the horizon or be too large; ProgramError for a
    program without objects.
    """
    asked: ExtendOptions = changed(options or ExtendOptions(), changes, verb="extend")
    notes = list[str]()
    flat = flat_of(photo, program, focal_mm=asked.focal_mm)
    if flat.k1 is not None:
        notes.append("the photo is straightened first, as its lens bends it: its own pixels are resampled")
    laid = dataclasses.replace(placed(program, photo, focal_mm=asked.focal_mm), lens_k1=None)
    sides = margins_px(laid, asked.by)
    left, top, right, bottom = sides
    size = Size(photo.size.width + left + right, photo.size.height + top + bottom)
    if size.width * size.height > asked.max_px:
        raise UsageError(
            f"the picture would have {size.width} x {size.height} pixels, more than --max-px {asked.max_px:,}"
        )
    _refuse_horizon(laid, sides)
    more = continued(laid, (-left - 0.5, -top - 0.5, size.width - left - 0.5, size.height - top - 0.5))
    wide = _wider(laid, more, sides, size)

    pixels, known, shown = _laid_out(flat, sides, size)
    alpha = _alpha(photo, known, shown, sides) if flat.k1 is None else _alpha(None, known, shown, sides)
    hole = ~shown
    pattern = hole & _ground(wide)
    bare = hole & ~pattern
    left_over = pattern
    for _ in range(_ROUNDS):
        if not left_over.any():
            break
        pixels, unlike = fill_by_stack(
            pixels, known | (pattern & ~left_over), left_over, wide, most_tried=_MOST_TRIED, progress=progress
        )
        if unlike.sum() == left_over.sum():
            break
        left_over = unlike
    bare |= left_over
    if bare.any():
        fill_in(pixels, (known | hole) & ~bare, bare)
    smooth = float(bare.sum() / max(1, hole.sum()))
    wider = _program(program, wide, more, sides, laid.size)
    notes += _notes(smooth, more, wider, sides)
    if len(more.index) and cutout(flat.placed, flat.photo).unlike > _MOST_UNLIKE:
        notes.append(
            "look at what was added: the photo's objects differ much from one another, and mixtures of them "
            "look like ghosts"
        )
    return Extended(photo, pixels, alpha, sides, wide, len(more.index), smooth, wider, tuple(notes))


def margins_px(laid: Placed, by: Margins) -> Sides:
    """How many pixels each side grows by; UsageError where cells reach the horizon, or for nothing."""
    width, height = laid.size.width, laid.size.height
    if by.unit == "cells":
        found = [_cells_px(laid, side, count) if count else 0 for side, count in enumerate(by.sides)]
    else:
        share = (width / 100, height / 100) * 2 if by.unit == "%" else (1.0,) * 4
        found = [round(one * part) for one, part in zip(by.sides, share, strict=True)]
    if not any(found):
        raise UsageError("the picture would grow by less than a pixel: ask for more")
    left, top, right, bottom = found
    return left, top, right, bottom


def _cells_px(laid: Placed, side: int, count: float) -> int:
    """How far `count` cells reach beyond the middle of a side, along the lattice's likest direction."""
    width, height = laid.size.width, laid.size.height
    middle = np.array(
        [(-0.5, (height - 1) / 2), ((width - 1) / 2, -0.5), (width - 0.5, (height - 1) / 2),
         ((width - 1) / 2, height - 0.5)][side]
    )  # fmt: skip
    outwards = np.array([(-1, 0), (0, -1), (1, 0), (0, 1)][side])
    start, front = project(np.linalg.inv(laid.image_from_plane), middle[None])
    if not front[0]:
        raise UsageError(f"the {SIDES[side]} side of the photo lies beyond the horizon: no cell is there")
    near = laid.index[np.argmin(np.hypot(*(laid.points - start[0]).T))].astype(float)
    moves = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    steps = laid.at(near + moves / 2) - laid.at(near - moves / 2)
    if np.linalg.norm(steps, axis=1).min() < 1e-6:  # a single row: as far across as along
        longest = steps[np.argmax(np.linalg.norm(steps, axis=1))]
        across = np.array([-longest[1], longest[0]])
        steps = np.array([longest, -longest, across, -across])
    tiny, _ = project(laid.image_from_plane, start + 0.01 * steps)
    directions = tiny - middle
    likest = int(np.argmax(directions @ outwards / np.linalg.norm(directions, axis=1)))
    end, front = project(laid.image_from_plane, start + count * steps[likest])
    far = float((end[0] - middle) @ outwards)
    if not front[0] or far <= 0:
        raise UsageError(f"{count:g} more cells to the {SIDES[side]} reach the horizon: ask for fewer")
    return math.ceil(far)


def _refuse_horizon(laid: Placed, sides: Sides) -> None:
    """UsageError where a side that shows the plane only would come to show the horizon."""
    line = laid.camera.horizon(laid.size)
    if line is None:
        return
    a, b, c = line
    width, height = laid.size.width, laid.size.height
    least = _LEAST_TO_HORIZON * laid.size.longer
    corners = [(x, y) for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)]
    nearest = min(a * x + b * y + c for x, y in corners)
    if nearest <= least:
        return  # the photo itself shows the horizon: beyond it nothing is pattern
    left, top, right, bottom = sides
    wide = [(x, y) for x in (-left - 0.5, width + right - 0.5) for y in (-top - 0.5, height + bottom - 0.5)]
    if min(a * x + b * y + c for x, y in wide) > least:
        return
    guilty = "top" if b > abs(a) else "bottom" if -b > abs(a) else "left" if a > 0 else "right"
    raise UsageError(
        f"the plane's horizon lies {max(0, nearest):.0f} pixels beyond the photo, and the new picture would "
        f"reach it: let the {guilty} side grow by less"
    )


def _wider(laid: Placed, more: Continued, sides: Sides, size: Size) -> Placed:
    """The program on the new canvas, with the objects that were added behind its own."""
    shift = np.array([[1.0, 0, sides[0]], [0, 1, sides[1]], [0, 0, 1]])
    return dataclasses.replace(
        laid,
        size=size,
        image_from_plane=shift @ laid.image_from_plane,
        index=np.concatenate([laid.index, more.index]),
        points=np.concatenate([laid.points, more.points]),
    )


def _ground(wide: Placed) -> Mask:
    """The pixels of the new picture that lie in a cell: bool [H, W]."""
    cells, front = project(wide.image_from_plane, polygons(chart_of(wide.pattern), wide.index))
    ground = np.zeros((wide.size.height, wide.size.width), np.uint8)
    limit = 4 * (wide.size.width + wide.size.height)
    for cell, ahead in zip(cells, np.asarray(front.all(1)), strict=True):
        if ahead and np.abs(cell).max() < limit:
            cv2.fillPoly(ground, [np.rint(cell * 16).astype(np.int32)], 1, shift=4)
    return ground > 0


def _laid_out(flat: Flat, sides: Sides, size: Size) -> tuple[Floats, Mask, Mask]:
    """The photo on the new canvas: pixels [H, W, 3], which of them are known, and which it shows at all.

    What a bent photo shows beyond its old frame counts where it is known.
    """
    pixels = np.zeros((size.height, size.width, 3), np.float32)
    known, shown = np.zeros((2, size.height, size.width), bool)
    left, top = sides[0] - flat.corner[0], sides[1] - flat.corner[1]
    into, out_of = [], []
    for start, length, limit in (
        (top, flat.photo.size.height, size.height),
        (left, flat.photo.size.width, size.width),
    ):
        into.append(slice(max(0, start), min(limit, start + length)))
        out_of.append(slice(max(0, -start), min(length, limit - start)))
    to, of = tuple(into), tuple(out_of)
    pixels[to] = flat.photo.pixels[of]
    known[to] = flat.photo.valid[of]
    shown[to] = flat.seen[of] & flat.photo.valid[of]
    inside = _window(sides, flat.size)
    corner = (
        slice(flat.corner[1], flat.corner[1] + flat.size.height),
        slice(flat.corner[0], flat.corner[0] + flat.size.width),
    )
    shown[inside] = flat.seen[corner]
    return pixels, known & shown, shown


def _alpha(photo: Image | None, known: Mask, shown: Mask, sides: Sides) -> Floats | None:
    """How opaque the new picture is: as the photo in its place; where there is none, as it is known."""
    own = None if photo is None else opacity(photo)
    if photo is None or own is None:
        return None if (known | ~shown).all() else (known | ~shown).astype(np.float32)
    wide = np.ones(known.shape, np.float32)
    wide[_window(sides, photo.size)] = own
    return wide


def _window(sides: Sides, size: Size) -> tuple[slice, slice]:
    """Where the photo lies in the new picture: rows and columns."""
    return slice(sides[1], sides[1] + size.height), slice(sides[0], sides[0] + size.width)


def _program(program: Program, wide: Placed, more: Continued, sides: Sides, old: Size) -> Program | None:
    """The program of the new picture: its unit is the new longer side's, its focal keeps its pixels."""
    left, top, right, bottom = sides
    drawn = widened(program, more.index)
    if drawn is None or left != right or top != bottom:
        return None
    ratio = old.longer / wide.size.longer

    def change(path: str, affine: Affine) -> Affine:
        if not path.startswith("draw.") or path.endswith(".angle"):
            return affine
        return dataclasses.replace(
            affine,
            i=round(affine.i * ratio, 6),
            j=round(affine.j * ratio, 6),
            constant=round(affine.constant * ratio, 6),
        )

    header = Header(
        canvas=(wide.size.width, wide.size.height), focal_mm=round(wide.camera.focal_mm * ratio, 6)
    )
    return map_affines(dataclasses.replace(drawn, header=header), change)


def _notes(smooth: float, more: Continued, wider: Program | None, sides: Sides) -> list[str]:
    found: list[str] = []
    if not len(more.index):
        found.append(
            "the pattern ends inside the photo, or does not reach its new border: nothing of it is added"
        )
    if smooth >= 0.01:
        found.append(
            f"{smooth:.0%} of the new pixels are not pattern: the photo's border is continued smoothly"
        )
    if wider is None:
        why = (
            "its guards or leaning bounds would have to change"
            if sides[0] == sides[2] and sides[1] == sides[3]
            else "its camera looks at the middle of the picture, and unequal sides move that"
        )
        found.append(f"no program says the same on the new canvas ({why}): --json gives the homography")
    return found

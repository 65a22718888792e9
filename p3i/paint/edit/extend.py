"""A photo continued beyond its frame by its program.

Where the frame cut the pattern, the pattern goes on, filled from the photo's own cells (fill/stack.py), and
from these alone: what lies beside the pattern on the photo says nothing of its light. What else would come
into the picture is cropped away, or is as `beyond` says. The camera stays, so its axis meets the
new picture where it met the old one: only where opposite sides grow alike that is the middle, and only then
there is a program that says the same on the new canvas.

Convention: photos float32 RGB [H, W, 3] in 0..1; pixel (x, y) of the photo is (x + left, y + top) of the new
picture.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Affine, Header, Program
from p3i.grammar.leaves import map_affines
from p3i.grammar.printer import format_program
from p3i.options.extend import SIDES, Beyond, ExtendOptions
from p3i.paint.edit.border import border_px, within
from p3i.paint.edit.margins import Sides, before_horizon, grown, kept_sides, margins_px, refuse_horizon
from p3i.paint.fill.cutout import cutout
from p3i.paint.fill.holes import hidden_ground, on_flat
from p3i.paint.fill.pieces import cells_on
from p3i.paint.fill.stack import fill_in_place
from p3i.place.continued import Continued, continued, widened
from p3i.place.flat import Flat, flat_of
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed, placed
from p3i.records import changed
from p3i.size import Size
from p3i.vision.fill import fill_in
from p3i.vision.image import Image
from p3i.vision.picture import Picture, opacity, reframed, repainted
from p3i.vision.planes import put
from p3i.vision.sheet import project

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# A new picture has many pieces: fewer objects are tried for each than for a hole.
_MOST_TRIED = 24
# Objects that differ from one another by more than this share of their own contrast give ghosts.
_MOST_UNLIKE = 0.8
# A smaller share of the new pixels is not worth a word.
_LEAST_TOLD = 0.01
# Pieces that nothing in the photo was like are tried again beside those that were filled.
_ROUNDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Extended:
    """A photo continued by `margins` (left, top, right, bottom) pixels: `pixels` float32 [H, W, 3].

    `alpha` [H, W] is what is transparent: what was so in the photo, and what is no pattern where that was
    asked for; None where nothing is.

    `laid` is the program on the new canvas with the objects that were added, the last `added` of them;
    `smooth` is the share of the new pixels that no object's cell covers, or for which no cell was like
    enough: there the border is continued, or nothing is (`beyond`). `filled` pixels of the photo were hidden
    and are pattern now. `program` draws the same on the new
    canvas, None where none does.
    """

    photo: Image
    pixels: Floats
    alpha: Floats | None
    margins: Sides
    laid: Placed
    added: int
    smooth: float
    filled: int
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
            "filled": self.filled,
            "program": None if self.program is None else format_program(self.program),
            "notes": list(self.notes),
        }


def extend(
    photo: Image,
    program: Program,
    options: ExtendOptions | None = None,
    *,
    mask: str | PathLike[str] | Mask | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> Extended:
    """The photo continued beyond its frame by `program`; `changes` are fields of ExtendOptions.

    What `mask` marks, a picture (white is hidden) or bool [H, W], and what is transparent, is filled as well.

    A photo that its lens bends (header key lens_k1) is straightened first: then its own pixels are resampled,
    and what the straight picture lacks inside the frame is filled as well.

    Raises UsageError where the new picture would reach the horizon or be too large, for the mask as `inpaint`
    does; ProgramError for a program without objects.
    """
    asked: ExtendOptions = changed(options or ExtendOptions(), changes, verb="extend")
    notes = list[str]()
    hidden, hole = hidden_ground(photo, mask, keep_transparent=asked.keep_transparent)
    flat = flat_of(photo, program, focal_mm=asked.focal_mm)
    if flat.k1 is not None:
        notes.append("the photo is straightened first, as its lens bends it: its own pixels are resampled")
    laid = dataclasses.replace(placed(program, photo, focal_mm=asked.focal_mm), lens_k1=None)
    wanted = margins_px(laid, asked.by)
    sides = before_horizon(laid, wanted) if asked.beyond == "crop" else wanted
    left, top, right, bottom = sides
    size = Size(photo.size.width + left + right, photo.size.height + top + bottom)
    if size.width * size.height > asked.max_px:
        raise UsageError(
            f"the picture would have {size.width} x {size.height} pixels, more than --max-px {asked.max_px:,}"
        )
    refuse_horizon(laid, sides)
    x, y = flat.corner[0] - left - 0.5, flat.corner[1] - top - 0.5
    canvas = (x, y, x + size.width, y + size.height)
    unknown = on_flat(flat, hole) | ~flat.seen
    more = continued(flat.placed, flat.photo, hole=unknown, canvas=canvas)
    wide = more.joined(laid).on_canvas(sides[:2], size)

    pixels, known, shown = _laid_out(flat, ~unknown, sides, size)
    del unknown, hole  # a large picture's masks are much
    ground = _ground(wide)
    of_pattern = known & ground
    if flat.k1 is None and any(border := border_px(flat.photo, flat.placed)):
        of_pattern[_window(sides, photo.size)] &= within(photo.size, border)
        notes.append(_border_note(border))
    ground &= ~shown
    bare = _painted(pixels, of_pattern, ground, wide, progress)
    bare |= ~(shown | ground)
    del of_pattern, ground
    # What was transparent stays so where the pattern does not go on.
    inside, corner = _window(sides, flat.size), _window(flat.corner, flat.size)
    clear = bare[inside] & ~(flat.photo.valid | on_flat(flat, hidden))[corner] & flat.seen[corner]
    put(flat.photo.pixels[corner], pixels[inside], clear)
    bare[inside] &= ~clear
    shown[inside] |= clear
    added = bare.copy()
    added[_window(sides, photo.size)] = False  # what was hidden in the photo is no reason not to grow
    kept = kept_sides(added, sides, size) if asked.beyond == "crop" else sides
    if kept != sides:
        off = (sides[0] - kept[0], sides[1] - kept[1], sides[2] - kept[2], sides[3] - kept[3])
        window = _window(off, grown(photo.size, kept))
        pixels = pixels[window].copy()
        known, shown, bare = (one[window] for one in (known, shown, bare))
        more = _on_canvas(more, laid, kept)
        wide = more.joined(laid).on_canvas(kept[:2], grown(photo.size, kept))
    if kept != wanted:
        notes += _cropped_note(wanted, kept)
    smooth = float(bare.sum() / max(1, (~shown).sum()))
    if asked.beyond == "refuse" and smooth >= _LEAST_TOLD:
        raise UsageError(
            f"{smooth:.0%} of the new pixels would not be pattern: grow by less, or choose another --beyond"
        )
    filled = int((~shown & ~bare)[_window(kept, photo.size)].sum())
    alpha = _alpha(photo if flat.k1 is None else None, known, shown, kept)
    if asked.beyond == "transparent" and bare.any():
        alpha = np.where(bare, np.float32(0), np.float32(1) if alpha is None else alpha)
    if bare.any():
        fill_in(pixels, (known | ~shown) & ~bare, bare)
    wider = _program(program, wide, more, kept, laid.size)
    notes += _notes(smooth, more, wider, kept, asked.beyond)
    if len(more.index) and cutout(flat.placed, flat.photo).unlike > _MOST_UNLIKE:
        notes.append(
            "look at what was added: the photo's objects differ much from one another, and mixtures of them "
            "look like ghosts"
        )
    return Extended(photo, pixels, alpha, kept, wide, len(more.index), smooth, filled, wider, tuple(notes))


def _painted(pixels: Floats, known: Mask, hole: Mask, wide: Placed, progress: Progress | None) -> Mask:
    """Fill the hole from what is known of the pattern, in place, and say where nothing is like it [H, W]."""
    left_over = hole
    for _ in range(_ROUNDS):
        if not left_over.any():
            break
        unlike = fill_in_place(pixels, known, left_over, wide, most_tried=_MOST_TRIED, progress=progress)
        if unlike.sum() == left_over.sum():
            break
        known, left_over = known | (left_over & ~unlike), unlike
    return left_over


def _on_canvas(more: Continued, laid: Placed, sides: Sides) -> Continued:
    """Those of the objects that came in of whose cells a part lies on a canvas that was cropped."""
    cells, _ = project(laid.image_from_plane, polygons(chart_of(laid.pattern), more.index))
    size = grown(laid.size, sides)
    low, high = -np.array(sides[:2]) - 0.5, np.array([size.width, size.height]) - np.array(sides[:2]) - 0.5
    on = (cells.min(1) < high).all(1) & (cells.max(1) > low).all(1)
    return dataclasses.replace(more, index=more.index[on], points=more.points[on])


def _ground(wide: Placed) -> Mask:
    """The pixels of the new picture that lie in a cell: bool [H, W]."""
    return cells_on(wide, most_px=4 * (wide.size.width + wide.size.height)) > 0


def _laid_out(flat: Flat, seen: Mask, sides: Sides, size: Size) -> tuple[Floats, Mask, Mask]:
    """The photo on the new canvas: pixels [H, W, 3], which of them are known, and which it shows at all.

    `seen` [h, w] is what the flat photo shows inside its frame, transparent or not. What a bent photo shows
    beyond its old frame counts where it is known.
    """
    pixels = np.zeros((size.height, size.width, 3), np.float32)
    known, shown = (np.zeros(pixels.shape[:2], bool) for _ in range(2))
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
    shown[to] = seen[of] & flat.photo.valid[of]
    shown[_window(sides, flat.size)] = seen[_window(flat.corner, flat.size)]
    known &= shown
    return pixels, known, shown


def _alpha(photo: Image | None, known: Mask, shown: Mask, sides: Sides) -> Floats | None:
    """How opaque the new picture is: as the photo in its place; where there is none, as it is known."""
    own = None if photo is None else opacity(photo)
    if photo is None or own is None:
        return None if (known | ~shown).all() else (known | ~shown).astype(np.float32)
    wide = np.ones(known.shape, np.float32)
    wide[_window(sides, photo.size)] = own
    return np.where(shown, wide, np.float32(1))


def _window(corner: tuple[int, ...], size: Size) -> tuple[slice, slice]:
    """The rows and columns of a picture of `size` whose corner lies at (left, top, ...) of a larger one."""
    return slice(corner[1], corner[1] + size.height), slice(corner[0], corner[0] + size.width)


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


def _border_note(border: Sides) -> str:
    where = ", ".join(f"{name} {px}" for name, px in zip(SIDES, border, strict=True) if px)
    return (
        f"what lies along the photo's edge is not like its pattern ({where} pixels): it stays, and takes no "
        "part in what is added; a border is best cropped off first"
    )


def _cropped_note(asked: Sides, kept: Sides) -> list[str]:
    """What was asked for and was cropped, side by side."""
    cut = [
        f"{name} by {new} of {old}" for name, old, new in zip(SIDES, asked, kept, strict=True) if new < old
    ]
    return [f"grown only as far as the pattern goes ({', '.join(cut)} pixels): --beyond says what else to do"]


def _notes(smooth: float, more: Continued, wider: Program | None, sides: Sides, beyond: Beyond) -> list[str]:
    found: list[str] = []
    if not len(more.index):
        found.append(
            "the pattern ends inside the photo, or does not reach its new border: nothing of it is added"
        )
    if smooth >= _LEAST_TOLD:
        what = (
            "they are transparent" if beyond == "transparent" else "the photo's border is continued smoothly"
        )
        found.append(f"{smooth:.0%} of the new pixels are not pattern: {what}")
    if wider is None:
        why = (
            "its guards or leaning bounds would have to change"
            if sides[0] == sides[2] and sides[1] == sides[3]
            else "its camera looks at the middle of the picture, and unequal sides move that"
        )
        found.append(f"no program says the same on the new canvas ({why}): --json gives the homography")
    return found

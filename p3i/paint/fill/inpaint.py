"""Holes in a photo, filled by what its program says is to be seen there.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W], True is to be filled. What lies outside
the hole stays as it is, to the bit.
"""

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.inpaint import InpaintOptions
from p3i.options.points import PointsOptions
from p3i.paint.fill.filled import Filled, share_text
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.continued import continued
from p3i.place.flat import flat_of
from p3i.place.objects import objects_of
from p3i.place.placed import Placed, placed
from p3i.records import changed
from p3i.vision.image import Image, read_mask
from p3i.vision.picture import Picture, opacity, repainted

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# Straightening a bent photo mixes neighbours: a hole in it is this many pixels wider.
_LENS_MARGIN_PX = 2


@dataclass(frozen=True, slots=True, eq=False)
class Inpainted:
    """A photo with its `hole` [H, W] filled by `method`: `pixels` float32 [H, W, 3].

    `unlike` is the share of the hole for which the program knows nothing like it; `fallback` the share that
    something simpler than the method filled, that one included. `added` are the (i, j) with which the pattern
    goes on through the hole beyond what the program draws. `notes` are sentences for the user.
    """

    photo: Image
    pixels: Floats
    hole: Mask
    method: str
    unlike: float
    fallback: float
    notes: tuple[str, ...] = ()
    added: tuple[tuple[int, int], ...] = ()

    def paint(self) -> Picture:
        """The picture in the photo's depth; where the hole was transparent it is so no longer."""
        alpha = opacity(self.photo)
        alpha = None if alpha is None else np.where(self.hole, np.float32(1), alpha)
        return repainted(self.photo, self.pixels, alpha=alpha)

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the picture as Picture.save does."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values, the same for all methods; docs/inpaint.md says what each means."""
        return {
            "photo": [self.photo.size.width, self.photo.size.height],
            "method": self.method,
            "filled": int(self.hole.sum()),
            "unlike": round(self.unlike, 4),
            "fallback": round(self.fallback, 4),
            "added": [list(index) for index in self.added],
            "notes": list(self.notes),
        }


def inpaint(
    photo: Image,
    program: Program,
    options: InpaintOptions | None = None,
    *,
    mask: str | PathLike[str] | Mask | None = None,
    remove: Sequence[str | tuple[int, int]] = (),
    progress: Progress | None = None,
    **changes: Any,
) -> Inpainted:
    """The photo with a hole filled: what `mask` marks, and the cells of the objects in `remove`.

    Without either it is what is transparent. `mask` is a picture (white is to be filled) or bool [H, W];
    `remove` holds names (`"B3"`) or indices ((i, j)) of objects, as `p3i points` lists them. `changes` are
    fields of InpaintOptions.

    Raises UsageError where neither marks anything, all is marked, or an object is unknown; FileError for a
    mask that cannot be read; ProgramError for a program without objects on the photo.
    """
    asked: InpaintOptions = changed(options or InpaintOptions(), changes, verb="inpaint")
    hole = hole_from(photo, program, mask=mask, remove=remove, focal_mm=asked.focal_mm)
    flat = flat_of(photo, program, focal_mm=asked.focal_mm)
    if flat.k1 is None:
        return _filled(photo, flat.placed, hole, asked, progress)
    # A bent photo is filled where it is straight, and the hole's pixels are brought back. Around the hole as
    # much is filled as bringing back mixes in, beyond the photo's edge too.
    wider = np.ones((2 * _LENS_MARGIN_PX + 1,) * 2, np.uint8)
    flat_hole = cv2.dilate(flat.marked(hole).astype(np.uint8), wider) > 0
    found = _filled(flat.photo, flat.placed, flat_hole, asked, progress)
    pixels = np.where(hole[:, :, None], flat.bent(found.pixels), photo.pixels)
    return dataclasses.replace(found, photo=photo, pixels=pixels, hole=hole)


def hole_from(
    photo: Image,
    program: Program,
    *,
    mask: str | PathLike[str] | Mask | None,
    remove: Sequence[str | tuple[int, int]],
    focal_mm: float | None = None,
) -> Mask:
    """What is to be filled, bool [H, W]; the arguments and errors are those of `inpaint`."""
    hole = np.zeros(photo.valid.shape, bool)
    if isinstance(mask, np.ndarray):
        if mask.shape != hole.shape or mask.dtype != np.bool_:
            raise UsageError(f"a mask is bool {hole.shape}, not {mask.dtype} {mask.shape}")
        hole |= mask
    elif mask is not None:
        hole |= read_mask(mask, photo.size)
    if remove:
        hole |= _cells(photo, program, remove, focal_mm=focal_mm)
    if mask is None and not remove:
        hole = ~photo.valid
    if not hole.any():
        raise UsageError("nothing is to be filled: give --mask FILE (white is filled) or --remove i,j")
    if (hole | ~photo.valid).all():
        raise UsageError("the hole takes all of the photo: nothing would be left to fill it from")
    return hole


def _cells(
    photo: Image, program: Program, remove: Sequence[str | tuple[int, int]], *, focal_mm: float | None
) -> Mask:
    """The cells of some objects on the photo, bool [H, W]; raises UsageError for one that is not there."""
    camera = placed(program, photo, focal_mm=focal_mm).camera
    listed = objects_of(program, None, PointsOptions(size=photo.size, focal_mm=camera.focal_mm)).objects
    by_name = {found.name.upper(): found for found in listed}
    by_index = {(found.i, found.j): found for found in listed}
    hole = np.zeros(photo.valid.shape, np.uint8)
    for asked in remove:
        index = parse_index(asked) if isinstance(asked, str) else (asked[0], asked[1])
        found = by_name.get(str(asked).strip().upper()) if index is None else by_index.get(index)
        if found is None:
            known = ", ".join([one.name for one in listed[:3]] + (["..."] if len(listed) > 3 else []))
            raise UsageError(
                f"there is no object {asked} on the photo: `p3i points` lists their names ({known}) and i, j"
            )
        if found.cell_px:
            # In sixteenths of a pixel, so that the cell's outline is met as closely as pixels allow.
            corners = np.rint(np.array(found.cell_px) * 16).astype(np.int32)
            cv2.fillPoly(hole, [corners], 1, shift=4)
    return hole > 0


def parse_index(text: str) -> tuple[int, int] | None:
    """`i,j` as two whole numbers; None for anything else."""
    found = re.fullmatch(r"\s*([+-]?\d{1,9})\s*,\s*([+-]?\d{1,9})\s*", text)
    return None if found is None else (int(found[1]), int(found[2]))


def _filled(
    photo: Image, laid: Placed, hole: Mask, options: InpaintOptions, progress: Progress | None
) -> Inpainted:
    """The hole of a straight photo filled by the method asked for."""
    notes: list[str] = []
    if not laid.in_sight().any():
        notes.append("no object of the program lies on the photo: it shows nothing to fill the hole from")
    more = continued(laid, photo, hole=hole)
    if len(more.index):
        notes.append(
            f"the pattern goes on through the hole: {len(more.index)} "
            f"{'object is' if len(more.index) == 1 else 'objects are'} added that the program does not draw"
        )
        laid = more.joined(laid)
    match options.method:
        case "npn":
            found = _by_network(photo, laid, hole, options, progress)
        case "patchmatch":
            from p3i.paint.fill.patchmatch import fill_by_patchmatch

            found = fill_by_patchmatch(photo.pixels, photo.valid, hole, laid, seed=options.seed)
        case _:
            pixels, bare = fill_by_stack(photo.pixels, photo.valid, hole, laid, progress=progress)
            part = share_text(bare, hole)
            said = [f"for {part} the program has nothing like it: the surroundings are continued"] * bool(
                part
            )
            found = Filled(pixels, bare, bare, tuple(said))
    unlike, fallback = (float(part.sum() / hole.sum()) for part in (found.unlike, found.fallback))
    added = tuple((int(i), int(j)) for i, j in more.index)
    said = (*notes, *found.notes)
    return Inpainted(photo, found.pixels, hole, options.method, unlike, fallback, said, added)


def _by_network(
    photo: Image, laid: Placed, hole: Mask, options: InpaintOptions, progress: Progress | None
) -> Filled:
    from p3i.options.npn import NetworkOptions
    from p3i.paint.fill.npn.paint import paint

    network = NetworkOptions(
        steps=options.steps,
        time_s=options.time_s,
        checkpoint=options.checkpoint,
        seed=options.seed,
        device=options.device,
        threads=options.threads,
    )

    def told(step: int, steps: int, _misfit: float) -> None:
        if progress is not None:
            progress("training", step / steps)

    return paint(photo, laid, hole, network, progress=told)

"""Holes in a photo, filled by what its program says is to be seen there.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W], True is to be filled. What lies outside
the hole stays as it is, to the bit.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from p3i.grammar.ast import Program
from p3i.options.inpaint import InpaintOptions
from p3i.paint.fill.cleared import cleared, covered
from p3i.paint.fill.cutout import cutout, doubts
from p3i.paint.fill.filled import Filled, share_text
from p3i.paint.fill.found import beside_hole
from p3i.paint.fill.holes import CHANGED, HoleFacts, Named, asked_for, facts_of, on_flat, only
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.continued import continued
from p3i.place.flat import flat_of
from p3i.place.moves import pitch_px
from p3i.place.placed import Placed
from p3i.records import changed
from p3i.vision.image import Image, masked
from p3i.vision.picture import Picture, opacity, repainted
from p3i.vision.planes import put

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]

# The surroundings of a hole that are looked at for what is not of the pattern, in distances between objects.
_BESIDE = 0.15
# So many holes are told of in sentences; all are in the record.
_MOST_TOLD = 5


@dataclass(frozen=True, slots=True, eq=False)
class Inpainted:
    """A photo with its `hole` [H, W] filled by `method`: `pixels` float32 [H, W, 3].

    `unlike` is the share of the hole for which the program knows nothing like it; `fallback` the share that
    something simpler than the method filled, that one included. `added` are the (i, j) with which the pattern
    goes on through the hole beyond what the program draws. `removed` objects were taken away: where they lay
    is part of the hole. `foreign` [H, W] is what of it cannot come from the pattern, and transparent in the
    picture where `only_pattern`; `holes` has the facts of each hole, the largest first. `notes` are sentences
    for the user.
    """

    photo: Image
    pixels: Floats
    hole: Mask
    method: str
    unlike: float
    fallback: float
    removed: int
    foreign: Mask
    only_pattern: bool
    holes: tuple[HoleFacts, ...]
    notes: tuple[str, ...] = ()
    added: tuple[tuple[int, int], ...] = ()

    def paint(self) -> Picture:
        """The picture in the photo's depth; where the hole was transparent it is so no longer.

        But for what cannot come from the pattern, with `only_pattern`.
        """
        alpha = opacity(self.photo)
        alpha = None if alpha is None else np.where(self.hole, np.float32(1), alpha)
        if self.only_pattern and self.foreign.any():
            alpha = np.ones(self.hole.shape, np.float32) if alpha is None else alpha
            alpha = np.where(self.foreign, np.float32(0), alpha)
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
            "removed": self.removed,
            "unlike": round(self.unlike, 4),
            "fallback": round(self.fallback, 4),
            "added": [list(index) for index in self.added],
            "holes": [one.record() for one in self.holes],
            "notes": list(self.notes),
        }


def inpaint(
    photo: Image,
    program: Program,
    options: InpaintOptions | None = None,
    *,
    mask: str | PathLike[str] | Mask | None = None,
    restore: Sequence[Named] = (),
    remove: Sequence[Named] = (),
    progress: Progress | None = None,
    **changes: Any,
) -> Inpainted:
    """The photo with a hole filled: what `mask` marks, and the cells of the objects to `restore`.

    The objects to `remove` are taken away, and the ground between objects goes on under them (cleared.py).
    Without any of these the hole is what is transparent. `mask` is a picture (white is to be filled) or bool
    [H, W]; objects are names (`"B3"`) or indices ((i, j)), as `p3i points` lists them. `changes` are fields
    of InpaintOptions.

    Raises UsageError where nothing is marked, all is, or an object is unknown; FileError for a mask that
    cannot be read; ProgramError for a program without objects on the photo.
    """
    asked: InpaintOptions = changed(options or InpaintOptions(), changes, verb="inpaint")
    wanted = asked_for(photo, program, mask=mask, restore=restore, remove=remove, focal_mm=asked.focal_mm)
    flat = flat_of(photo, program, focal_mm=asked.focal_mm)
    hole = wanted.hole
    flat_hole = on_flat(flat, hole)
    more = continued(flat.placed, flat.photo, hole=flat_hole)
    if hole.any():
        found = _filled(flat.photo, more.joined(flat.placed), flat_hole, asked, progress)
    else:
        found = Filled(flat.photo.pixels, flat_hole, flat_hole)
    notes, pixels, gone = list[str](), found.pixels, np.zeros_like(flat_hole)
    notes += more.notes()
    if wanted.removed:
        ground, gone, said = _taken_away(flat.photo, flat.placed, flat_hole, wanted.removed)
        if hole.any():
            put(ground, pixels, gone)
        else:
            pixels = ground
        del ground  # a large photo's copies are much
        notes += [CHANGED, *said]
    guess, strange = beside_hole(flat.photo, flat.placed, flat_hole | gone)
    of_pattern = flat_hole & ~gone
    parts = [found.unlike & ~gone, found.fallback & ~gone, guess & of_pattern, strange, gone]
    if flat.k1 is not None:
        pixels, parts = flat.bent(np.asarray(pixels, np.float32)), [flat.bent_mask(part) for part in parts]
    unlike, fallback, guess, strange, gone = parts
    hole = hole | (gone & photo.valid)
    put(photo.pixels, pixels, ~hole)
    reach_px = max(3.0, _BESIDE * _typical_pitch_px(flat.placed))
    facts = facts_of(hole, unlike=unlike, guess=guess, strange=strange, ground=gone, reach_px=reach_px)
    told = [one.sentence() for one in facts if one.note]
    if len(told) > _MOST_TOLD:
        told[_MOST_TOLD:] = [
            f"{len(told) - _MOST_TOLD} more holes of which not all can come from the pattern"
        ]
    return Inpainted(
        photo,
        pixels,
        hole,
        asked.method,
        unlike=float((unlike & hole).sum() / max(1, hole.sum())),
        fallback=float((fallback & hole).sum() / max(1, hole.sum())),
        removed=len(wanted.removed),
        foreign=(unlike | guess) & hole,
        only_pattern=asked.only_pattern,
        holes=facts,
        notes=(*notes, *found.notes, *told),
        added=tuple((int(i), int(j)) for i, j in more.index),
    )


def _typical_pitch_px(laid: Placed) -> float:
    """How far the next object lies from the one in the middle, in pixels."""
    return pitch_px(laid, int(np.argmin(np.hypot(*(laid.points - np.median(laid.points, 0)).T))))


def _taken_away(
    photo: Image, laid: Placed, hole: Mask, removed: Sequence[tuple[int, int]]
) -> tuple[Floats, Mask, list[str]]:
    """The straight photo with the ground under some objects, where those lay, and what to say of it.

    What is in the hole tells nothing of the ground.
    """
    known = masked(photo, hole) if hole.any() else photo
    cut = cutout(laid, known)
    ground, gone = cleared(
        known.pixels, known.valid, laid, cut, objects=covered(only(laid, removed), cut) & photo.valid
    )
    return ground, gone, doubts(cut)


def _filled(
    photo: Image, laid: Placed, hole: Mask, options: InpaintOptions, progress: Progress | None
) -> Filled:
    """The hole of a straight photo filled by the method asked for."""
    notes: list[str] = []
    if not laid.in_sight().any():
        notes.append("no object of the program lies on the photo: it shows nothing to fill the hole from")
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
    return dataclasses.replace(found, notes=(*notes, *found.notes))


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

"""The objects of a photo laid anew: those of an old program taken away, those of a new one put in.

An object of the new program that stands where one of the old does keeps its own pixels. The others of the
old are removed (cleared.py); each other place of the new gets the nearest good object of the photo, cut out
of its ground (cutout.py), turned with its ring and in the light of its new place.

Ground that is hidden is filled first (fill/completed.py), and both programs go on over it.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W].
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.edit import EditOptions
from p3i.paint.fill.cleared import cleared, covered, hanging, local_points, object_masks, windows
from p3i.paint.fill.completed import Completed, completed
from p3i.paint.fill.cutout import Cutout, cutout, doubts
from p3i.paint.fill.filled import share_text
from p3i.paint.fill.holes import hidden_ground, on_flat
from p3i.paint.fill.sampled import Levels
from p3i.place.continued import followed
from p3i.place.flat import flat_of
from p3i.place.moves import frames, pitch_px
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed, placed
from p3i.records import changed
from p3i.vision.image import Image, masked
from p3i.vision.picture import Picture, opacity, repainted
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]
Progress = Callable[[str, float], None]

# Objects this near to each other, in distances to the next, are one object.
_SAME = 0.05
# An object is worth copying where it is at most this many times farther from the median than a typical one.
_GOOD = 1.5
_GAINS = (0.6, 1.6)
# A pixel that an object covers by as much is its own.
_LEAST_OWN = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Edited:
    """A photo with its objects laid anew: `pixels` float32 [H, W, 3], other than the photo's where `touched`.

    `kept`, `removed` and `copied` count the objects on the photo. `filled` [H, W] is hidden ground that was
    filled first, a part of `touched`; `unlike` the share of all hidden ground for which the program knows
    nothing like it; `added` are the (i, j) with which the old program goes on over it.
    """

    photo: Image
    pixels: Floats
    touched: Mask
    kept: int
    removed: int
    copied: int
    filled: Mask
    unlike: float = 0.0
    added: tuple[tuple[int, int], ...] = ()
    notes: tuple[str, ...] = ()

    def paint(self) -> Picture:
        """The picture in the photo's depth, as transparent as it was, but for what was filled."""
        alpha = opacity(self.photo)
        return repainted(
            self.photo,
            self.pixels,
            alpha=None if alpha is None else np.where(self.filled, np.float32(1), alpha),
        )

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the picture as Picture.save does."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        return {
            "photo": [self.photo.size.width, self.photo.size.height],
            "kept": self.kept,
            "removed": self.removed,
            "copied": self.copied,
            "touched": round(float(self.touched.mean()), 4),
            "filled": int(self.filled.sum()),
            "unlike": round(self.unlike, 4),
            "added": [list(index) for index in self.added],
            "notes": list(self.notes),
        }


def edit(
    photo: Image,
    old: Program,
    new: Program,
    options: EditOptions | None = None,
    *,
    mask: str | PathLike[str] | Mask | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> Edited:
    """The photo with the objects of `old` laid as `new` says; `changes` are fields of EditOptions.

    The camera is that of `old` where `new` names none. What `mask` marks, a picture (white is hidden) or bool
    [H, W], and what is transparent, is filled first, and both programs go on over it.

    Raises UsageError for options that cannot be, ProgramError for a program without objects, UsageError where
    no object of `old` is on the photo; for the mask as `inpaint` does.
    """
    asked: EditOptions = changed(options or EditOptions(), changes, verb="edit")
    hidden, hole = hidden_ground(photo, mask, keep_transparent=asked.keep_transparent)
    flat = flat_of(photo, old, focal_mm=asked.focal_mm)
    if not flat.placed.in_sight().any():
        raise UsageError("no object of the old program lies on the photo: there is nothing to copy")
    whole = completed(flat, on_flat(flat, hole), progress=progress)
    # What was transparent stays so where the pattern does not go on.
    if whole.bare.any():
        valid = whole.photo.valid & (whole.known | ~whole.bare | on_flat(flat, hidden))
        whole = dataclasses.replace(whole, photo=dataclasses.replace(whole.photo, valid=valid))
    wanted = flat.laid(placed(_with_camera(new, old), photo, focal_mm=_focal(new, flat.placed, asked)))
    if len(whole.more.index):
        wanted = followed(wanted, whole.laid, whole.more).joined(wanted)
    pixels, touched, counts, notes = _laid_anew(whole, wanted, asked)
    # A bent photo is edited where it is straight, and what was touched is bent back.
    bare, touched = flat.bent_mask(whole.bare) & hole, flat.bent_mask(touched, least=0)
    pixels = flat.bent(pixels)
    filled = hole & ~(bare & ~hidden)
    touched = (touched & (photo.valid | filled)) | filled
    unlike = float(bare.sum() / max(1, hole.sum()))
    said = [f"{counts[0]} objects kept, {counts[1]} removed, {counts[2]} added", *whole.more.notes()]
    if part := share_text(bare, hole):
        said.append(f"for {part} the program has nothing like it: " + _what_of(bare, hidden))
    return Edited(
        photo,
        np.where(touched[:, :, None], pixels, photo.pixels),
        touched,
        *counts,
        filled=filled,
        unlike=unlike,
        added=tuple((int(i), int(j)) for i, j in whole.more.index),
        notes=(*said, *notes),
    )


def _what_of(bare: Mask, hidden: Mask) -> str:
    """What becomes of ground that is not pattern, by whether a mask hid it or it was transparent."""
    if not (bare & ~hidden).any():
        return "the surroundings are continued"
    return "it stays transparent" if not (bare & hidden).any() else "what was transparent of it stays so"


def _with_camera(new: Program, old: Program) -> Program:
    """`new`, seen by the camera of `old` unless it was written with one of its own."""
    unsaid = new.camera.span is None and not new.camera.rx_deg and not new.camera.ry_deg
    return dataclasses.replace(new, camera=old.camera) if unsaid else new


def _focal(new: Program, laid: Placed, asked: EditOptions) -> float:
    said = new.header.focal_mm if new.header else None
    return said if said is not None and asked.focal_mm is None else laid.camera.focal_mm


def _laid_anew(
    whole: Completed, wanted: Placed, options: EditOptions
) -> tuple[Floats, Mask, tuple[int, int, int], list[str]]:
    """The flat photo laid anew, where it was touched, how many objects are kept, removed, copied; notes."""
    photo, laid = whole.photo, whole.laid
    old_place, new_place = _kept(laid, wanted)
    gone = np.setdiff1d(np.arange(len(laid.index)), old_place)
    fresh = np.setdiff1d(np.arange(len(wanted.index)), new_place)
    touched = np.zeros(photo.valid.shape, bool)
    counts = (
        int(laid.in_sight()[old_place].sum()),
        int(laid.in_sight()[gone].sum()),
        int(wanted.in_sight()[fresh].sum()),
    )
    if not len(gone) and not len(fresh):
        return photo.pixels, touched, counts, []
    # What was filled shows what the others do already, and is no object to copy.
    cut = cutout(laid, masked(photo, ~whole.known))
    notes = doubts(cut)
    ground, every = cleared(photo.pixels, photo.valid, laid, cut)
    own = _mask(_only(laid, old_place), cut)
    removed = covered(_only(laid, gone), cut) & (own < _LEAST_OWN) & photo.valid
    removed |= hanging(every & ~covered(laid, cut), removed)
    pixels = np.where(removed[:, :, None], ground, photo.pixels)
    scale = options.scale
    if scale is None:
        scale = min(1.0, pitch(chart_of(wanted.pattern)) / pitch(chart_of(laid.pattern)))
        if scale < 0.99:
            notes.append(
                f"new objects are made {scale:.0%} as large, as their spacing is: --scale 1 keeps their size"
            )
    painted = _paint(pixels, ground, photo, laid, _only(wanted, fresh), cut, scale, own)
    return pixels, (removed | painted) & photo.valid, counts, notes


def _kept(laid: Placed, wanted: Placed) -> tuple[Index, Index]:
    """The objects of both programs that stand at the same places: their numbers in the old, in the new."""
    old_px, old_front = laid.centers_px()
    new_px, new_front = wanted.centers_px()
    pairs: list[tuple[int, int]] = []
    taken: set[int] = set()
    for number in np.flatnonzero(new_front):
        apart = np.where(old_front, np.hypot(*(old_px - new_px[number]).T), np.inf)
        near = int(np.argmin(apart))
        if near not in taken and apart[near] <= _SAME * pitch_px(laid, near):
            pairs.append((near, int(number)))
            taken.add(near)
    found = np.array(pairs, np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _only(laid: Placed, numbers: Index) -> Placed:
    """The program with some of its objects; the pattern is that of all."""
    return dataclasses.replace(laid, index=laid.index[numbers], points=laid.points[numbers])


def _mask(laid: Placed, cut: Cutout) -> Floats:
    """How much of each pixel the objects cover: [H, W]."""
    found = np.zeros((laid.size.height, laid.size.width), np.float32)
    for window, alpha in object_masks(laid, cut.alpha, cut.step):
        found[window] = np.maximum(found[window], alpha)
    return found


def _paint(
    pixels: Floats,
    ground: Floats,
    photo: Image,
    laid: Placed,
    wanted: Placed,
    cut: Cutout,
    scale: float,
    own: Floats,
) -> Mask:
    """Paint an object of the photo at each place of `wanted` into `pixels`; which were touched [H, W]."""
    good = np.flatnonzero(np.isfinite(cut.misfit))
    if len(good):
        good = good[cut.misfit[good] <= _GOOD * np.median(cut.misfit[good])]
    else:
        good = np.flatnonzero(laid.in_sight())
    old_px, _ = laid.centers_px()
    new_px, new_front = wanted.centers_px()
    old_frames, new_frames = frames(laid), frames(wanted)
    levels = Levels.of(photo.pixels)
    touched = np.zeros(photo.valid.shape, bool)
    for number, window in enumerate(windows(wanted, cut.alpha, cut.step, scale=scale)):
        if window is None or not new_front[number]:
            continue
        source = int(good[np.argmin(np.hypot(*(old_px[good] - new_px[number]).T))])
        local = local_points(wanted, new_frames[number], window) / scale
        rows, columns = window
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        frame = old_frames[source]
        at, front = project(laid.image_from_plane, local @ frame[:2, :2].T + frame[:2, 2])
        alpha = cut.at(local).reshape(shape) * (1 - own[window]) * front.reshape(shape)
        alpha *= photo.valid[window]
        if not (alpha > 0).any():
            continue
        pixel_at = at.reshape(*shape, 2)
        steps = [
            np.hypot(*np.moveaxis(np.diff(pixel_at, axis=axis), -1, 0)) for axis in (0, 1) if shape[axis] > 1
        ]
        shrink = float(np.median(np.concatenate([step.ravel() for step in steps]))) if steps else 1.0
        colours = levels.read(at, shrink).reshape(*shape, 3)
        gain = _gain(ground, window, alpha, at.reshape(*shape, 2))
        mixed = pixels[window] + alpha[:, :, None] * (np.clip(colours * gain, 0, 1) - pixels[window])
        pixels[window] = np.where(alpha[:, :, None] > 0, mixed, pixels[window])
        touched[window] |= alpha > 0
    return touched


def _gain(ground: Floats, window: tuple[slice, slice], alpha: Floats, at: Array) -> Floats:
    """How much lighter the ground under the new object is than under the one that is copied: [3]."""
    inside = alpha > 0.5 if (alpha > 0.5).any() else alpha > 0
    here = ground[window][inside].mean(0)
    height, width = ground.shape[:2]
    x = np.clip(np.rint(at[inside][:, 0]), 0, width - 1).astype(int)
    y = np.clip(np.rint(at[inside][:, 1]), 0, height - 1).astype(int)
    there = ground[y, x].mean(0)
    return np.clip((here + 0.02) / (there + 0.02), *_GAINS).astype(np.float32)

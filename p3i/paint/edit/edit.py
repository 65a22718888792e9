"""The objects of a photo laid anew: those of an old program taken away, those of a new one put in.

An object of the new program that stands where one of the old does keeps its own pixels. The others of the
old are removed (cleared.py); each other place of the new gets the nearest good object of the photo, cut out
of its ground (cutout.py), turned with its ring and in the light of its new place.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W].
"""

import dataclasses
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.edit import EditOptions
from p3i.paint.fill.cleared import cleared, covered, local_points, object_masks, windows
from p3i.paint.fill.cutout import Cutout, Levels, cutout, doubts
from p3i.place.flat import flat_of
from p3i.place.moves import frames, pitch_px
from p3i.place.outlines import chart_of, pitch
from p3i.place.placed import Placed, placed
from p3i.records import changed
from p3i.vision.image import Image
from p3i.vision.picture import Picture, opacity, repainted
from p3i.vision.sheet import project

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]

# Objects this near to each other, in distances to the next, are one object.
_SAME = 0.05
# An object is worth copying where it is at most this many times farther from the median than a typical one.
_GOOD = 1.5
_GAINS = (0.6, 1.6)


@dataclass(frozen=True, slots=True, eq=False)
class Edited:
    """A photo with its objects laid anew: `pixels` float32 [H, W, 3], other than the photo's where `touched`.

    `kept`, `removed` and `added` count the objects on the photo.
    """

    photo: Image
    pixels: Floats
    touched: Mask
    kept: int
    removed: int
    added: int
    notes: tuple[str, ...] = ()

    def paint(self) -> Picture:
        """The picture in the photo's depth, as transparent as it was."""
        return repainted(self.photo, self.pixels, alpha=opacity(self.photo))

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the picture as Picture.save does."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        return {
            "photo": [self.photo.size.width, self.photo.size.height],
            "kept": self.kept,
            "removed": self.removed,
            "added": self.added,
            "touched": round(float(self.touched.mean()), 4),
        }


def edit(
    photo: Image, old: Program, new: Program, options: EditOptions | None = None, **changes: Any
) -> Edited:
    """The photo with the objects of `old` laid as `new` says; `changes` are fields of EditOptions.

    The camera is that of `old` where `new` names none. Raises UsageError for options that cannot be,
    ProgramError for a program without objects, UsageError where no object of `old` is on the photo.
    """
    asked: EditOptions = changed(options or EditOptions(), changes, verb="edit")
    flat = flat_of(photo, old, focal_mm=asked.focal_mm)
    laid = flat.placed
    if not laid.in_sight().any():
        raise UsageError("no object of the old program lies on the photo: there is nothing to copy")
    wanted = flat.laid(placed(_with_camera(new, old), photo, focal_mm=_focal(new, laid, asked)))
    found = _edited(flat.photo, laid, wanted, asked)
    if flat.k1 is None:
        return dataclasses.replace(found, photo=photo)
    # A bent photo is edited where it is straight, and what was touched is bent back.
    touched = flat.bent(np.repeat(found.touched[:, :, None], 3, 2).astype(np.float32))[:, :, 0] > 0
    pixels = np.where(touched[:, :, None], flat.bent(found.pixels), photo.pixels).astype(np.float32)
    return dataclasses.replace(found, photo=photo, pixels=pixels, touched=touched)


def _with_camera(new: Program, old: Program) -> Program:
    """`new`, seen by the camera of `old` unless it was written with one of its own."""
    unsaid = new.camera.span is None and not new.camera.rx_deg and not new.camera.ry_deg
    return dataclasses.replace(new, camera=old.camera) if unsaid else new


def _focal(new: Program, laid: Placed, asked: EditOptions) -> float:
    said = new.header.focal_mm if new.header else None
    return said if said is not None and asked.focal_mm is None else laid.camera.focal_mm


def _edited(photo: Image, laid: Placed, wanted: Placed, options: EditOptions) -> Edited:
    old_place, new_place = _kept(laid, wanted)
    gone = np.setdiff1d(np.arange(len(laid.index)), old_place)
    fresh = np.setdiff1d(np.arange(len(wanted.index)), new_place)
    touched = np.zeros(photo.valid.shape, bool)
    counts = (
        int(laid.in_sight()[old_place].sum()),
        int(laid.in_sight()[gone].sum()),
        int(wanted.in_sight()[fresh].sum()),
    )
    notes = [f"{counts[0]} objects kept, {counts[1]} removed, {counts[2]} added"]
    if not len(gone) and not len(fresh):
        return Edited(photo, photo.pixels, touched, *counts, tuple(notes))
    cut = cutout(laid, photo)
    notes += doubts(cut)
    own = _mask(_only(laid, old_place), cut)
    removed = covered(_only(laid, gone), cut) & (own < 0.02) & photo.valid
    ground = cleared(photo.pixels, photo.valid, laid, cut)
    pixels = np.where(removed[:, :, None], ground, photo.pixels)
    scale = options.scale
    if scale is None:
        scale = min(1.0, pitch(chart_of(wanted.pattern)) / pitch(chart_of(laid.pattern)))
        if scale < 0.99:
            notes.append(
                f"new objects are made {scale:.0%} as large, as their spacing is: --scale 1 keeps their size"
            )
    painted = _paint(pixels, ground, photo, laid, _only(wanted, fresh), cut, scale, own)
    touched = (removed | painted) & photo.valid
    pixels = np.where(touched[:, :, None], pixels, photo.pixels).astype(np.float32)
    return Edited(photo, pixels, touched, *counts, tuple(notes))


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

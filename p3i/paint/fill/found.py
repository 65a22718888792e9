"""Where a pattern is marred: parts of its cells that differ from all other cells, proposed as a hole to fill.

What is found is an outlier in two ways: it differs from the likest other cells by a good part of the
pattern's own contrast, and by more bits than as many places of a pattern without a flaw would show once in
twenty pictures (differing.py). Nothing is filled here.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W].
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.paint.fill.cleared import object_masks
from p3i.paint.fill.differing import Differing, differing
from p3i.place.flat import flat_of
from p3i.place.moves import frames, pitch_px
from p3i.place.naming import named
from p3i.place.outlines import chart_of
from p3i.place.placed import Placed
from p3i.vision.image import Image
from p3i.vision.picture import Picture

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# False finds that pictures without a flaw would show; places of a cell that are looked at, each for itself.
_FALSE_ALARMS = 0.05
_PLACES = 200
# A find differs by this share of the pattern's contrast and is this share of a cell; what is
# connected with it and differs by less is of it.
_LEAST_DIFFERENCE, _LEAST_SHARE = 0.6, 0.03
_GROWN_DIFFERENCE, _GROWN_BITS = 0.3, 3.0
# Towards a place beside it where nothing is drawn, so much of a cell's way there is of the pattern.
_RIM = 0.2
_SAME = 0.1
# The mask reaches this much further, in distances between objects: things end softly.
_WIDER = 0.05
_WIDER_PX = 1.5
# Of an overlay, how much is the mark.
_MARK, _MARK_SHARE = (1.0, 0.0, 0.6), 0.55


@dataclass(frozen=True, slots=True)
class Mar:
    """One place where the pattern is marred: its box (x, y, width, height) and size in pixels of the photo.

    `objects` are the names of the objects whose cells it lies in with the share of each cell, most first;
    `bits` how much likelier it is another thing than one of the pattern.
    """

    pixels: int
    box: tuple[int, int, int, int]
    objects: tuple[tuple[str, float], ...]
    bits: float

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        objects = [{"name": name, "share": round(share, 3)} for name, share in self.objects]
        return {"pixels": self.pixels, "box": list(self.box), "objects": objects, "bits": round(self.bits, 1)}

    def sentence(self) -> str:
        """Where it is, in words."""
        x, y, width, height = self.box
        cells = ", ".join(f"{name} {share:.0%}" for name, share in self.objects[:4])
        more = ", ..." if len(self.objects) > 4 else ""
        return f"marred: {width} x {height} px at {x},{y}, of the cells {cells}{more} ({self.bits:.0f} bits)"


@dataclass(frozen=True, slots=True, eq=False)
class Marred:
    """What of a photo's pattern is marred: `mask` [H, W] is proposed to be filled, nothing of it was."""

    photo: Image
    mask: Mask
    mars: tuple[Mar, ...]
    notes: tuple[str, ...]

    def paint(self) -> Picture:
        """The mask as `--mask` reads it: white is to be filled."""
        return Picture(np.repeat(self.mask[:, :, None], 3, 2).astype(np.uint8) * 255)

    def overlay(self) -> Picture:
        """The photo with what was found marked, to be looked at."""
        marked = self.photo.pixels + _MARK_SHARE * (np.array(_MARK, np.float32) - self.photo.pixels)
        pixels = np.where(self.mask[:, :, None], marked, self.photo.pixels)
        return Picture(np.rint(pixels.clip(0, 1) * 255).astype(np.uint8))

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the mask as Picture.save does."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        return {
            "photo": [self.photo.size.width, self.photo.size.height],
            "marred": int(self.mask.sum()),
            "found": [one.record() for one in self.mars],
            "notes": list(self.notes),
        }


def find_marred(photo: Image, program: Program, *, focal_mm: float | None = None) -> Marred:
    """What of the pattern on `photo` differs from all of its other cells.

    Raises UsageError where too few cells are to be seen; ProgramError for a program without objects.
    """
    flat = flat_of(photo, program, focal_mm=focal_mm)
    laid = flat.placed
    found = differing(laid, flat.photo)
    if found is None:
        raise UsageError("too few cells of the pattern are to be seen to tell which of them is marred")
    mask, bits = _on_photo(laid, found, flat.photo.valid.shape)
    mask &= flat.photo.valid
    names = named(laid).names
    mars = _mars(mask, bits, _cells_of(laid, found), names)
    notes = _notes(found, mars)
    if flat.k1 is not None:
        mask = flat.bent_mask(mask, least=0.25) & photo.valid
    return Marred(photo, mask, mars, notes)


def beside_hole(photo: Image, laid: Placed, hole: Mask) -> tuple[Mask, Mask]:
    """Where objects differ too much from one another to be filled in, and what is not of the pattern: [H, W].

    Both of a straight photo, the second beside its hole [H, W] only; nothing where too few cells are seen.
    """
    found = differing(laid, photo, hole=hole)
    guess = np.zeros(hole.shape, bool)
    if found is None:
        return guess, guess.copy()
    if found.guess.any():
        for window, seen in object_masks(laid, found.guess.astype(np.float32), found.step):
            guess[window] |= seen > 0.5
    return guess, _on_photo(laid, found, hole.shape)[0] & ~hole


def _on_photo(laid: Placed, found: Differing, size: tuple[int, ...]) -> tuple[Mask, Floats]:
    """What is marred on the photo [H, W], and by how many bits [H, W]."""
    areas, strength = _areas(found, _of_pattern(laid, found))
    mask, bits = np.zeros(size, bool), np.zeros(size, np.float32)
    for number in np.flatnonzero(areas.any((1, 2))):
        one = dataclasses.replace(laid, index=laid.index[[number]], points=laid.points[[number]])
        for window, seen in object_masks(one, areas[number].astype(np.float32), found.step):
            wider = 2 * round(_WIDER_PX + _WIDER * pitch_px(laid, int(number))) + 1
            rows, columns = (slice(max(0, part.start - wider), part.stop + wider) for part in window)
            whole = np.zeros(mask[rows, columns].shape, np.uint8)
            top, left = window[0].start - rows.start, window[1].start - columns.start
            whole[top : top + seen.shape[0], left : left + seen.shape[1]] = seen > 0.5
            grown = cv2.dilate(whole, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wider, wider))) > 0
            mask[rows, columns] |= grown
            part = bits[rows, columns]
            part[grown] = np.maximum(part[grown], strength[number])
    return mask, bits


def _of_pattern(laid: Placed, found: Differing) -> Mask:
    """Which places of each cell [N, side, side] are the pattern's: not those towards what is not drawn.

    Beyond the pattern's rim lies another ground, of which a cell has its part.
    """
    chart = chart_of(laid.pattern)
    half = (found.own.shape[0] - 1) / 2
    y, x = (np.mgrid[: found.own.shape[0], : found.own.shape[0]] - half) * found.step
    result = np.repeat((found.own > 0)[None], len(laid.index), 0)
    drawn = {(i, j) for i, j in laid.index.tolist()}
    turned = frames(laid)[:, :2, :2]
    for variable in chart.directions:
        for way in (1, -1):
            beside = laid.index.copy()
            beside[:, variable] += way
            steps = laid.at(beside) - laid.points
            # A ring closes: its last object stands beside its first.
            closest = np.hypot(*(laid.at(beside)[:, None] - laid.points).transpose(2, 0, 1)).min(1)
            for number, ((i, j), step) in enumerate(zip(beside.tolist(), steps, strict=True)):
                length = float(np.hypot(*step))
                if (i, j) in drawn or length < 1e-9 or closest[number] < _SAME * length:
                    continue
                across = step @ turned[number]
                result[number] &= (x * across[0] + y * across[1]) / length**2 < _RIM
    return result


def _areas(found: Differing, judged: Mask) -> tuple[Mask, NDArray[np.float64]]:
    """Which places of each cell are marred [N, side, side], and by how many bits at most [N]."""
    inner = found.own > 0
    need = np.log2(max(1, len(judged)) * _PLACES / _FALSE_ALARMS)
    sure = (found.bits > need) & (found.difference > _LEAST_DIFFERENCE * found.contrast)
    sure &= judged & ~found.guess
    grown = judged & (found.bits > _GROWN_BITS) & (found.difference > _GROWN_DIFFERENCE * found.contrast)
    areas = np.zeros(sure.shape, bool)
    for number in np.flatnonzero(sure.sum((1, 2)) > _LEAST_SHARE * inner.sum()):
        labels = cv2.connectedComponents((grown[number] | sure[number]).astype(np.uint8), connectivity=4)[1]
        areas[number] = np.isin(labels, np.unique(labels[sure[number]])) & inner
    return areas, found.bits.max((1, 2))


def _cells_of(laid: Placed, found: Differing) -> NDArray[np.int64]:
    """The number of the object in whose cell each pixel lies, -1 for none: [H, W]."""
    numbers = np.full((laid.size.height, laid.size.width), -1, np.int64)
    own = np.clip(found.own, 0, None).astype(np.float32)
    for number in range(len(laid.index)):
        one = dataclasses.replace(laid, index=laid.index[[number]], points=laid.points[[number]])
        for window, seen in object_masks(one, own, found.step):
            numbers[window][seen > 0] = number
    return numbers


def _mars(mask: Mask, bits: Floats, cells: NDArray[np.int64], names: tuple[str, ...]) -> tuple[Mar, ...]:
    """What hangs together of the mask, the surest first."""
    labels, stats = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)[1:3]
    sizes = np.bincount(cells[cells >= 0].ravel(), minlength=len(names))
    found: list[Mar] = []
    for label in range(1, len(stats)):
        x, y, width, height, pixels = stats[label].tolist()
        part = slice(y, y + height), slice(x, x + width)
        inside = labels[part] == label
        own = cells[part][inside]
        numbers, counts = np.unique(own[own >= 0], return_counts=True)
        shares: list[tuple[str, float]] = sorted(
            (
                (names[number], float(count / sizes[number]))
                for number, count in zip(numbers, counts, strict=True)
            ),
            key=lambda one: -one[1],
        )
        told = [one for one in shares if one[1] >= 0.01]
        found.append(Mar(pixels, (x, y, width, height), tuple(told), float(bits[part][inside].max())))
    return tuple(sorted(found, key=lambda one: -one.bits))


def _notes(found: Differing, mars: Sequence[Mar]) -> tuple[str, ...]:
    notes = [one.sentence() for one in mars]
    if not mars:
        notes.append("nothing is marred: no cell differs from all others more than they do from one another")
    share = float(found.guess.sum() / max(1, (found.own > 0).sum()))
    if share >= 0.01:
        notes.append(
            f"at {share:.0%} of a cell the objects differ from one another: nothing is told of there"
        )
    return tuple(notes)

"""A seamless texture of a pattern's cell: the robust mean of its cells, or the best of them."""

import dataclasses
from dataclasses import dataclass
from os import PathLike
from typing import Any

import cv2
import numpy as np

from p3i.errors import ProgramError
from p3i.grammar.ast import Program
from p3i.options.tile import TileOptions
from p3i.paint.straight.light import Light, even, fitted_light
from p3i.paint.straight.patches import Patch, Patches, finest, in_photo, patches_of
from p3i.paint.straight.seam import Seam, seam_of, wrapped
from p3i.paint.straight.supercell import TOLERANCE_DEG
from p3i.place.placed import placed
from p3i.records import changed
from p3i.size import Size, refuse_huge
from p3i.vision.image import Image
from p3i.vision.picture import Picture, depth, opacity
from p3i.vision.resample import resample

_MOST_PATCHES, _MOST_SAMPLES = 64, 10_000_000
"""No tile is made of more patches, or of more pixels of patches, than this; the nearest are taken."""

_LEAST_SEEN = 0.25
"""A patch of which less than this is known is left out."""

_LIGHT_SIDE = 20
"""The light is fitted to this many places a side of each patch."""

_MOST_SHIFT = 0.08
"""Cells that lie off their place by more than this share of a side are not moved onto it."""

_OVERLAP = 0.16
"""The share of a tile's sides over which it is blended into what follows on the other side."""


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One tile: float32 `pixels` [H, W, 3] in 0..1, `known` [H, W]; `patches` says what it is made of.

    `used` are the (i, j) of the cells, `light` is the gain that was removed, `seam` how well it wraps.
    """

    pixels: np.ndarray
    known: np.ndarray
    patches: Patches
    used: tuple[tuple[int, int], ...]
    light: Light
    seam: Seam
    options: TileOptions
    bits: int
    icc: bytes | None
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """The canvas of one tile."""
        return Size(self.pixels.shape[1], self.pixels.shape[0])

    def paint(self) -> Picture:
        """The tile, repeated as the options ask."""
        top = 2**self.bits - 1
        kind = np.uint8 if self.bits == 8 else np.uint16
        across, down = self.options.repeat
        values = np.tile(np.rint(self.pixels * top).astype(kind), (down, across, 1))
        alpha = None if self.known.all() else np.tile(self.known.astype(kind) * kind(top), (down, across))
        return Picture(values, alpha, self.icc)

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Paint and write the tile: `Picture.save`."""
        self.paint().save(path, kind=kind, force=force)

    def record(self) -> dict[str, Any]:
        """What the tile is, as plain JSON values; docs/rectify.md says what each means."""
        cell = self.patches.cell
        return {
            "tile": [self.size.width, self.size.height],
            "repeat": list(self.options.repeat),
            "from": self.options.source,
            "structure": "ring" if cell is None else "lattice",
            "cells": 1 if cell is None else cell.cells,
            "sides": None if cell is None else cell.steps.tolist(),
            "shear_deg": None if cell is None else round(cell.shear_deg, 4) + 0.0,
            "used": [list(index) for index in self.used],
            "seam": self.seam.record(),
        }


def tile(photo: Image, program: Program, options: TileOptions | None = None, **changes: Any) -> Tile:
    """The texture of `photo`'s pattern by `program`; `changes` are fields of TileOptions.

    Raises ProgramError for a program that is neither a lattice nor rings or has no object on the photo,
    UsageError for options that cannot be.
    """
    options = changed(options or TileOptions(), changes, verb="tile")
    laid = placed(program, photo, focal_mm=options.focal_mm)
    k1 = (program.header.lens_k1 if program.header else None) or None
    patches = patches_of(laid)
    size = options.size or _size(patches)
    whole = Size(size.width * options.repeat[0], size.height * options.repeat[1])
    refuse_huge(whole, max_px=options.max_px)
    larger = _larger(size, down=patches.cell is not None)
    stack = _stack(photo, patches, size, larger, k1=k1)
    light = even()
    if options.light:
        light = _light(stack)
        stack = _lit(stack, light)
    mean, _ = robust_mean(stack.values, stack.seen)
    stack = _registered(stack, photo, mean, k1=k1, light=light)
    mean, seen = robust_mean(stack.values, stack.seen)
    used = tuple(patch.index for patch in stack.pieces)
    notes = list(photo.notes)
    pixels, known = wrapped(mean, seen, size)
    if options.source == "best":
        best = _best(stack, mean, size)
        own = np.where(stack.seen[best][:, :, None], stack.values[best] / np.float32(65535), mean)
        pixels, known = wrapped(own, seen, size)
        used = (stack.pieces[best].index,)
    cell = patches.cell
    if cell is not None and not cell.rectangular:
        notes.append(
            f"no small rectangle repeats in this lattice within {TOLERANCE_DEG:g} degrees: the nearest is "
            f"skewed by {cell.shear_deg:.1f} degrees, which the tile straightens"
        )
    if not known.all():
        notes.append(f"{100 * (1 - known.mean()):.1f} % of the tile is seen in no cell, and transparent")
    pixels = np.clip(pixels, 0, 1).astype(np.float32)
    seam = seam_of(pixels, known, down=cell is not None)
    return Tile(
        pixels,
        known,
        patches,
        used,
        light,
        seam,
        options,
        depth(photo),
        photo.source.icc,
        tuple(notes),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Stack:
    """Patches as arrays: `values` uint16 [K, H, W, 3], `seen` [K, H, W].

    A tile is of `size`; the arrays go on beyond its right and lower side, for what is blended there.
    """

    patches: Patches
    pieces: tuple[Patch, ...]
    values: np.ndarray
    seen: np.ndarray
    size: Size

    @property
    def larger(self) -> Size:
        """The canvas of the arrays."""
        return Size(self.seen.shape[2], self.seen.shape[1])

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """The pixel centres of a patch: x [W], y [H]; the tile itself runs from -0.5 to 0.5."""
        return _places(self.size, self.larger)


def _size(patches: Patches) -> Size:
    """As many pixels as the photo has for a cell at the pattern's middle, where it is sharpest there."""
    centers = np.array([piece.center for piece in patches.pieces])
    middle = centers[np.argsort(np.linalg.norm(centers - centers.mean(axis=0), axis=1), kind="stable")[:1]]
    width, height = np.maximum(8, np.round(patches.extent * finest(patches.placed, middle))).astype(int)
    return Size(int(width), int(height))


def _larger(size: Size, *, down: bool) -> Size:
    """The canvas of the patches: a tile and what is blended into its other side."""
    across, below = (max(2, round(_OVERLAP * side)) for side in (size.width, size.height))
    return Size(size.width + across, size.height + (below if down else 0))


def _sampled(
    photo: Image,
    patches: Patches,
    piece: Patch,
    size: Size,
    larger: Size,
    *,
    k1: float | None,
    shift: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """One patch: uint16 [H, W, 3], and what of it the photo knows and the program draws."""
    points = in_photo(patches.placed, piece, size, k1=k1, shift=shift)
    values, alpha = resample(photo.pixels, opacity(photo), points, size=larger, bits=16)
    drawn = patches.drawn(piece, *_places(size, larger))
    return values, drawn if alpha is None else drawn & (alpha >= 0x8000)


def _places(size: Size, larger: Size) -> tuple[np.ndarray, np.ndarray]:
    across = (np.arange(larger.width) + 0.5) / size.width - 0.5
    return across, (np.arange(larger.height) + 0.5) / size.height - 0.5


def _stack(photo: Image, patches: Patches, size: Size, larger: Size, *, k1: float | None) -> _Stack:
    most = int(np.clip(_MOST_SAMPLES // (larger.width * larger.height), 1, _MOST_PATCHES))
    pieces: list[Patch] = []
    values: list[np.ndarray] = []
    seen: list[np.ndarray] = []
    for piece in patches.pieces:
        found, known = _sampled(photo, patches, piece, size, larger, k1=k1)
        if known[: size.height, : size.width].mean() >= _LEAST_SEEN:
            pieces.append(piece)
            values.append(found)
            seen.append(known)
        if len(pieces) == most:
            break
    if not pieces:
        raise ProgramError("no cell of the pattern is seen well enough to make a tile of")
    return _Stack(patches, tuple(pieces), np.stack(values), np.stack(seen), size)


def _light(stack: _Stack) -> Light:
    """The light over the cells, from a few hundred places of each, averaged around."""
    larger = stack.larger
    side = Size(min(_LIGHT_SIDE, larger.width), min(_LIGHT_SIDE, larger.height))
    # The small canvas covers the large one: its pixels are as much larger as they are fewer.
    share = larger.width / stack.size.width, larger.height / stack.size.height
    x = (np.arange(side.width) + 0.5) / side.width * share[0] - 0.5
    y = (np.arange(side.height) + 0.5) / side.height * share[1] - 0.5
    small = (side.width, side.height)
    values = [cv2.resize(value, small, interpolation=cv2.INTER_AREA) for value in stack.values]
    seen = [
        cv2.resize(known.astype(np.float32), small, interpolation=cv2.INTER_AREA) > 0.999
        for known in stack.seen
    ]
    points = np.stack([piece.plane(x, y) for piece in stack.pieces])
    count = len(stack.pieces)
    return fitted_light(
        np.stack(values).reshape(count, -1, 3) / 65535.0,
        np.stack(seen).reshape(count, -1),
        points.reshape(count, -1, 2),
    )


def _lit(stack: _Stack, light: Light) -> _Stack:
    """The stack in even light."""
    pairs = zip(stack.values, stack.pieces, strict=True)
    values = np.stack([_relit(value, piece.plane(*stack.places), light) for value, piece in pairs])
    return dataclasses.replace(stack, values=values)


def _relit(value: np.ndarray, plane: np.ndarray, light: Light) -> np.ndarray:
    if not len(light.terms):
        return value
    gain = light.gain(plane.astype(np.float32))
    return np.clip(value / gain + np.float32(0.5), 0, 65535).astype(np.uint16)


def robust_mean(values: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mean [H, W, 3] (0..1) of uint16 patches [K, H, W, 3] without what stands out; where any is seen.

    About the median: samples farther from it than 2.5 times the typical distance are left out.
    """
    count, height, width, _ = values.shape
    mean = np.zeros((height, width, 3), np.float32)
    rows = max(1, 1_000_000 // (count * width * 3))
    for first in range(0, height, rows):
        part = slice(first, first + rows)
        # Patches last: sorting and summing run along memory.
        block = np.ascontiguousarray(np.moveaxis(values[:, part], 0, -1))
        known = np.ascontiguousarray(np.moveaxis(seen[:, part], 0, -1))
        middle = _median(block, known[:, :, None, :])
        apart = np.abs(block.astype(np.int32) - middle[..., None]).sum(axis=2) // 3
        typical = _median(apart.astype(np.uint16), known)
        near = known & (apart <= 2.5 * typical[..., None] + 128)
        total = np.einsum("hwck,hwk->hwc", block.astype(np.float32), near.astype(np.float32))
        mean[part] = total / (65535 * np.maximum(near.sum(axis=-1), 1)[:, :, None])
    return mean, np.asarray(seen.any(axis=0))


def _median(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The (lower) median of uint16 [..., K] over the known; 65535 where nothing is."""
    ordered = np.sort(np.where(known, values, np.uint16(65535)), axis=-1)
    at = np.maximum(np.broadcast_to(known, values.shape).sum(axis=-1) - 1, 0) // 2
    return np.take_along_axis(ordered, at[..., None], axis=-1)[..., 0].astype(np.int32)


def _registered(stack: _Stack, photo: Image, mean: np.ndarray, *, k1: float | None, light: Light) -> _Stack:
    """The stack with cells that lie a little off moved onto the mean, where that makes them more alike."""
    size, larger = stack.size, stack.larger
    if min(size.width, size.height) < 16 or len(stack.pieces) < 3:
        return stack
    window = cv2.createHanningWindow((larger.width, larger.height), cv2.CV_32F)
    grey = np.ascontiguousarray(mean.mean(axis=2))
    values, seen = stack.values.copy(), stack.seen.copy()
    for k, piece in enumerate(stack.pieces):
        here = np.where(seen[k][:, :, None], values[k] / np.float32(65535), mean)
        (x, y), _ = cv2.phaseCorrelate(grey, np.ascontiguousarray(here.mean(axis=2), np.float32), window)
        shift = np.array([x, y])
        if (np.abs(shift) > _MOST_SHIFT * np.array([size.width, size.height])).any() or np.hypot(x, y) < 0.05:
            continue
        moved, known = _sampled(photo, stack.patches, piece, size, larger, k1=k1, shift=shift)
        moved = _relit(moved, piece.plane(*stack.places), light)
        both = known & seen[k]
        if both.mean() < 0.5 * seen[k].mean():
            continue
        before = np.abs(values[k][both] / np.float32(65535) - mean[both]).mean()
        if np.abs(moved[both] / np.float32(65535) - mean[both]).mean() < 0.98 * before:
            values[k], seen[k] = moved, known
    return dataclasses.replace(stack, values=values, seen=seen)


def _best(stack: _Stack, mean: np.ndarray, size: Size) -> int:
    """The sharpest of the cells that are wholly seen and nearly as like the mean as any."""
    whole = stack.seen[:, : size.height, : size.width].mean(axis=(1, 2))
    candidates = np.flatnonzero(whole >= min(0.999, float(whole.max())))
    apart, sharp = [], []
    for k in candidates:
        value = stack.values[k] / np.float32(65535)
        apart.append(float(np.abs(value - mean)[stack.seen[k]].mean()))
        grey = value.mean(axis=2)
        sharp.append(float(np.abs(np.diff(grey, axis=0)).mean() + np.abs(np.diff(grey, axis=1)).mean()))
    limit = 1.25 * min(apart) + 1e-9
    good = [k for k in range(len(candidates)) if apart[k] <= limit]
    return int(candidates[max(good, key=lambda k: sharp[k])])

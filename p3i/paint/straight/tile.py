"""A seamless texture of a pattern: the robust mean of its cells, the best of them, or a stretch of many."""

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.tile import TileOptions
from p3i.paint.straight.aligned import Aligned, aligned, light_of, lit, registered, robust_mean
from p3i.paint.straight.cut import cut_of
from p3i.paint.straight.edges import edge_directions
from p3i.paint.straight.grain import layers
from p3i.paint.straight.light import Light, even
from p3i.paint.straight.patches import Patches, finest, patches_of
from p3i.paint.straight.seam import Seam, seam_of, wrapped
from p3i.paint.straight.stretch import laid_out, likest
from p3i.place.placed import placed
from p3i.records import changed
from p3i.size import Size, refuse_huge
from p3i.vision.image import Image
from p3i.vision.picture import Picture, depth

_OVERLAP = 0.16
"""The share of a cell's sides over which a tile is blended into what follows on the other side."""

_COARSE = 128
"""Pixels of a tile's longer side in which it is looked for where to cut it."""

_FEW = 16
"""Cells that are enough for that."""


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One tile: float32 `pixels` [H, W, 3] in 0..1, `known` [H, W]; `patches` says what it is made of.

    `used` are the (i, j) of the cells, `light` is the gain that was removed, `seam` how well it wraps, `cut`
    where the tile's middle lies: shares of its cell's sides, from an object's place to the right and down.
    """

    pixels: np.ndarray
    known: np.ndarray
    patches: Patches
    used: tuple[tuple[int, int], ...]
    light: Light
    seam: Seam
    cut: tuple[float, float]
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
            "from": self.options.source or ("mean" if self.options.cells == (1, 1) else "best"),
            "cells_shown": list(self.options.cells),
            "cut": [round(share, 4) + 0.0 for share in self.cut],
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
    patches = patches_of(laid, edge_directions(photo, laid, k1=k1))
    lattice = patches.cell is not None
    count = options.cells
    if not lattice and count[1] > 1:
        raise UsageError(
            f"the tile of a ring is one cell high: --cells {count[0]}x1, not {count[0]}x{count[1]}"
        )
    cell = _cell_size(patches, options)
    size = options.size or Size(cell.width * count[0], cell.height * count[1])
    refuse_huge(Size(size.width * options.repeat[0], size.height * options.repeat[1]), max_px=options.max_px)
    cut = _cut(photo, patches, cell, k1=k1)
    patches = patches.reframed((1, 1), cut)
    stack = aligned(photo, patches, cell, _larger(cell, cell, down=lattice), k1=k1)
    light = even()
    if options.light:
        light = light_of(stack)
        stack = lit(stack, light)
    mean, _ = robust_mean(stack.values, stack.seen)
    stack = registered(stack, photo, mean, k1=k1, light=light)
    mean, seen = robust_mean(stack.values, stack.seen)
    notes = list(photo.notes)
    best = _best(stack, mean, cell)
    own = layers(stack.values[best], stack.seen[best], mean, cell=cell)
    used = tuple(patch.index for patch in stack.pieces)
    if count != (1, 1):
        usual, shown = wrapped(mean, seen, cell, grain=own.grain)
        wide = patches.reframed(count, ((count[0] - 1) / 2, (count[1] - 1) / 2))
        piece = likest(photo, wide, usual, count=count, light=light, k1=k1)
        canvas = _larger(size, cell, down=lattice)
        pixels, whole = laid_out(
            photo, wide, piece, usual, count=count, size=size, larger=canvas, light=light, k1=k1
        )
        pixels, known = wrapped(pixels, whole | shown.all(), size)
        used = (piece.index,)
        if (missing := 1 - float(whole[: size.height, : size.width].mean())) > 0.001:
            notes.append(f"{100 * missing:.1f} % of these cells is not seen: what is usual is laid there")
    elif options.source == "best":
        pixels, known = wrapped(mean + own.shade, seen, cell, grain=own.fine)
        used = (stack.pieces[best].index,)
    else:
        pixels, known = wrapped(mean, seen, cell, grain=own.grain if options.grain else None)
    found = patches.cell
    if found is not None and not found.rectangular:
        notes.append(
            f"the cell is skewed by {found.shear_deg:.1f} degrees on the program's plane, perhaps since its "
            "focal was assumed: the tile straightens it"
        )
    if not known.all():
        notes.append(f"{100 * (1 - known.mean()):.1f} % of the tile is seen in no cell, and transparent")
    pixels = np.clip(pixels, 0, 1).astype(np.float32)
    seam = seam_of(pixels, known, down=lattice)
    return Tile(
        pixels,
        known,
        patches,
        used,
        light,
        seam,
        cut,
        options,
        depth(photo),
        photo.source.icc,
        tuple(notes),
    )


def _cell_size(patches: Patches, options: TileOptions) -> Size:
    """The canvas of one cell: by the option, or as many pixels as the photo has at the pattern's middle."""
    if options.size is not None:
        sides = (options.size.width / options.cells[0], options.size.height / options.cells[1])
        return Size(max(1, round(sides[0])), max(1, round(sides[1])))
    centers = np.array([piece.center for piece in patches.pieces])
    middle = centers[np.argsort(np.linalg.norm(centers - centers.mean(axis=0), axis=1), kind="stable")[:1]]
    width, height = np.maximum(8, np.round(patches.extent * finest(patches.placed, middle))).astype(int)
    return Size(int(width), int(height))


def _cut(photo: Image, patches: Patches, cell: Size, *, k1: float | None) -> tuple[float, float]:
    """Where the middle of a tile goes, seen on small cells: between objects where that cuts fewer of them."""
    share = min(1.0, _COARSE / cell.longer)
    small = Size(max(4, round(cell.width * share)), max(4, round(cell.height * share)))
    down = patches.cell is not None
    stack = aligned(photo, patches, small, _larger(small, small, down=down), k1=k1, most=_FEW)
    mean, known = wrapped(*robust_mean(stack.values, stack.seen), small)
    return cut_of(mean, down=down) if known.all() else (0.0, 0.0)


def _larger(size: Size, cell: Size, *, down: bool) -> Size:
    """The canvas of the patches: a tile and what is blended into its other side, a share of a cell."""
    across, below = (max(2, round(_OVERLAP * side)) for side in (cell.width, cell.height))
    return Size(size.width + across, size.height + (below if down else 0))


def _best(stack: Aligned, mean: np.ndarray, size: Size) -> int:
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

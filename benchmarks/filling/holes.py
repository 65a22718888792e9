"""Holes cut into an annotated photo: whole cells, boxes, boxes over the pattern's edge, large parts of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from filling.ground import Ground, drawn
from p3i.size import Size

BLOCKS = {"1 cell": (1, 1), "2 cells": (2, 1), "4 cells": (2, 2), "12 cells": (4, 3)}
BOXES = {"box of 1.2": 1.2, "box of 3": 3.0}
ENDS = ("edge", "corner")
ARCS = ("1 object", "2 objects", "quarter of ring")
COMPLETIONS = ("side missing", "corner missing", "band missing")
KINDS = (*BLOCKS, *BOXES, *ENDS, *ARCS, *COMPLETIONS)

# Of a pattern's pixels, how much a completion hides.
_LEAST_SHARE, _MOST_SHARE = 0.25, 0.45
_LEAST_PX = 60
_LEAST_OBJECTS_LEFT = 8
_MARGIN_PX = 2
_END_CELLS = 2
# A box of 2 cells over a corner, moved inwards by this much of a cell, lies there by half.
_CORNER_INWARDS = np.sqrt(2) - 1
# So much of a pattern's objects may be hidden from one search; more than that is searched for hole by hole.
_MOST_HIDDEN = 1 / 6
_TRIES = 20


@dataclass(frozen=True, slots=True, eq=False)
class Hole:
    """What is hidden: bool [H, W], and what kind of hole that is (one of KINDS)."""

    kind: str
    mask: np.ndarray


def holes(parts: Sequence[Ground], random: np.random.Generator) -> Iterator[Hole]:
    """A hole of each kind that there is room for; `parts` are one lattice, or the rings of a photo."""
    if parts[0].turn is None:
        yield from _blocks(parts[0], random)
        yield from _boxes(parts[0], random)
        yield from _ends(parts[0], random)
    else:
        yield from _arcs(parts, random)
    yield from _completions(parts, random)


def in_groups(cut: Sequence[Hole], centers: np.ndarray) -> list[list[Hole]]:
    """The holes that may be hidden from one search together, by the share of objects [K, 2] they hide."""

    def share(mask: np.ndarray) -> float:
        rows, columns = np.rint(centers[:, ::-1]).astype(int).T
        inside = (rows >= 0) & (rows < mask.shape[0]) & (columns >= 0) & (columns < mask.shape[1])
        return float(mask[rows[inside], columns[inside]].mean()) if inside.any() else 1.0

    groups: list[list[Hole]] = []
    for hole in cut:
        for group in groups:
            together = np.any([one.mask for one in (*group, hole)], axis=0)
            if share(together) <= _MOST_HIDDEN:
                group.append(hole)
                break
        else:
            groups.append([hole])
    return groups


def _inside(outline: np.ndarray, size: Size) -> bool:
    """Whether an outline lies on the photo, and holds enough pixels to be judged by."""
    with np.errstate(invalid="ignore"):
        limits = np.array([size.width, size.height]) - 1 - _MARGIN_PX
        within = bool(((outline >= _MARGIN_PX) & (outline <= limits)).all())
    return within and cv2.contourArea(outline.astype(np.float32)) >= _LEAST_PX


def _blocks(ground: Ground, random: np.random.Generator) -> Iterator[Hole]:
    whole = [cell for cell in ground.cells if _inside(ground.about(cell, 1, 1), ground.size)]
    there = set(whole)
    for kind, (columns, rows) in BLOCKS.items():
        block = [(i, j) for i in range(columns) for j in range(rows)]
        fit = [(a, b) for a, b in whole if all((a + i, b + j) in there for i, j in block)]
        if fit and len(whole) >= 3 * len(block) + 3:
            a, b = fit[random.integers(len(fit))]
            outline = ground.outline((a - 0.5, b - 0.5), (a + columns - 0.5, b + rows - 0.5))
            yield Hole(kind, drawn(outline, ground.size))


def _boxes(ground: Ground, random: np.random.Generator) -> Iterator[Hole]:
    for kind, side in BOXES.items():
        for _ in range(_TRIES if len(ground.cells) >= 3 * side**2 + 3 else 0):
            cell = ground.cells[random.integers(len(ground.cells))]
            place = np.array(cell) + random.uniform(-0.5, 0.5, 2)
            corners = place + (side / 2) * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
            outline = ground.about(place, side, side)
            # Boxes over the edge are a kind of their own: this one lies on marked cells with all corners.
            on_cells = all((round(i), round(j)) in ground.cells for i, j in corners.tolist())
            if on_cells and _inside(outline, ground.size):
                yield Hole(kind, drawn(outline, ground.size))
                break


def _ends(ground: Ground, random: np.random.Generator) -> Iterator[Hole]:
    """Boxes of which half lies on the pattern's last cells and half beyond them."""
    cells = set(ground.cells)

    def ends(cell: tuple[int, int], *steps: tuple[int, int]) -> bool:
        return all((cell[0] + i, cell[1] + j) not in cells for i, j in steps)

    places: dict[str, list[np.ndarray]] = {kind: [] for kind in ENDS}
    for i, j in ground.cells:
        for d in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            e = (d[1], -d[0])
            row = [(i, j), (i + e[0], j + e[1])]
            if cells.issuperset(row) and all(ends(at, d, (2 * d[0], 2 * d[1])) for at in row):
                places["edge"].append(np.mean(row, axis=0) + np.array(d) / 2)
            both = (d[0] + e[0], d[1] + e[1])
            inwards = {(i - d[0], j - d[1]), (i - e[0], j - e[1]), (i - both[0], j - both[1])}
            if inwards <= cells and ends((i, j), d, e, both):
                places["corner"].append(np.array([i, j]) + (0.5 - _CORNER_INWARDS) * np.array(both))
    if len(cells) < 3 * _END_CELLS + 3:
        return
    for kind, found in places.items():
        outlines = [ground.about(tuple(place), _END_CELLS, _END_CELLS) for place in found]
        fit = [outline for outline in outlines if _inside(outline, ground.size)]
        if fit:
            yield Hole(kind, drawn(fit[random.integers(len(fit))], ground.size))


def _arcs(parts: Sequence[Ground], random: np.random.Generator) -> Iterator[Hole]:
    for kind in ARCS:
        fit: list[np.ndarray] = []
        for ring in parts:
            assert ring.turn is not None
            whole = {j for i, j in ring.cells if _inside(ring.about((i, j), 1, 1), ring.size)}
            count = int(kind[0]) if kind[0].isdigit() else round(ring.turn / 4)
            if len(ring.cells) < 4 * count or (not kind[0].isdigit() and count < 3):
                continue
            runs = [j for j in whole if all((j + k) % ring.turn in whole for k in range(count))]
            fit += [ring.outline((-0.5, j - 0.5), (0.5, j + count - 0.5)) for j in runs]
        if fit:
            yield Hole(kind, drawn(fit[random.integers(len(fit))], parts[0].size))


def _completions(parts: Sequence[Ground], random: np.random.Generator) -> Iterator[Hole]:
    """A quarter to a half of the pattern's bounding box, up to its edge, or to the photo's near by."""
    size = parts[0].size
    corners = [part.about(cell, 1, 1) for part in parts for cell in part.cells]
    corners = [outline for outline in corners if np.isfinite(outline).all()]
    if not corners:
        return
    cell_px = float(np.median([np.sqrt(cv2.contourArea(one.astype(np.float32))) for one in corners]))
    frame = np.array([size.width, size.height])
    low = np.concatenate(corners).min(0)
    high = np.concatenate(corners).max(0)
    # What is left of a cell at the photo's edge would be a sliver in sight.
    low = np.where(low < cell_px, 0, np.floor(low)).astype(int)
    high = np.where(high > frame - cell_px, frame, np.ceil(high) + 1).astype(int)
    centers = np.concatenate([part.centers() for part in parts])
    span = high - low
    for kind in COMPLETIONS:
        share = random.uniform(_LEAST_SHARE, _MOST_SHARE)
        part = {
            "side missing": np.array([share, 1]),
            "corner missing": np.sqrt([share, share]),
            "band missing": np.array([1, share]),
        }[kind]
        length = np.rint(span * part).astype(int)
        at_end = random.integers(2, size=2)
        start = low + at_end * (span - length)
        if kind == "band missing":  # somewhere across, with pattern in sight on both sides
            start = low + np.array([0, int(random.uniform(0.2, 0.8) * (span - length)[1])])
        mask = np.zeros((size.height, size.width), bool)
        mask[start[1] : start[1] + length[1], start[0] : start[0] + length[0]] = True
        covered = ((centers >= start) & (centers < start + length)).all(1)
        if (~covered).sum() >= _LEAST_OBJECTS_LEFT and covered.any():
            yield Hole(kind, mask)

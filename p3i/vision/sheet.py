"""A photo resampled in the coordinates of a lattice: a sheet of cells that all have the same shape.

Convention: lattice coordinates (a, b) name the plane point `origin + a*u + b*v`; cell (i, j) is the unit
square about (i, j). A *sheet* is the photo resampled in lattice coordinates, `side` samples a cell, the
cells of a box of indices side by side: arrays [..., rows * side, columns * side], x along u, y along v.
Photos are float32 RGB in 0..1, pixel centres at whole numbers; `seen` and `valid` are boolean masks.
Everything here is plain numpy and OpenCV: arrays in, arrays out.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.strips import strips_of
from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

_PROBES = 96  # probe points along the longer side of the photo, for the box of visible cells
_REACH = 2  # pixels that the bell which halves a picture reaches


@dataclass(frozen=True, slots=True)
class Box:
    """A box of cells: i from `i_start` to `i_stop`, j from `j_start` to `j_stop`, both half-open."""

    i_start: int
    i_stop: int
    j_start: int
    j_stop: int

    @property
    def columns(self) -> int:
        return self.i_stop - self.i_start

    @property
    def rows(self) -> int:
        return self.j_stop - self.j_start

    @property
    def count(self) -> int:
        return self.rows * self.columns

    @property
    def indices(self) -> NDArray[np.int64]:
        """(i, j) of each cell [N, 2], row by row."""
        i, j = np.meshgrid(np.arange(self.i_start, self.i_stop), np.arange(self.j_start, self.j_stop))
        return np.stack([i.ravel(), j.ravel()], axis=-1)


@dataclass(frozen=True, slots=True)
class Sheet:
    """A photo in lattice coordinates: `values` [C, rows*side, columns*side], `seen` likewise without C."""

    values: Floats
    seen: Mask
    box: Box
    side: int


def cells_from_basis(image_from_plane: Array, basis: Array, origin: Array) -> Array:
    """The homography image <- lattice coordinates: `basis` [2, 2] has rows u and v, `origin` [2]."""
    plane_from_cells = np.eye(3)
    plane_from_cells[:2, 0], plane_from_cells[:2, 1], plane_from_cells[:2, 2] = basis[0], basis[1], origin
    return np.asarray(image_from_plane, float) @ plane_from_cells


def project(matrix: NDArray, points: NDArray) -> tuple[Array, Mask]:
    """Points [..., 2] through a homography, and which of them lie in front (third coordinate > 0)."""
    # Coordinates as rows: the same numbers in a third of the time.
    x, y, depth = matrix[:, :2] @ points.reshape(-1, 2).T + matrix[:, 2:]
    front = depth > 1e-9
    over = np.where(front, depth, 1.0)
    return np.stack([x / over, y / over], axis=-1).reshape(points.shape), front.reshape(points.shape[:-1])


def cell_sides_px(image_from_cells: NDArray, points: NDArray) -> tuple[Array, Array]:
    """Length of u and v in the photo, in pixels, at lattice points [N, 2]: two arrays [N].

    The second is the shorter extent of the cell (its area over its longer side), which is what limits
    how much of an object can be seen. Points behind the camera get 0.
    """
    mapped = points @ image_from_cells[:, :2].T + image_from_cells[:, 2]
    depth = mapped[..., 2]
    front = depth > 1e-9
    safe = np.where(front, depth, 1.0)
    at = mapped[..., :2] / safe[..., None]
    along = [(image_from_cells[:2, k] - at * image_from_cells[2, k]) / safe[..., None] for k in (0, 1)]
    longer = np.maximum(np.linalg.norm(along[0], axis=-1), np.linalg.norm(along[1], axis=-1))
    area = np.abs(along[0][..., 0] * along[1][..., 1] - along[0][..., 1] * along[1][..., 0])
    shorter = area / np.maximum(longer, 1e-12)
    return np.where(front, longer, 0.0), np.where(front, shorter, 0.0)


def visible_box(
    image_from_cells: Array, shape: tuple[int, int], *, min_px: float = 4.0, max_cells: int = 12000
) -> Box | None:
    """The box of all cells that show in a photo of `shape` [H, W] at `min_px` or more a side.

    Where the box would hold more than `max_cells` (towards a horizon), `min_px` is raised until it does not.
    None where nothing shows.
    """
    height, width = shape
    step = max(height, width) / _PROBES
    xs, ys = np.meshgrid(
        np.linspace(0, width - 1, max(2, int(width / step))),
        np.linspace(0, height - 1, max(2, int(height / step))),
    )
    points, front = project(np.linalg.inv(image_from_cells), np.stack([xs.ravel(), ys.ravel()], axis=-1))
    # The inverse maps what lies beyond the horizon to points behind the camera.
    _, shorter = cell_sides_px(image_from_cells, points)
    for _ in range(12):
        keep = (
            (shorter >= min_px)
            & np.isfinite(points).all(axis=-1)
            & (np.abs(points) < 1e6).all(axis=-1)
            & front
        )
        if not keep.any():
            return None
        low, high = points[keep].min(axis=0), points[keep].max(axis=0)
        box = Box(
            int(np.floor(low[0] + 0.5)), int(np.ceil(high[0] - 0.5)) + 1,
            int(np.floor(low[1] + 0.5)), int(np.ceil(high[1] - 0.5)) + 1,
        )  # fmt: skip
        if box.count <= max_cells:
            return box
        min_px *= 1.25
    return None


def sheet_points(box: Box, side: int) -> Array:
    """Lattice coordinates [rows*side, columns*side, 2] of the samples of a sheet."""
    a = box.i_start - 0.5 + (np.arange(box.columns * side) + 0.5) / side
    b = box.j_start - 0.5 + (np.arange(box.rows * side) + 0.5) / side
    return np.stack(np.meshgrid(a, b), axis=-1)


def straighten(pixels: Floats, valid: Mask, image_from_cells: Array, *, box: Box, side: int) -> Sheet:
    """The photo [H, W, 3] resampled in lattice coordinates, RGB first, free of aliasing.

    Each sample is taken from the level of a Gaussian pyramid whose pixels match the spacing of the samples
    there, so near and far cells come out equally sharp where the photo allows it.
    """
    points = sheet_points(box, side)
    at, front = project(image_from_cells, points)
    spacing = cell_sides_px(image_from_cells, points)[0] / side
    return sampled(pixels, valid, at, front, spacing, box=box, side=side)


def sampled(
    pixels: Floats, valid: Mask, at: Array, front: Mask, spacing: Array, *, box: Box, side: int
) -> Sheet:
    """`straighten` where the samples' places `at` [h, w, 2] in the photo (pixels) are known already.

    `front` [h, w] says which have a place at all, `spacing` [h, w] how many pixels apart they lie.
    """
    height, width = valid.shape
    inside = (
        front & (at[..., 0] >= 0) & (at[..., 0] <= width - 1) & (at[..., 1] >= 0) & (at[..., 1] <= height - 1)
    )
    level = np.clip(np.round(np.log2(np.maximum(spacing, 1e-6)) + 0.2), 0, 5).astype(int)
    places = np.where(inside[..., None], at, 0).astype(np.float32)
    values = np.zeros((*inside.shape, 3), np.float32)
    seen = np.zeros(inside.shape, bool)
    colour, weight = np.zeros((0, 0, 3), np.float32), np.zeros((0, 0), np.float32)
    for k in range(int(level[inside].max(initial=0)) + 1):
        if k == 1:
            colour, weight = _halved(pixels, valid)
        elif k:
            colour, weight = cv2.pyrDown(colour), cv2.pyrDown(weight)
        here = inside & (level == k)
        if not here.any():
            continue
        points = places[here] / 2**k
        found, known = (taken(colour, points), taken(weight, points)) if k else _read(pixels, valid, points)
        values[here] = found / np.maximum(known, 1e-3)[:, None]
        seen[here] = known > 0.6
    values[~seen] = 0
    return Sheet(np.ascontiguousarray(values.transpose(2, 0, 1)), seen, box, side)


def _known(pixels: Floats, valid: Mask, rows: slice) -> tuple[Floats, Floats]:
    """Some rows of a photo with what is unknown at 0, and 1 where it is known: [h, W, 3], [h, W]."""
    weight = valid[rows].astype(np.float32)
    return pixels[rows] * weight[..., None], weight


def _read(pixels: Floats, valid: Mask, points: NDArray) -> tuple[Floats, Floats]:
    """What is known [N, 3] of a photo [H, W, 3] and its `valid` pixels [H, W] at points [N, 2], by strips.

    And how far that is [N].
    """
    found, known = np.zeros((len(points), 3), np.float32), np.zeros(len(points), np.float32)
    for rows in strips_of(len(pixels)):
        here = np.flatnonzero((points[:, 1] >= rows.start) & (points[:, 1] < rows.stop))
        if len(here):
            colour, weight = _known(pixels, valid, slice(rows.start, rows.stop + 1))
            at = points[here] - np.array([0, rows.start], np.float32)
            found[here], known[here] = taken(colour, at), taken(weight, at)
    return found, known


def _halved(pixels: Floats, valid: Mask) -> tuple[Floats, Floats]:
    """What is known of a photo, and how far it is, half as large, made strip by strip: [h, w, 3], [h, w]."""
    height, width = valid.shape
    size = (height + 1) // 2, (width + 1) // 2
    halves = np.zeros((*size, 3), np.float32), np.zeros(size, np.float32)
    for rows in strips_of(height):
        top = max(0, rows.start - 2 * _REACH)  # even, so that halves stand where they did
        for half, part in zip(halves, _known(pixels, valid, slice(top, rows.stop + 2 * _REACH)), strict=True):
            to = slice(rows.start // 2, (rows.stop + 1) // 2)
            half[to] = cv2.pyrDown(part)[to.start - top // 2 : to.stop - top // 2]
    return halves

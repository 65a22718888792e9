"""The cells of a pattern laid on each other: sampled, lit evenly, moved onto their mean.

Convention: as in patches.py; colours are uint16 [K, H, W, 3] over K patches.
"""

import dataclasses
from dataclasses import dataclass

import cv2
import numpy as np

from p3i.errors import ProgramError
from p3i.paint.straight.light import Light, fitted_light
from p3i.paint.straight.patches import Patch, Patches, in_photo
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.picture import opacity
from p3i.vision.resample import resample

_MOST_PATCHES, _MOST_SAMPLES = 64, 10_000_000
"""No tile is made of more patches, or of more pixels of patches, than this; the nearest are taken."""

_LEAST_SEEN = 0.25
"""A patch of which less than this is known is left out."""

_LIGHT_SIDE = 20
"""The light is fitted to this many places a side of each patch."""

_MOST_SHIFT = 0.08
"""Cells that lie off their place by more than this share of a side are not moved onto it."""


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
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


def sampled(
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


def sampled_evenly(
    photo: Image, patches: Patches, piece: Patch, size: Size, larger: Size, *, light: Light, k1: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """One patch in even light: uint16 [H, W, 3], and what of it is known."""
    values, known = sampled(photo, patches, piece, size, larger, k1=k1)
    return relit(values, piece.plane(*_places(size, larger)), light), known


def _places(size: Size, larger: Size) -> tuple[np.ndarray, np.ndarray]:
    across = (np.arange(larger.width) + 0.5) / size.width - 0.5
    return across, (np.arange(larger.height) + 0.5) / size.height - 0.5


def aligned(
    photo: Image,
    patches: Patches,
    size: Size,
    larger: Size,
    *,
    k1: float | None,
    most: int = _MOST_PATCHES,
    least: float = _LEAST_SEEN,
) -> Aligned:
    """The nearest `most` patches, on a canvas of `larger`, that are seen to a share of `least`.

    Raises ProgramError where there is none.
    """
    most = int(np.clip(_MOST_SAMPLES // (larger.width * larger.height), 1, most))
    pieces: list[Patch] = []
    values: list[np.ndarray] = []
    seen: list[np.ndarray] = []
    for piece in patches.pieces:
        found, known = sampled(photo, patches, piece, size, larger, k1=k1)
        if known[: size.height, : size.width].mean() >= least:
            pieces.append(piece)
            values.append(found)
            seen.append(known)
        if len(pieces) == most:
            break
    if not pieces:
        raise ProgramError("no cell of the pattern is seen well enough to make a tile of")
    return Aligned(patches, tuple(pieces), np.stack(values), np.stack(seen), size)


def light_of(stack: Aligned) -> Light:
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


def lit(stack: Aligned, light: Light) -> Aligned:
    """The stack in even light."""
    pairs = zip(stack.values, stack.pieces, strict=True)
    values = np.stack([relit(value, piece.plane(*stack.places), light) for value, piece in pairs])
    return dataclasses.replace(stack, values=values)


def relit(value: np.ndarray, plane: np.ndarray, light: Light) -> np.ndarray:
    """Values [..., 3] at places of the plane [..., 2], without the light there."""
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


def registered(stack: Aligned, photo: Image, mean: np.ndarray, *, k1: float | None, light: Light) -> Aligned:
    """The stack with cells that lie a little off moved onto the mean [h, w, 3], where that helps."""
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
        moved, known = sampled(photo, stack.patches, piece, size, larger, k1=k1, shift=shift)
        moved = relit(moved, piece.plane(*stack.places), light)
        both = known & seen[k]
        if both.mean() < 0.5 * seen[k].mean():
            continue
        before = np.abs(values[k][both] / np.float32(65535) - mean[both]).mean()
        if np.abs(moved[both] / np.float32(65535) - mean[both]).mean() < 0.98 * before:
            values[k], seen[k] = moved, known
    return dataclasses.replace(stack, values=values, seen=seen)

"""Which way the edges of a pattern run on its plane: windows, bricks and tiles mostly stand along their rows.

Convention: directions in degrees, 0 to 180, x to the right and y down, as on the plane; an edge runs across
its gradient.
"""

from collections.abc import Callable

import cv2
import numpy as np

from p3i.paint.straight.patches import Patch, finest, in_photo
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.picture import opacity
from p3i.vision.resample import resample

_WINDOWS, _STEPS = 12, 2.0
"""So many windows are looked at, around the nearest objects, each so many steps of the lattice wide."""

_LEAST_PX, _MOST_PX = 24, 128
"""The sides of a window, in pixels."""

_BLUR_DEG = 3.0
"""A direction is told from others that are farther from it than this."""


def edge_directions(photo: Image, placed: Placed, *, k1: float | None) -> Callable[[float], float]:
    """How much contrast runs in a direction (degrees), against that of edges that run all ways alike."""
    basis = placed.basis
    found = np.zeros(180)
    if basis is None:
        return lambda _: 1.0
    side = _STEPS * float(np.sqrt(abs(np.linalg.det(basis))))
    depth = placed.points @ placed.image_from_plane[2, :2] + placed.image_from_plane[2, 2]
    seen = np.flatnonzero(placed.in_sight())
    for k in seen[np.argsort(depth[seen], kind="stable")][:_WINDOWS]:
        pixels = int(np.clip(side * finest(placed, placed.points[k][None]), _LEAST_PX, _MOST_PX))
        found += _directions(photo, placed, placed.points[k], side, Size(pixels, pixels), k1=k1)
    reach = np.minimum(np.arange(180), 180 - np.arange(180))
    blur = np.exp(-0.5 * (reach / _BLUR_DEG) ** 2)
    density = np.fft.ifft(np.fft.fft(found) * np.fft.fft(blur)).real
    density = np.ones(180) if density.max() <= 0 else np.maximum(density, 0) / density.mean()
    return lambda direction_deg: float(density[round(direction_deg) % 180])


def _directions(
    photo: Image, placed: Placed, center: np.ndarray, side: float, size: Size, *, k1: float | None
) -> np.ndarray:
    """The contrast [180] that runs in each direction in one square window of the plane."""

    def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return center + side * np.stack(np.meshgrid(x, y), axis=-1)

    window = Patch((0, 0), center, plane)
    values, alpha = resample(photo.pixels, opacity(photo), in_photo(placed, window, size, k1=k1), size=size)
    known = np.ones(values.shape[:2], np.uint8) if alpha is None else (alpha == 255).astype(np.uint8)
    known = cv2.erode(known, np.ones((7, 7), np.uint8), borderType=cv2.BORDER_REPLICATE)
    grey = cv2.GaussianBlur(values.mean(axis=2, dtype=np.float32), (0, 0), 1.0)
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    runs_deg = np.rint(np.degrees(np.arctan2(across, -down))).astype(int) % 180
    return np.bincount(runs_deg.ravel(), np.hypot(across, down).ravel() * known.ravel(), minlength=180)

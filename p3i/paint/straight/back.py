"""An edited straight view taken back into its photo; what was not edited stays as it is, to the bit.

A photo pixel changes where the view's pixels that it is seen through differ from the view as it was painted.
It is then read from the edited view, sharp and free of aliasing, and blended in by how much of what it is
read from was edited.
"""

import cv2
import numpy as np

from p3i.errors import UsageError
from p3i.paint.straight.straightened import Straightened
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.picture import Picture, depth, opacity
from p3i.vision.resample import resample

_LOSSY = {"JPEG", "WEBP", "MPO", "AVIF", "HEIF", "JPEG2000"}
_LOSSY_TOLERANCE = 16.0
"""What a JPEG of good quality adds to a pixel, at most, of 255."""
_COARSE = 48
"""Pixels of the longer side in which a picture is told from another one."""


def edited_pixels(painted: Picture, edited: Image, *, tolerance: float | None) -> np.ndarray:
    """Which pixels [H, W] of the view were edited; never those that the view did not know.

    Raises UsageError where the edited picture is not of the view's size.
    """
    if edited.size != painted.size:
        raise UsageError(
            f"the edited picture is {edited.size.width} x {edited.size.height}, but the view is "
            f"{painted.size.width} x {painted.size.height}: use the options that it was made with, "
            "and do not crop it"
        )
    if tolerance is None:
        tolerance = _LOSSY_TOLERANCE if edited.source.format in _LOSSY else 0.0
    top = np.iinfo(painted.values.dtype).max
    allowed = max(tolerance / 255 * top, 0.5 if painted.bits == 8 or edited.source.bits != 8 else 128.5)
    differs = np.zeros(painted.values.shape[:2], bool)
    for channel in range(3):
        new = edited.pixels[:, :, channel] * np.float32(top)
        differs |= np.abs(new - painted.values[:, :, channel]) > allowed
    if painted.alpha is not None:
        differs &= painted.alpha >= top / 2
    return differs & edited.valid


def back(
    photo: Image, view: Straightened, painted: Picture, edited: Image, *, tolerance: float | None
) -> tuple[Picture, int, float]:
    """The photo with what was edited in the view, how many of its pixels changed, what share of the view.

    Raises UsageError where the edited picture is not of the view's size.
    """
    bits = depth(photo)
    top = 2**bits - 1
    values = np.rint(photo.pixels * np.float32(top)).astype(np.uint8 if bits == 8 else np.uint16)
    plain = opacity(photo)
    alpha = None if plain is None else np.rint(plain * np.float32(top)).astype(values.dtype)
    differs = edited_pixels(painted, edited, tolerance=tolerance)
    changed = 0
    if differs.any():
        left, top_row, size = _window(view, differs)

        def in_view(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            return view.in_view(x + left, y + top_row)

        where = np.repeat(differs.astype(np.float32)[:, :, None], 3, axis=2)
        share, _ = resample(where, None, in_view, size=size, bits=8)
        shares = share[:, :, :1].astype(np.float32) / 255
        # Rounded sharpening around an edit is no edit.
        shares = np.where(shares < 0.02, 0, shares)
        new, _ = resample(edited.pixels, None, in_view, size=size, bits=bits)
        place = slice(top_row, top_row + size.height), slice(left, left + size.width)
        old = values[place]
        mixed = np.rint(old * (1 - shares) + new * shares).astype(values.dtype)
        values[place] = np.where(shares > 0, mixed, old)
        changed = int((shares > 0).sum())
    source = photo.source
    known = differs.size if painted.alpha is None else max(1, int((painted.alpha > 0).sum()))
    return Picture(values, alpha, source.icc, source.exif), changed, float(differs.sum() / known)


def likeness(painted: Picture, edited: Image) -> float:
    """How an edited view's light correlates with that of the view as painted, both much reduced: -1 to 1."""
    share = _COARSE / max(painted.size.width, painted.size.height)
    size = tuple(max(4, round(side * share)) for side in (painted.size.width, painted.size.height))
    known = np.ones(painted.values.shape[:2], bool) if painted.alpha is None else painted.alpha > 0
    known &= edited.valid
    weight = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    first, second = (
        cv2.resize(grey * known, size, interpolation=cv2.INTER_AREA)
        for grey in (painted.values.mean(axis=2, dtype=np.float32), edited.pixels.mean(axis=2))
    )
    seen = weight > 0.5
    if seen.sum() < 4:
        return 1.0
    first, second = (each[seen] / weight[seen] for each in (first, second))
    spread = float(first.std() * second.std())
    return (
        float(((first - first.mean()) * (second - second.mean())).mean()) / spread if spread > 1e-9 else 1.0
    )


def _window(view: Straightened, differs: np.ndarray) -> tuple[int, int, Size]:
    """The photo's stretch that the edited pixels lie in: left, top, size."""
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    # The border of their box: a homography takes it to the border of where they lie.
    x = np.linspace(columns[0] - 1, columns[-1] + 1, 257)
    y = np.linspace(rows[0] - 1, rows[-1] + 1, 257)
    at_x, at_y, known = view.in_photo(x, y)
    photo = view.placed.size
    if not known.any():
        return 0, 0, Size(1, 1)
    # Between two probes as much again may be known.
    slack_x = 4 + np.ptp(at_x[known]) / 64
    slack_y = 4 + np.ptp(at_y[known]) / 64
    left = max(0, int(at_x[known].min() - slack_x))
    top = max(0, int(at_y[known].min() - slack_y))
    right = min(photo.width, int(at_x[known].max() + slack_x) + 2)
    bottom = min(photo.height, int(at_y[known].max() + slack_y) + 2)
    return left, top, Size(right - left, bottom - top)

"""What the command line understands of photos: their file names, and regions written by hand."""

import math
import re

from p3i.errors import UsageError

_KINDS = "avif bmp gif heic heif jp2 jpeg jpg pbm pgm png pnm ppm tif tiff webp"

SUFFIXES = frozenset(f".{kind}" for kind in _KINDS.split())
"""The files of a folder that are taken for photos; a file named by itself may be called anything."""


def parse_roi(text: str | None) -> tuple[tuple[float, float], ...] | None:
    """The polygon of `--roi`: `x,y,w,h` is a rectangle, three points or more a polygon, in pixels.

    Raises UsageError for anything else.
    """
    if text is None:
        return None
    try:
        numbers = [float(word) for word in re.split(r"[\s,;]+", text.strip())]
    except ValueError:
        numbers = []
    if not all(map(math.isfinite, numbers)):
        numbers = []
    if len(numbers) == 4:
        x, y, width, height = numbers
        if width <= 0 or height <= 0:
            raise UsageError(f"--roi {text}: a rectangle x,y,w,h needs a width and a height above 0")
        # Pixel centres lie at whole numbers: w pixels from x on end at x + w - 1.
        right, bottom = x + width - 1, y + height - 1
        return ((x, y), (right, y), (right, bottom), (x, bottom))
    if len(numbers) >= 6 and len(numbers) % 2 == 0:
        return tuple(zip(numbers[::2], numbers[1::2], strict=True))
    raise UsageError(f"--roi {text}: write x,y,w,h or at least three points x,y x,y x,y, in pixels")

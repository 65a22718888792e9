"""A photo whose hidden ground is filled, before anything else is done with it.

Convention: masks bool [h, w] of the flat canvas (place/flat.py).
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.stack import fill_by_stack
from p3i.place.continued import Continued, continued
from p3i.place.flat import Flat
from p3i.place.placed import Placed
from p3i.vision.image import Image

Mask = NDArray[np.bool_]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, eq=False)
class Completed:
    """A flat `photo` with its hole filled, and its program `laid` with `more`, what goes on through the hole.

    `known` is what was seen before; `bare` where nothing is like the hole: the surroundings go on there.
    """

    photo: Image
    laid: Placed
    more: Continued
    known: Mask
    bare: Mask


def completed(flat: Flat, hole: Mask, *, progress: Progress | None = None) -> Completed:
    """The photo of `flat` with a `hole` [h, w] filled by its program, which goes on through it."""
    photo, known = flat.photo, flat.photo.valid & ~hole
    more = continued(flat.placed, photo, hole=hole)
    laid = more.joined(flat.placed)
    if not hole.any():
        return Completed(photo, laid, more, known, hole)
    pixels, bare = fill_by_stack(photo.pixels, known, hole, laid, progress=progress)
    whole = dataclasses.replace(photo, pixels=pixels, valid=photo.valid | hole)
    return Completed(whole, laid, more, known, bare)

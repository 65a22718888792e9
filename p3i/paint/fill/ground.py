"""A photo with its hole as a place to take colours from.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W]; points are pixels of the photo [L, 2].
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.warp import taken

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Sources fade in over so many pixels at most where known ground ends.
DEEPEST_PX = 32.0


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A photo with its hole as a place to take colours from: `pixels` [H, W, 3], `sure` uint8 [H, W].

    `sure` is 255 where all neighbours are known too, else 0; `inwards` [H, W] is how many pixels each lies
    inside that, at most `DEEPEST_PX`.
    """

    pixels: Floats
    sure: NDArray[np.uint8]
    inwards: Floats

    @classmethod
    def of(cls, pixels: Floats, known: Mask) -> "Ground":
        """What is known, and one pixel away from what is not, since samples mix neighbours."""
        padded = np.pad(known.astype(np.uint8), 1)
        sure = np.asarray(cv2.erode(255 * padded, np.ones((3, 3), np.uint8)), np.uint8)
        inwards = np.asarray(cv2.distanceTransform(sure, cv2.DIST_L2, 3), np.float32)[1:-1, 1:-1]
        return cls(pixels, sure[1:-1, 1:-1], np.minimum(inwards, np.float32(DEEPEST_PX), out=inwards))

    def known(self, points: Array) -> Mask:
        """Which of the points [L, 2] can be read."""
        height, width = self.sure.shape
        x, y = points[:, 0], points[:, 1]
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        return inside & (taken(self.sure, points) > 0.99 * 255)

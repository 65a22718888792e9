"""Which way the lines of a pattern run on its plane: the bed joints of bricks, the borders of fields."""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLUR_PX = 1.0
"""Before gradients are taken: a slanted line is a staircase of pixels."""


def edge_directions(pixels: NDArray[np.float32], image_from_plane: Array, where: NDArray[np.bool_]) -> Array:
    """How much of the edges' energy [180] runs along each whole degree of the plane, from x towards y.

    Convention: pixels [H, W, 3]; `image_from_plane` [3, 3] takes plane points in front of the camera to
    pixels with positive third coordinates; `where` [H, W] is the pattern's ground. Sums to 1, or is 0.
    """
    smooth = cv2.GaussianBlur(np.asarray(pixels, np.float32), (0, 0), _BLUR_PX)
    y, x = np.nonzero(cv2.erode(where.astype(np.uint8), np.ones((5, 5), np.uint8)))
    gx, gy = (cv2.Sobel(smooth, cv2.CV_32F, *axis)[y, x].T.ravel() for axis in ((1, 0), (0, 1)))
    x, y = np.tile(x, 3), np.tile(y, 3)
    # A gradient on the plane is J^T g, with J the slopes of the image's points; their depth turns nothing.
    first, second, third = image_from_plane
    ax, ay = ((first[k] - x * third[k]) * gx + (second[k] - y * third[k]) * gy for k in (0, 1))
    along = np.degrees(np.arctan2(ay, ax)) + 90
    energy = np.bincount(np.floor(along).astype(int) % 180, gx * gx + gy * gy, minlength=180)
    return energy / max(float(energy.sum()), 1e-30)

"""A plane beside the channels of a picture: factors and masks of each pixel, for all channels alike.

numpy spreads a plane over few channels an element at a time, which takes up to ten times as long as OpenCV's
rows.

Convention: pictures float32 [H, W, 3]; planes [H, W].
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]


def three(plane: Floats) -> Floats:
    """A plane [H, W] as three channels alike: [H, W, 3]."""
    return np.asarray(cv2.merge([plane] * 3), np.float32).reshape(*plane.shape, 3)


def times(plane: Floats, picture: Floats) -> Floats:
    """A picture [H, W, 3] times a plane [H, W], as a new one."""
    found = three(plane)
    found *= picture
    return found


def put(picture: Floats, into: Floats, where: Mask) -> None:
    """Write a picture's pixels `where` [H, W] into another of its size, in place."""
    if where.size:
        cv2.copyTo(np.asarray(picture, into.dtype), where.view(np.uint8), into)

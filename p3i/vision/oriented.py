"""`oriented`: gradient strength and direction of the Lab colours, without weights. The default feature."""

from typing import Any, TypeVar

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.vision.fill import eroded, filled
from p3i.vision.image import Image
from p3i.vision.lab import lab_of
from p3i.vision.raw import RawFeatures

# Width of the Gaussian, in pixels of the working image (DESIGN.md, 4.1).
_SIGMA = 1.0
# The Gaussian is cut off at 3 sigma, and a central difference adds a pixel.
_REACH = 4
# The step of an 8-bit grey, in Lab units: a gradient below it has no direction worth dividing by. (From 0.02
# to 1.0 the measure of docs/features.md hardly moves.)
_FLOOR = 0.4

Values = TypeVar("Values", NDArray[Any], torch.Tensor)


def double_angle(xx: Values, yy: Values, xy: Values) -> tuple[Values, Values, Values]:
    """sqrt(m), (gx^2 - gy^2) / m^1.5 and 2 gx gy / m^1.5 of gradients, m = |grad|: three of any one shape.

    By gx^2, gy^2 and gx gy, of one plane or summed over several. The last two are sqrt(m) times the cosine
    and sine of twice the direction: an orientation tensor, which does not tell black on white from white on
    black.
    """
    squared = xx + yy
    root = (squared**0.5) ** 0.5
    # 1 / m^1.5 = sqrt(m) / m^2, with a floor under m^2 so that flat areas give 0, not 0/0.
    factor = root / (squared + _FLOOR**2)
    return root, (xx - yy) * factor, 2 * xy * factor


def oriented(image: Image) -> RawFeatures:
    """Nine channels, three for each of L, a, b: `double_angle`. Known where everything within 4 pixels is."""
    lab = lab_of(filled(image.pixels, image.valid))
    smooth = cv2.GaussianBlur(lab, (7, 7), _SIGMA, borderType=cv2.BORDER_REPLICATE)
    planes = np.empty((9, *image.valid.shape), np.float32)
    for channel in range(3):
        plane = np.ascontiguousarray(smooth[:, :, channel])
        gx = cv2.Sobel(plane, cv2.CV_32F, 1, 0, ksize=1, scale=0.5, borderType=cv2.BORDER_REPLICATE)
        gy = cv2.Sobel(plane, cv2.CV_32F, 0, 1, ksize=1, scale=0.5, borderType=cv2.BORDER_REPLICATE)
        planes[3 * channel : 3 * channel + 3] = double_angle(gx * gx, gy * gy, gx * gy)
    return RawFeatures(torch.from_numpy(planes), torch.from_numpy(eroded(image.valid, _REACH)), 1.0)

"""`oriented`: gradient strength and direction of the Lab colours, without weights. The default feature."""

import cv2
import numpy as np
import torch

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


def oriented(image: Image) -> RawFeatures:
    """Nine channels, three for each of L, a, b: sqrt(m), (gx^2 - gy^2) / m^1.5, 2 gx gy / m^1.5, m = |grad|.

    The last two are sqrt(m) times the cosine and sine of twice the direction: an orientation tensor, which
    does not tell black on white from white on black. Known where everything within 4 pixels is.
    """
    lab = lab_of(filled(image.pixels, image.valid))
    smooth = cv2.GaussianBlur(lab, (7, 7), _SIGMA, borderType=cv2.BORDER_REPLICATE)
    planes = np.empty((9, *image.valid.shape), np.float32)
    for channel in range(3):
        plane = np.ascontiguousarray(smooth[:, :, channel])
        gx = cv2.Sobel(plane, cv2.CV_32F, 1, 0, ksize=1, scale=0.5, borderType=cv2.BORDER_REPLICATE)
        gy = cv2.Sobel(plane, cv2.CV_32F, 0, 1, ksize=1, scale=0.5, borderType=cv2.BORDER_REPLICATE)
        xx, yy = gx * gx, gy * gy
        m = np.sqrt(xx + yy)
        root = np.sqrt(m)
        # 1 / m^1.5 = sqrt(m) / m^2, with a floor under m^2 so that flat areas give 0, not 0/0.
        factor = root / (xx + yy + _FLOOR**2)
        planes[3 * channel] = root
        np.multiply(xx - yy, factor, out=planes[3 * channel + 1])
        np.multiply(gx * gy, 2 * factor, out=planes[3 * channel + 2])
    return RawFeatures(torch.from_numpy(planes), torch.from_numpy(eroded(image.valid, _REACH)), 1.0)

"""Radial lens distortion: one number between the picture of a pinhole camera and the photo as it is.

Convention: points are (x, y) in pixels, pixel centres at whole numbers. A *straight* point is where a pinhole
camera would see something, a *photo* point where the lens puts it; both on a canvas whose middle is the
lens's. The radius is measured in half diagonals of the photo, so that k1 does not depend on its size. The
model is the division model (Fitzgibbon, CVPR 2001), which is closed in both directions: straight = photo /
(1 + k1 r^2) with r the photo's radius. k1 < 0 is barrel distortion, k1 > 0 pincushion, 0 none.
"""

import math

import torch
from torch import Tensor

from p3i.size import Size


def photo_from_straight(points_px: Tensor, k1: Tensor | float, *, size: Size) -> tuple[Tensor, Tensor]:
    """Where the lens puts straight points [..., 2], and which of them [...] it shows at all.

    Differentiable in the points and in k1. With k1 > 0 what lies farther out than 1 / sqrt(4 k1) half
    diagonals is never seen; such points come back finite, without meaning.
    """
    middle, radius = _frame(points_px, size)
    straight = (points_px - middle) / radius
    inside = 1 - 4 * k1 * straight.square().sum(-1, keepdim=True)
    shown = inside > 1e-6
    stretch = 2 / (1 + torch.where(shown, inside, torch.ones_like(inside)).sqrt())
    return straight * stretch * radius + middle, shown[..., 0]


def straight_from_photo(points_px: Tensor, k1: Tensor | float, *, size: Size) -> Tensor:
    """Where a pinhole camera would see what the photo shows at points [..., 2]; |k1| < 1/2."""
    middle, radius = _frame(points_px, size)
    photo = (points_px - middle) / radius
    return photo / (1 + k1 * photo.square().sum(-1, keepdim=True)) * radius + middle


def _frame(like: Tensor, size: Size) -> tuple[Tensor, float]:
    """The middle of the canvas and half its diagonal."""
    return like.new_tensor(size.middle), 0.5 * math.hypot(size.width, size.height)

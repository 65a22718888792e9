"""sRGB -> CIE Lab."""

import numpy as np
import torch

# Linear sRGB -> XYZ (IEC 61966-2-1), each row divided by the D65 white (0.950456, 1, 1.088754).
_XYZ_FROM_RGB = (
    (0.412453 / 0.950456, 0.357580 / 0.950456, 0.180423 / 0.950456),
    (0.212671, 0.715160, 0.072169),
    (0.019334 / 1.088754, 0.119193 / 1.088754, 0.950227 / 1.088754),
)


def lab_of(pixels: np.ndarray) -> np.ndarray:
    """sRGB in 0..1 -> CIE Lab (D65): L in 0..100, a and b about -128..127. float32 [H, W, 3] both.

    OpenCV has the same conversion, but builds a table on its first call that costs 0.2 CPU seconds, more
    than a photo's features.
    """
    encoded = torch.from_numpy(np.ascontiguousarray(pixels)).permute(2, 0, 1).reshape(3, -1)
    linear = torch.where(
        encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055).clamp(min=0).pow(2.4)
    )
    xyz = torch.tensor(_XYZ_FROM_RGB, dtype=torch.float32) @ linear
    x, y, z = torch.where(xyz > 0.008856, xyz.clamp(min=1e-6).pow(1 / 3), 7.787 * xyz + 16 / 116)
    lab = torch.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], dim=-1)
    return lab.reshape(pixels.shape).numpy()

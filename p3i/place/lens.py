"""Places on a photo that its lens has bent: what a pinhole camera would see, moved to where it is seen.

Convention: pixels of the canvas; k1 and the two kinds of points as in p3i/interp/lens.py.
"""

import numpy as np
import torch

from p3i.interp.lens import photo_from_straight
from p3i.size import Size


def bent_points(points_px: np.ndarray, size: Size, k1: float) -> tuple[np.ndarray, np.ndarray]:
    """Straight points [..., 2] on the photo, nan where the lens shows them not; and where it does [...]."""
    known = np.asarray(np.isfinite(points_px).all(axis=-1))
    straight = torch.from_numpy(np.where(known[..., None], points_px, 0.0))
    photo, shown = photo_from_straight(straight, k1, size=size)
    seen = shown.numpy() & known
    return np.where(seen[..., None], photo.numpy(), np.nan), seen

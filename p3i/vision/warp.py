"""Reading pictures and feature maps at points, and through homographies. The one `grid_sample` of p3i.

Convention: points are (x, y) in pixels of the map that is read, pixel centres at whole numbers, so the point
(3, 5) is values[..., 5, 3] exactly. A homography `source_from_target` takes pixels of the view that is made
to pixels of the map that is read. Reading is bilinear; beyond the outermost pixel centres the nearest pixel
is repeated, which only `sample_valid` tells apart from the picture itself.
"""

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.size import Size

# A point is known where all pixels that it is read from are, up to the rounding of float32.
_WHOLE = 1 - 1e-3
# Scattered points are read in rows of this many: OpenCV refuses maps of more than 32767 a side.
_ROW = 4096


def sample(values: Tensor, points_px: Tensor) -> Tensor:
    """Read a map at points, differentiable in both.

    Shapes: values [C, H, W], points_px [..., 2] (x, y) -> [..., C]. Points outside read the nearest pixel,
    with no gradient in the point; so do NaN and infinite ones, at a corner.
    """
    return _read(values, points_px, padding="border")


def sample_valid(valid: Tensor, points_px: Tensor) -> Tensor:
    """Which points can be read: inside the outermost pixel centres, and no unknown pixel contributes.

    Shapes: valid [H, W] bool, points_px [..., 2] -> [...] bool.
    """
    height, width = valid.shape
    x, y = points_px[..., 0], points_px[..., 1]
    # NaN compares False. A thousandth of a pixel is what float32 rounds away on large pictures.
    inside = (x >= -1e-3) & (x <= width - 1 + 1e-3) & (y >= -1e-3) & (y <= height - 1 + 1e-3)
    if bool(valid.all()):
        return inside
    known = _read(valid[None].to(points_px.dtype), points_px.detach(), padding="border")[..., 0]
    return inside & (known >= _WHOLE)


def in_frame(points_px: Tensor, size: Size) -> Tensor:
    """Which points [..., 2] lie on a picture's pixels, the outer halves of the outermost included: [...]."""
    limits = torch.tensor([size.width - 0.5, size.height - 0.5], dtype=points_px.dtype)
    return ((points_px >= -0.5) & (points_px <= limits)).all(-1)


def warp_pixels(pixels: np.ndarray, source_from_target: np.ndarray, size: Size) -> np.ndarray:
    """See a picture through a homography; what lies behind the camera is filled with anything.

    Shapes: pixels [H, W] or [H, W, C] float32 or uint8, source_from_target [3, 3] ->
    [size.height, size.width(, C)]. OpenCV before 5.0 rounds points to 1/32 pixel.
    """
    return cv2.warpPerspective(
        pixels,
        np.asarray(source_from_target, np.float64),
        (size.width, size.height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def remapped(pixels: np.ndarray, valid: np.ndarray, points_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A picture read at points, for maps that are no homography: the pixels, and which of them are known.

    Shapes: pixels [H, W, C] float32, valid [H, W] bool, points_px [h, w, 2] (x, y) -> [h, w, C], [h, w] bool.
    Points beyond the outermost pixel centres read the nearest pixel and are unknown. OpenCV rounds points to
    1/32 pixel.
    """
    x, y = (np.ascontiguousarray(points_px[..., axis], dtype=np.float32) for axis in (0, 1))
    values = cv2.remap(pixels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    height, width = valid.shape
    known = (x >= -1e-3) & (x <= width - 1 + 1e-3) & (y >= -1e-3) & (y <= height - 1 + 1e-3)
    if not valid.all():
        whole = cv2.remap(valid.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        known &= whole >= _WHOLE
    return values, known


def taken(image: np.ndarray, points_px: np.ndarray, *, sharp: bool = False) -> np.ndarray:
    """A picture read at scattered points: bilinear, or bicubic where `sharp`.

    Shapes: image [H, W, ...] float32, points_px [N, 2] (x, y) -> [N, ...] float32. Points outside read the
    nearest pixel.
    """
    count = len(points_px)
    row = max(1, min(count, _ROW))
    padded = np.zeros((2, -(-count // row) * row), np.float32)
    padded[:, :count] = points_px.T
    x, y = padded.reshape(2, -1, row)
    how = cv2.INTER_CUBIC if sharp else cv2.INTER_LINEAR
    found = cv2.remap(image, x, y, how, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, *image.shape[2:])[:count], np.float32)


def pixel_grid(
    size: Size, *, dtype: torch.dtype = torch.float32, device: torch.device | None = None
) -> Tensor:
    """The pixel centres of a canvas, [height, width, 2] as (x, y)."""
    x = torch.arange(size.width, dtype=dtype, device=device)
    y = torch.arange(size.height, dtype=dtype, device=device)
    return torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1)


def _read(values: Tensor, points_px: Tensor, *, padding: str) -> Tensor:
    """The one grid_sample: values [C, H, W] at points [..., 2] -> [..., C]."""
    height, width = values.shape[-2:]
    sides = torch.tensor([width, height], dtype=points_px.dtype, device=points_px.device)
    # Far points would overflow the whole numbers inside grid_sample, NaN would pick any pixel.
    points = torch.nan_to_num(points_px, nan=-1.0).clamp(min=-1.0)
    points = torch.minimum(points, sides)
    # align_corners=False: -1 and 1 are the outer edges of the outermost pixels, pixel k has its centre at
    # (2k + 1)/side - 1.
    normalized = (2 * points + 1) / sides - 1
    flat = normalized.reshape(1, -1, 1, 2).to(values.dtype)
    read = F.grid_sample(values[None], flat, mode="bilinear", padding_mode=padding, align_corners=False)
    return read[0, :, :, 0].T.reshape(*points_px.shape[:-1], values.shape[0])

"""What one real cell has beside the mean of all: its own shade, and its grain.

A mean of n cells keeps a share 1/n of the variance of what differs from cell to cell, as noise, the grain of
wood and the pores of stone do: it is smooth where the surface is not. The fine part of one cell's difference
from the mean is all that is missing, at full strength. What is not like grain stays out: where a cell differs
far more than it does in quiet places it shows something of its own, a stain or another face.

Convention: float32 [H, W, 3] in 0..1.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from p3i.size import Size

_FINE = 0.04
"""Grain is finer than this share of a cell's shorter side (the deviation of the blur that it is told by)."""

_QUIET, _USUAL = 25, 1.5
"""Grain is as strong as a cell's differences are in quiet places (this percentile of all), up to so
many times: what is more is an edge a little off its place, or a thing of its own."""


@dataclass(frozen=True, slots=True, eq=False)
class Layers:
    """A cell less the mean of all: its `shade`, and its `fine` differences with the `grain` among them."""

    shade: np.ndarray
    fine: np.ndarray
    grain: np.ndarray


def layers(values: np.ndarray, seen: np.ndarray, mean: np.ndarray, *, cell: Size) -> Layers:
    """The layers of a cell, uint16 `values` [H, W, 3], where `seen` [H, W]; elsewhere it is the mean."""
    own = np.where(seen[:, :, None], values / np.float32(65535) - mean, np.float32(0))
    sigma = max(1.0, _FINE * min(cell.width, cell.height))
    shade = _blurred(own, seen, sigma)
    fine = np.where(seen[:, :, None], own - shade, np.float32(0))
    around = _blurred(np.abs(fine).mean(axis=2, keepdims=True), seen, sigma)
    usual = float(np.percentile(around[seen], _QUIET)) if seen.any() else 0.0
    share = np.minimum(1.0, _USUAL * usual / np.maximum(around, 1e-9)).astype(np.float32)
    return Layers(shade, fine, share * fine)


def _blurred(values: np.ndarray, seen: np.ndarray, sigma: float) -> np.ndarray:
    """The mean around each pixel of what is seen [H, W, C]."""
    weight = cv2.GaussianBlur(seen.astype(np.float32), (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
    found = cv2.GaussianBlur(
        np.where(seen[:, :, None], values, np.float32(0)), (0, 0), sigma, borderType=cv2.BORDER_REFLECT
    )
    return found.reshape(values.shape) / np.maximum(weight, 1e-6)[:, :, None]

"""Raw features -> comparable ones: local contrast removed, few channels, mean energy 1."""

import cv2
import numpy as np
import torch
from torch import Tensor

# The Gaussian of the local normalisation, as a share of the longer side (DESIGN.md, 4.1).
_NEIGHBOURHOOD = 0.1
# It is computed on a map so small that its sigma is about this many pixels: it holds no more detail.
_COARSE_SIGMA = 4.0
# Principal components are found from about this many pixels.
_PCA_SAMPLES = 20_000
# A component with less than this share of the energy is rounding, and costs as much as any other.
_LEAST_SHARE = 1e-3


def locally_normalized(values: Tensor, valid: Tensor) -> Tensor:
    """(F - G*F) / sqrt(G*|F|^2 + mean energy), G a Gaussian of a tenth of the longer side over known pixels.

    Shapes: values [C, H, W] float32, valid [H, W] bool -> [C, H, W], 0 where not valid. |F|^2 is summed over
    channels, so their proportions stay. A flat picture gives zeros.
    """
    height, width = valid.shape
    known = valid.numpy().astype(np.float32)
    if not known.any():
        return torch.zeros_like(values)
    whole = bool(valid.all())
    planes = values.numpy() if whole else values.numpy() * known
    energy = np.einsum("chw,chw->hw", planes, planes)
    mean_energy = float(energy.sum(dtype=np.float64) / known.sum(dtype=np.float64))
    if mean_energy <= 1e-12:
        return torch.zeros_like(values)

    sigma = _NEIGHBOURHOOD * max(height, width)
    factor = max(1.0, sigma / _COARSE_SIGMA)
    coarse = (max(1, round(width / factor)), max(1, round(height / factor)))

    def smooth(plane: np.ndarray) -> np.ndarray:
        small = cv2.resize(plane, coarse, interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_CONSTANT)

    def enlarged(plane: np.ndarray) -> np.ndarray:
        return cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR)

    weight = np.maximum(smooth(known), 1e-6)
    scale = 1 / np.sqrt(enlarged(smooth(energy) / weight) + np.float32(mean_energy))
    if not whole:
        scale *= known
    result = np.empty_like(planes)
    for channel, plane in enumerate(planes):
        np.subtract(plane, enlarged(smooth(plane) / weight), out=result[channel])
        result[channel] *= scale
    return torch.from_numpy(result)


def principal(values: Tensor, valid: Tensor, channels: int) -> Tensor:
    """The principal components of a map over its known pixels: up to `channels` that hold any energy.

    Shapes: values [C, H, W], valid [H, W] -> [1..min(C, channels), H, W], strongest first, uncentred, each
    with its largest weight positive so that equal pictures give equal maps. A grey photo has no more than a
    third of a coloured one's.
    """
    count = values.shape[0]
    flat = values.reshape(count, -1)
    step = max(1, int(valid.sum()) // _PCA_SAMPLES)
    seen = torch.nonzero(valid.reshape(-1))[::step, 0]
    if len(seen) == 0:
        return values[:channels]
    samples = flat[:, seen].double()
    covariance = torch.cov(samples, correction=0).reshape(count, count)
    variances, vectors = torch.linalg.eigh(covariance)
    variances, vectors = variances.flip(0), vectors.flip(1)
    kept = max(1, int((variances > _LEAST_SHARE * variances.sum()).sum()))
    axes = vectors[:, : min(channels, kept)].T
    largest = axes.gather(1, axes.abs().argmax(1, keepdim=True))
    axes = axes * torch.where(largest < 0, -1.0, 1.0)
    return (axes.to(values.dtype) @ flat).reshape(-1, *valid.shape)


def unit_energy(values: Tensor, valid: Tensor) -> Tensor:
    """The map scaled so that the mean of |F|^2 over its known pixels is 1, 0 elsewhere; flat maps stay 0.

    Shapes: values [C, H, W], valid [H, W] bool -> [C, H, W].
    """
    known = values * valid
    energy = float(known.square().sum(dtype=torch.float64)) / max(1, int(valid.sum()))
    return known / energy**0.5 if energy > 1e-12 else torch.zeros_like(values)

"""Grain: noise that looks as the fine texture of a ground does, where there is too little of it to copy.

A texture is described by the covariance of its colours in bands of an octave each (differences of Gaussians),
as Heeger and Bergen (SIGGRAPH 1995) match textures by the histograms of their bands.

Convention: float32 RGB [H, W, 3], masks bool [H, W].
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Bands from so many pixels to so many: what is coarser is light, and blurs of large pictures take long.
_FINEST_PX, _COARSEST_PX = 0.7, 8.0


@dataclass(frozen=True, slots=True, eq=False)
class Grain:
    """The bands of a texture: the two blurs whose difference each is, and what makes white noise of it."""

    sigmas: tuple[float, ...]
    mixes: tuple[NDArray[np.float64], ...]

    @classmethod
    def of(cls, detail: Floats, known: Mask, *, most_px: float) -> "Grain":
        """The grain of `detail` where it is `known`, in bands up to `most_px` pixels or less."""
        sigmas = [_FINEST_PX]
        while sigmas[-1] * 2 <= min(most_px, _COARSEST_PX):
            sigmas.append(sigmas[-1] * 2)
        values = np.where(known[:, :, None], detail, np.float32(0))
        white = np.random.default_rng(0).standard_normal((256, 256)).astype(np.float32)
        mixes: list[NDArray[np.float64]] = []
        last, last_white = values, white
        for sigma in sigmas:
            weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), sigma)
            blurred = cv2.GaussianBlur(values, (0, 0), sigma) / np.maximum(weight, 1e-3)[:, :, None]
            found = (last - blurred)[known] if known.any() else np.zeros((1, 3))
            mixes.append(
                _root(np.asarray(found, np.float32))
                / max(float((last_white - _blur(white, sigma)).std()), 1e-6)
            )
            last, last_white = np.asarray(blurred, np.float32), _blur(white, sigma)
        return cls(tuple(sigmas), tuple(mixes))

    def drawn(self, where: Mask, *, seed: int) -> Floats:
        """Grain [h, w, 3]; 0 beyond the rows and columns that hold something of `where` [h, w]."""
        result = np.zeros((*where.shape, 3), np.float32)
        rows, columns = (np.flatnonzero(where.any(axis)) for axis in (1, 0))
        if not len(rows):
            return result
        part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        shape = (len(result[part]), result[part].shape[1])
        noise = np.random.default_rng(seed).standard_normal((*shape, 3), np.float32)
        last = noise
        for sigma, mix in zip(self.sigmas, self.mixes, strict=True):
            blurred = _blur(noise, sigma)
            result[part] += (last - blurred) @ mix.T.astype(np.float32)
            last = blurred
        return result


def _blur(values: Floats, sigma: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma), np.float32)


def _root(values: Floats) -> NDArray[np.float64]:
    """A matrix [3, 3] that makes white noise as strong as most of the values [K, 3] are."""
    covariance = values.astype(float).T @ values.astype(float) / max(1, len(values))
    sizes, axes = np.linalg.eigh(covariance)
    # By the median, as a normal distribution's: few strong values are edges of other things.
    typical = 1.4826 * float(np.median(np.abs(values))) / max(float(np.sqrt((values**2).mean())), 1e-9)
    return axes * np.sqrt(np.maximum(sizes, 0)) * min(1.0, typical)

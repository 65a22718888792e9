"""How near a fill comes to what was hidden, and how it looks: soft, sharp, with a seam.

Convention: pictures are float [H, W, 3] in 0..255, holes bool [H, W].
"""

from dataclasses import dataclass

import cv2
import numpy as np

_WINDOW_PX = 7
_LEAST_ERROR = 1e-3
# Values are whole numbers, so that a difference of two neighbours is off by sqrt(1/6): no step is known
# better than that, and where both the fill and the truth are flat their ratio is 1.
_ROUNDING = 1 / 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """One fill of one hole.

    `l1` and `psnr` (dB) over the hole; `ssim` the mean over the hole of the map of Wang et al. 2004 (windows
    of 7 pixels). `sharp`: the gradient's energy in the hole to that of the truth; 1 for the truth, less for
    what is blurred. `sharp_pattern`: to that of the pattern outside the hole. `seam`: the step across the
    hole's rim to that of the truth; 1 for the truth, more where one sees where the fill begins.
    """

    l1: float
    psnr: float
    ssim: float
    sharp: float
    sharp_pattern: float
    seam: float


def judged(
    truth: np.ndarray, filled: np.ndarray, hole: np.ndarray, *, pattern: np.ndarray, known: np.ndarray
) -> Measures:
    """Hold a fill of `hole` to the `truth`, a photo that is `known` there with its pattern at `pattern`."""
    rows, columns = (slice(at.min(), at.max() + 1) for at in np.nonzero(hole))
    off = (truth[rows, columns].astype(float) - filled[rows, columns])[hole[rows, columns]]
    inside, around = energy(filled, hole), energy(truth, pattern & known & ~hole)
    return Measures(
        l1=float(np.abs(off).mean()),
        psnr=float(10 * np.log10(255**2 / max(float((off**2).mean()), _LEAST_ERROR))),
        ssim=float(similarity(truth, filled)[hole].mean()),
        sharp=_ratio(inside, energy(truth, hole)),
        sharp_pattern=_ratio(inside, around),
        seam=_ratio(step(truth, filled, hole, known), step(truth, truth, hole, known), _ROUNDING**0.5),
    )


def energy(picture: np.ndarray, where: np.ndarray) -> float:
    """The mean square of differences between neighbours that both lie within `where`; 0 without any."""
    squares, count = 0.0, 0
    for axis in (0, 1):
        there, differences = _pairs(where, axis), np.diff(picture, axis=axis)
        both = there[0] & there[1]
        squares += float((differences[both].astype(float) ** 2).sum())
        count += int(both.sum()) * picture.shape[2]
    return squares / max(1, count)


def step(truth: np.ndarray, filled: np.ndarray, hole: np.ndarray, known: np.ndarray) -> float:
    """The mean difference between the fill's outermost pixels and the photo's next to them."""
    total, count = 0.0, 0
    for axis in (0, 1):
        (first, second), rest = _pairs(hole, axis), _pairs(known & ~hole, axis)
        fills, photos = _pairs(filled, axis), _pairs(truth, axis)
        for inner, outer, rim in ((0, 1, first & rest[1]), (1, 0, second & rest[0])):
            total += float(np.abs(fills[inner][rim].astype(float) - photos[outer][rim]).sum())
            count += int(rim.sum()) * truth.shape[2]
    return total / max(1, count)


def similarity(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The map of structural similarity [H, W] (Wang, Bovik, Sheikh, Simoncelli 2004), mean over colours."""
    first, second = (one.astype(np.float64) for one in (first, second))
    unbiased = _WINDOW_PX**2 / (_WINDOW_PX**2 - 1)

    def mean(values: np.ndarray) -> np.ndarray:
        return cv2.blur(values, (_WINDOW_PX, _WINDOW_PX), borderType=cv2.BORDER_REFLECT)

    one, other = mean(first), mean(second)
    spread = unbiased * (mean(first**2) + mean(second**2) - one**2 - other**2)
    common = unbiased * (mean(first * second) - one * other)
    light, detail = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    numerator = (2 * one * other + light) * (2 * common + detail)
    return (numerator / ((one**2 + other**2 + light) * (spread + detail))).mean(2)


def _pairs(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Every pixel but the last along an axis, and the one after it."""
    return (values[:-1], values[1:]) if axis == 0 else (values[:, :-1], values[:, 1:])


def _ratio(value: float, other: float, floor: float = _ROUNDING) -> float:
    return (value + floor) / (other + floor)

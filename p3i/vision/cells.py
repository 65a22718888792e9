"""The cells of a lattice as vectors: features of a sheet, a robust median cell, agreement with it.

Convention: a *sheet* is a photo in lattice coordinates (p3i.vision.sheet). Cells are cut from it as
arrays [N, C, n, n], n = `side`, N running over rows then columns of the box; `seen` [N, n, n] says which
samples are known. Agreement is a correlation of local gradient orientation and colour, free in gain and
offset of the light, 1 for equal cells, about 0 for unrelated ones. Arrays in, arrays out.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.vision.lab import lab_of
from p3i.vision.sheet import Sheet

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

GRADIENT = slice(0, 3)
COLOUR = slice(3, 6)
_FLAT = 0.4  # a cell with less energy than this share of the template's counts as if it had that share


def lab(rgb: Floats) -> Floats:
    """RGB [3, H, W] in 0..1 to Lab [3, H, W], scaled so that L runs over 0..1 and a, b alike."""
    return np.asarray(
        lab_of(np.ascontiguousarray(rgb.transpose(1, 2, 0))).transpose(2, 0, 1) / 100, np.float32
    )


def masked_mean(values: Floats, seen: Mask, size: int) -> Floats:
    """Means of values [C, H, W] over what is seen in windows of `size` (Gaussian, sigma = size / 3)."""
    weight = seen.astype(np.float32)
    window = (0, 0)
    below = cv2.GaussianBlur(weight, window, size / 3) + 1e-4
    return np.stack([cv2.GaussianBlur(v * weight, window, size / 3) / below for v in values])


def sheet_features(sheet: Sheet) -> tuple[Floats, Mask]:
    """Features [6, H, W] of a sheet and where they are known.

    Three of gradient: its strength and its orientation as a double angle, blind to black against white
    (what stays equal when the light or the paint changes). Three of colour: Lab less its local mean. Both
    groups are divided by their local energy, so that shadow and haze do not decide.
    """
    colour = lab(sheet.values)
    seen = sheet.seen
    inner = cv2.erode(seen.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    smooth = np.stack([cv2.GaussianBlur(c, (0, 0), 0.7) for c in colour])
    gx = np.stack([cv2.Sobel(c, cv2.CV_32F, 1, 0, ksize=3, scale=0.125) for c in smooth]) * inner
    gy = np.stack([cv2.Sobel(c, cv2.CV_32F, 0, 1, ksize=3, scale=0.125) for c in smooth]) * inner
    xx, yy, xy = (gx * gx).sum(0), (gy * gy).sum(0), (gx * gy).sum(0)
    strength = np.sqrt(xx + yy)
    root = np.maximum(strength, 1e-4) ** 1.5
    gradient = np.stack([np.sqrt(strength), (xx - yy) / root, 2 * xy / root])
    gradient -= masked_mean(gradient, inner, 2 * sheet.side)
    offset = colour - masked_mean(colour, seen, 2 * sheet.side)
    groups = [_normalised(group, inner, sheet.side) for group in (gradient, offset)]
    return np.concatenate(groups), inner


def _normalised(values: Floats, seen: Mask, side: int) -> Floats:
    """Values [C, H, W] over the root of their local energy plus half of the global one."""
    energy = (values * values).sum(axis=0, keepdims=True) * seen
    everywhere = float(energy.sum() / max(seen.sum(), 1))
    local = masked_mean(energy, seen, 3 * side)
    return np.where(seen, values / np.sqrt(local + 0.5 * everywhere + 1e-9), 0).astype(np.float32)


def cut(values: NDArray, side: int) -> NDArray:
    """Cells [N, C, n, n] of a sheet [C, rows*side, columns*side]; [N, n, n] of a sheet [H, W]."""
    *head, height, width = values.shape
    grid = values.reshape(*head, height // side, side, width // side, side)
    if head:
        return grid.transpose(1, 3, 0, 2, 4).reshape(-1, head[0], side, side)
    return grid.transpose(0, 2, 1, 3).reshape(-1, side, side)


def weighted_mean(cells: Floats, seen: Mask, weights: NDArray) -> Floats:
    """Mean cell [C, n, n] of cells [N, C, n, n] by weights [N], over what is seen."""
    flat = cells.reshape(len(cells), -1)
    total = weights.astype(np.float32) @ flat
    known = weights.astype(np.float32) @ seen.reshape(len(seen), -1).astype(np.float32)
    return (total.reshape(cells.shape[1:]) / np.maximum(known.reshape(seen.shape[1:]), 1e-6)).astype(
        np.float32
    )


def median_cell(cells: Floats, seen: Mask, chosen: NDArray, *, most: int = 150) -> tuple[Floats, Floats]:
    """Median cell [C, n, n] of the chosen ones (indices) and the median absolute deviation from it."""
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).astype(int)]
    some = np.where(seen[chosen][:, None], cells[chosen], np.nan)
    with np.errstate(all="ignore"):
        middle = _nanmedian(some)
        spread = _nanmedian(np.abs(some - middle))
    return middle.astype(np.float32), spread.astype(np.float32)


def _nanmedian(values: NDArray) -> NDArray:
    """Median [...] over the first axis of [N, ...] of what is not nan; 0 where nothing is known.

    np.nanmedian would warn of that.
    """
    ordered = np.sort(values, axis=0)
    known = np.isfinite(ordered).sum(axis=0)
    low = np.take_along_axis(ordered, np.maximum((known - 1) // 2, 0)[None], axis=0)[0]
    high = np.take_along_axis(ordered, np.maximum(known // 2, 0).clip(max=len(values) - 1)[None], axis=0)[0]
    return np.where(known > 0, (low + high) / 2, 0.0)


def shifted(template: Floats, shifts: NDArray) -> Floats:
    """The template [C, n, n] rolled by whole samples (x, y) of shifts [S, 2]: [S, C, n, n]."""
    return np.stack([np.roll(template, (int(y), int(x)), axis=(1, 2)) for x, y in shifts])


def agreement(cells: Floats, seen: Mask, templates: Floats) -> Floats:
    """Correlation [N, S] of cells [N, C, n, n] with templates [S, C, n, n], over what is seen of a cell.

    A cell emptier than the template does not gain from its normalisation: its energy counts as at least
    a share of the template's.
    """
    count, kinds = len(cells), len(templates)
    flat = cells.reshape(count, -1)
    known = seen.reshape(count, -1).astype(np.float32)
    product = flat @ templates.reshape(kinds, -1).T
    energy = (flat * flat).sum(axis=1)[:, None]
    expected = known @ (templates**2).sum(axis=1).reshape(kinds, -1).T
    return correlation(product, energy, expected)


def correlation(product: Floats, energy: Floats, expected: Floats) -> Floats:
    """Correlations [...] from products and energies; a flat cell's counts as part of `expected`."""
    scale = np.sqrt(np.maximum(energy, _FLAT**2 * expected) * expected)
    return (product / np.maximum(scale, 1e-6)).astype(np.float32)

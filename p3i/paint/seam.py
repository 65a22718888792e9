"""How well a texture wraps, and how a piece of a photo is made to."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from p3i.size import Size


@dataclass(frozen=True, slots=True)
class Seam:
    """Mean absolute differences (0 to 255) of neighbouring pixels: across the wrap, and inside the tile.

    `across_*` [left to right, top to bottom] near `inside_*` is a seam that nobody sees; None where a
    direction does not wrap.
    """

    across_x: float
    inside_x: float
    across_y: float | None
    inside_y: float | None

    @property
    def ratio(self) -> float:
        """The worse of the two directions, against the differences inside; 1 or less is no seam."""
        found = [self.across_x / max(self.inside_x, 0.25)]
        if self.across_y is not None and self.inside_y is not None:
            found.append(self.across_y / max(self.inside_y, 0.25))
        return max(found)

    def record(self) -> dict[str, Any]:
        """As plain JSON values."""
        names = ("across_x", "inside_x", "across_y", "inside_y")
        values = {name: getattr(self, name) for name in names} | {"ratio": self.ratio}
        return {name: None if value is None else round(value, 3) for name, value in values.items()}

    def sentence(self) -> str:
        """For people."""
        found = f"seam {self.across_x:.2f} across the wrap against {self.inside_x:.2f} inside, left to right"
        if self.across_y is not None:
            found += f"; {self.across_y:.2f} against {self.inside_y:.2f}, top to bottom"
        return f"{found} (mean difference of neighbours, of 255)"


def seam_of(pixels: np.ndarray, known: np.ndarray, *, down: bool) -> Seam:
    """The seam of a tile [H, W, 3] in 0..1, where `known` [H, W]; `down` says whether it wraps downwards."""
    across_x, inside_x = _differences(pixels, known)
    if not down:
        return Seam(across_x, inside_x, None, None)
    across_y, inside_y = _differences(pixels.transpose(1, 0, 2), known.T)
    return Seam(across_x, inside_x, across_y, inside_y)


def wrapped(pixels: np.ndarray, size: Size) -> np.ndarray:
    """A tile [H, W, 3] of `size` from a larger piece: what lies beyond the far sides is blended over the near.

    `pixels` [H + a, W + b, 3] holds a rows and b columns more, none perhaps.
    """
    extra = pixels.shape[1] - size.width
    found = pixels[:, : size.width].copy()
    if extra:
        share = _ramp(extra)[None, :, None]
        found[:, :extra] = share * found[:, :extra] + (1 - share) * pixels[:, size.width :]
    extra = pixels.shape[0] - size.height
    rows = found[: size.height].copy()
    if extra:
        share = _ramp(extra)[:, None, None]
        rows[:extra] = share * rows[:extra] + (1 - share) * found[size.height :]
    return rows


def _ramp(count: int) -> np.ndarray:
    """From near 0 to near 1, smoothly."""
    at = (np.arange(count, dtype=np.float32) + 0.5) / count
    return at * at * (3 - 2 * at)


def _differences(pixels: np.ndarray, known: np.ndarray) -> tuple[float, float]:
    """Mean differences (0 to 255) of the last column to the first, and of neighbouring columns."""
    across = np.abs(pixels[:, -1] - pixels[:, 0])[known[:, -1] & known[:, 0]]
    inside = np.abs(np.diff(pixels, axis=1))[known[:, 1:] & known[:, :-1]]
    return tuple(255 * float(found.mean()) if found.size else 0.0 for found in (across, inside))  # pyright: ignore

"""How well a texture wraps, and how a piece of a photo is made to."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from p3i.size import Size

_FAINT, _PLAIN = 1.25, 2.0
"""A seam is faint, or plain, where neighbours differ by more than so many times as much as elsewhere."""

_LEVEL = 1.0
"""What differs by no more than one of 255 levels nobody sees."""


@dataclass(frozen=True, slots=True)
class Seam:
    """Mean absolute differences (0 to 255) of neighbouring pixels: across the wrap, and inside the tile.

    `across_*` (x: left to right, y: top to bottom) near `inside_*` is a seam that nobody sees; None where a
    direction does not wrap. `beside_*` are those next to the wrap on either side: where a line of the pattern
    runs along the wrap they are large, too.
    """

    across_x: float
    inside_x: float
    beside_x: float
    across_y: float | None
    inside_y: float | None
    beside_y: float | None

    @property
    def ratios(self) -> tuple[float, float | None]:
        """The differences across the wrap against the larger of those inside and beside it, x and y."""
        x = self.across_x / max(self.inside_x, self.beside_x, 0.25)
        if self.across_y is None or self.inside_y is None or self.beside_y is None:
            return x, None
        return x, self.across_y / max(self.inside_y, self.beside_y, 0.25)

    @property
    def ratio(self) -> float:
        """The worse of the two directions; 1 is no seam."""
        return max(ratio for ratio in self.ratios if ratio is not None)

    def record(self) -> dict[str, Any]:
        """As plain JSON values."""
        names = ("across_x", "inside_x", "beside_x", "across_y", "inside_y", "beside_y")
        values = {name: getattr(self, name) for name in names} | {"ratio": self.ratio}
        return {name: None if value is None else round(value, 3) for name, value in values.items()}

    def sentence(self) -> str:
        """For people: whether a seam shows where the tile meets itself, and how strongly."""
        sides = zip(
            ("left to right", "top to bottom"), self.ratios, (self.across_x, self.across_y), strict=True
        )
        said = [
            f"{'a seam shows' if ratio > _PLAIN else 'a faint seam'} {way}, where neighbouring pixels differ "
            f"{ratio:.1f} times as much as elsewhere in the tile"
            for way, ratio, across in sides
            if ratio is not None and across is not None and ratio > _FAINT and across > _LEVEL
        ]
        if said:
            return "; ".join(said)
        ways = "left to right" if self.across_y is None else "left to right and top to bottom"
        return f"it wraps {ways} without a visible seam"


def seam_of(pixels: np.ndarray, known: np.ndarray, *, down: bool) -> Seam:
    """The seam of a tile [H, W, 3] in 0..1, where `known` [H, W]; `down` says whether it wraps downwards."""
    x = _differences(pixels, known)
    if not down:
        return Seam(*x, None, None, None)
    return Seam(*x, *_differences(pixels.transpose(1, 0, 2), known.T))


def wrapped(
    pixels: np.ndarray, known: np.ndarray, size: Size, *, grain: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A tile [H, W, 3] of `size`, and what of it is known, from a larger piece.

    `pixels` [H + a, W + b, 3] and `known` hold a rows and b columns more, none perhaps: what lies beyond the
    right and lower sides is blended into the near sides, which it continues. So is `grain`, which is added:
    where two grains meet, which have nothing to do with each other, the blend is as strong as either.
    """
    found, seen = _folded(pixels, known, size.width)
    found, seen = _folded(found.transpose(1, 0, 2), seen.T, size.height)
    if grain is not None:
        own, own_seen = _folded(grain, known, size.width, strong=True)
        found = found + _folded(own.transpose(1, 0, 2), own_seen.T, size.height, strong=True)[0]
    return np.ascontiguousarray(found.transpose(1, 0, 2)), np.ascontiguousarray(seen.T)


def _folded(
    pixels: np.ndarray, known: np.ndarray, width: int, *, strong: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """The first `width` columns, with those beyond blended over the first; `strong` keeps their variance."""
    extra = pixels.shape[1] - width
    found, seen = pixels[:, :width].copy(), known[:, :width].copy()
    if extra:
        own, other = seen[:, :extra], known[:, width:]
        share = np.where(own & other, _ramp(extra)[None, :], own.astype(np.float32))[:, :, None]
        lost = np.sqrt(share**2 + (1 - share) ** 2) if strong else np.float32(1)
        found[:, :extra] = (share * found[:, :extra] + (1 - share) * pixels[:, width:]) / lost
        seen[:, :extra] = own | other
    return found, seen


def _ramp(count: int) -> np.ndarray:
    """From near 0 to near 1, smoothly."""
    at = (np.arange(count, dtype=np.float32) + 0.5) / count
    return at * at * (3 - 2 * at)


def _differences(pixels: np.ndarray, known: np.ndarray) -> tuple[float, float, float]:
    """Mean differences (0 to 255): of the last column to the first, of neighbours, of those by the wrap."""
    steps = np.abs(np.diff(pixels, axis=1)).mean(axis=2)
    both = known[:, 1:] & known[:, :-1]
    across = np.abs(pixels[:, -1] - pixels[:, 0]).mean(axis=1)[known[:, -1] & known[:, 0]]
    ends = [0, 1, -2, -1]
    beside = [_mean(steps[:, end][both[:, end]]) for end in ends if steps.shape[1] >= 4]
    return _mean(across), _mean(steps[both]), max(beside, default=0.0)


def _mean(values: np.ndarray) -> float:
    return 255 * float(values.mean()) if values.size else 0.0

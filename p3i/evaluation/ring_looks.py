"""How the objects of rendered rings look: dots that stand upright, and marks that point away from the centre.

Convention: as in looks.py, RGBA float32 [S, S, 4]; a mark points up, and lies within the circle that
touches the sprite's sides, so that turning cuts nothing off.
"""

import cv2
import numpy as np

from p3i.evaluation.looks import LOOKS, SIDE, Look, Random, axes, inside, random_colour, rgba, smooth


def _tick(random: Random) -> np.ndarray:
    """A bar, as on a dial: longer than wide, with a darker end."""
    x, y = axes()
    wide = random.uniform(0.32, 0.5)
    body = inside(
        0.1 - np.hypot(*np.maximum(np.abs([x, y / 1.3]) - np.array([wide - 0.1, 0.52])[:, None, None], 0))
    )
    shade = 1 - random.uniform(0.1, 0.5) * inside(y - 0.3)
    return rgba(random_colour(random) * shade[..., None], body)


def _drop(random: Random) -> np.ndarray:
    """A drop: round outside, pointed towards the centre."""
    x, y = axes()
    along = np.clip((y + 0.9) / 1.8, 0, 1)
    wide = 0.75 * np.sqrt(np.clip(along, 0, 1)) * np.sqrt(np.clip(1 - along**2, 0, 1)) * 1.5
    body = inside((np.minimum(wide[::-1], 0.8) - np.abs(x)) * 0.8)
    shine = np.exp(-((x + 0.2) ** 2 + (y + 0.4) ** 2) / 0.05)
    return rgba(random_colour(random) * (0.8 + 0.4 * shine)[..., None], body)


def _wedge(random: Random) -> np.ndarray:
    """A segment of a dial: wider outside, in two colours."""
    x, y = axes()
    wide = 0.42 - 0.22 * y
    body = inside(np.minimum(wide - np.abs(x), 0.62 - np.abs(y)))
    band = inside(-0.2 - y)[..., None]
    first, second = random_colour(random), random_colour(random)
    return rgba(first + band * (second - first), body)


def _arrow(random: Random) -> np.ndarray:
    """An arrow outwards: a head on a shaft."""
    x, y = axes()
    head = np.minimum((y + 0.9) * 0.75 - np.abs(x), 0.1 - y)
    shaft = np.minimum(0.3 - np.abs(x), np.minimum(0.85 - y, y + 0.1))
    shade = 0.9 + 0.2 * smooth(random, 6)
    return rgba(random_colour(random) * shade[..., None], inside(np.maximum(head, shaft)))


def _petal(random: Random) -> np.ndarray:
    """A petal or a leaf with a middle line."""
    x, y = axes()
    wide = 0.58 * np.sqrt(np.clip(1 - (y / 0.92) ** 2, 0, 1))
    line = inside(0.06 - np.abs(x))[..., None]
    first, second = random_colour(random) * (0.7 + 0.3 * (1 - y) / 2)[..., None], 0.6 * random_colour(random)
    return rgba(first + 0.8 * line * (second - first), inside(wide - np.abs(x)))


def _bolt(random: Random) -> np.ndarray:
    """A bolt: six corners around a hole or a slot."""
    x, y = axes()
    turn, radius = np.arctan2(y, x), np.hypot(x, y)
    rim = 0.78 / np.maximum(np.cos((turn + np.pi / 6) % (np.pi / 3) - np.pi / 6), 0.5)
    hole = inside(random.uniform(0.3, 0.45) - radius)[..., None]
    metal = (0.6 + 0.3 * random_colour(random)) * (0.85 + 0.25 * np.cos(turn - 2))[..., None]
    return rgba(metal * (1 - 0.75 * hole), inside(rim - radius))


def _turnable(look: Look) -> Look:
    """A look that may fill its square, made small enough to be turned."""

    def smaller(random: Random) -> np.ndarray:
        return shrunk(look(random), 0.74)

    return smaller


DOTS: dict[str, Look] = {
    "disc": LOOKS["disc"],
    "ring": LOOKS["ring"],
    "flower": LOOKS["flower"],
    "blob": LOOKS["blob"],
    "bolt": _bolt,
}
"""Looks that stand upright at every place of a ring."""

MARKS: dict[str, Look] = {
    "tick": _tick,
    "drop": _drop,
    "wedge": _wedge,
    "arrow": _arrow,
    "petal": _petal,
    "tile": _turnable(LOOKS["tile"]),
    "window": _turnable(LOOKS["window"]),
    "letter": _turnable(LOOKS["letter"]),
}
"""Looks that turn with the ring: their upper side points away from the centre."""


def shrunk(pixels: np.ndarray, share: float) -> np.ndarray:
    """The sprite at `share` of its size, in the middle of a sprite of the same size."""
    return _moved(pixels, cv2.getRotationMatrix2D(_MIDDLE, 0, share))


def pointed(pixels: np.ndarray, outward_deg: float) -> np.ndarray:
    """The sprite with its upper side turned to `outward_deg` (0 is to the right, 90 down)."""
    return _moved(pixels, cv2.getRotationMatrix2D(_MIDDLE, -(outward_deg + 90), 1))


_MIDDLE = ((SIDE - 1) / 2, (SIDE - 1) / 2)


def _moved(pixels: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    premultiplied = np.concatenate([pixels[..., :3] * pixels[..., 3:], pixels[..., 3:]], axis=2)
    moved = cv2.warpAffine(premultiplied, matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
    return rgba(moved[..., :3] / np.maximum(moved[..., 3:], 1e-6), moved[..., 3])

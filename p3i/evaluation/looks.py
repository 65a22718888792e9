"""How the objects of rendered scenes look: sprites drawn from a random generator, no two alike.

Convention: RGBA float32 [S, S, 4] in 0..1, plain alpha, S = SIDE.
"""

from collections.abc import Callable

import cv2
import numpy as np

SIDE = 128
"""Pixels of a sprite's side."""

Random = np.random.Generator
Look = Callable[[Random], np.ndarray]


def _disc(random: Random) -> np.ndarray:
    """A ball or a coin: a disc with a highlight and a darker rim."""
    x, y = axes()
    radius = np.hypot(x, y)
    shade = 1 - 0.35 * np.clip(radius, 0, 1) ** 3 + 0.3 * np.exp(-((x + 0.3) ** 2 + (y + 0.35) ** 2) / 0.06)
    return rgba(random_colour(random) * shade[..., None], inside(0.92 - radius))


def _ring(random: Random) -> np.ndarray:
    """A washer: a ring around a hole."""
    x, y = axes()
    radius = np.hypot(x, y)
    hole = random.uniform(0.35, 0.6)
    shade = 0.85 + 0.15 * np.cos(3 * np.arctan2(y, x) + random.uniform(0, 6))
    return rgba(random_colour(random) * shade[..., None], inside(0.92 - radius) * inside(radius - hole))


def _window(random: Random) -> np.ndarray:
    """A window: a frame, a cross, panes that reflect unevenly."""
    x, y = axes()
    wide = random.uniform(0.55, 0.85)
    frame = inside(np.minimum(wide - np.abs(x), 0.9 - np.abs(y)))
    bar = 0.07
    pane = inside(np.minimum(wide - 2 * bar - np.abs(x), 0.9 - 2 * bar - np.abs(y)))
    pane = pane * inside(np.abs(x) - bar) * inside(np.abs(y - random.uniform(-0.3, 0.1)) - bar)
    glass = 0.5 * random_colour(random) * (0.7 + 0.5 * smooth(random, 5))[..., None]
    wood = np.clip(random_colour(random) * 0.3 + 0.65, 0, 1)
    return rgba(wood + pane[..., None] * (glass - wood), frame)


def _tile(random: Random) -> np.ndarray:
    """A rounded tile with a figure in its middle."""
    x, y = axes()
    corner = np.maximum(np.abs([x, y]) - 0.65, 0)
    body = inside(0.22 - np.hypot(*corner))
    petals = int(random.integers(3, 7))
    turn = np.arctan2(y, x)
    figure = inside(0.35 + 0.2 * np.cos(petals * turn + random.uniform(0, 6)) - np.hypot(x, y))
    ground, mark = random_colour(random), random_colour(random)
    texture = 0.85 + 0.3 * smooth(random, 20)
    return rgba((ground + figure[..., None] * (mark - ground)) * texture[..., None], body)


def _flower(random: Random) -> np.ndarray:
    """Petals around a heart of another colour."""
    x, y = axes()
    radius, turn = np.hypot(x, y), np.arctan2(y, x)
    petals = int(random.integers(5, 9))
    shape = inside(0.6 + 0.3 * np.cos(petals * turn) - radius)
    heart = inside(0.25 - radius)[..., None]
    petal = random_colour(random) * (0.7 + 0.4 * radius)[..., None]
    return rgba(petal + heart * (random_colour(random) - petal), shape)


def _blob(random: Random) -> np.ndarray:
    """A pebble or a leaf: an uneven outline with a texture."""
    x, y = axes()
    outline = 0.75 + 0.18 * np.cos(2 * np.arctan2(y, x) + random.uniform(0, 6))
    outline = outline + 0.12 * np.cos(3 * np.arctan2(y, x) + random.uniform(0, 6))
    return rgba(
        random_colour(random) * (0.55 + 0.9 * smooth(random, 9))[..., None], inside(outline - np.hypot(x, y))
    )


def _letter(random: Random) -> np.ndarray:
    """A letter on a label."""
    x, y = axes()
    label = inside(0.9 - np.maximum(np.abs(x), np.abs(y) * 1.15))
    page = np.zeros((SIDE, SIDE), np.uint8)
    letter = chr(ord("A") + int(random.integers(26)))
    cv2.putText(page, letter, (26, 100), cv2.FONT_HERSHEY_DUPLEX, 3.4, 255, 9, cv2.LINE_AA)
    ink = page.astype(np.float32)[..., None] / 255
    paper = 0.7 + 0.3 * random_colour(random)
    return rgba(paper + ink * (0.5 * random_colour(random) - paper), label)


LOOKS: dict[str, Look] = {
    "disc": _disc,
    "ring": _ring,
    "window": _window,
    "tile": _tile,
    "flower": _flower,
    "blob": _blob,
    "letter": _letter,
}
"""The looks by name."""


def varied(sprite: np.ndarray, random: Random, *, jitter: float) -> np.ndarray:
    """The sprite as its neighbour might look: turned, lighter or darker, as far as `jitter` (0..1) says."""
    turn = cv2.getRotationMatrix2D(((SIDE - 1) / 2, (SIDE - 1) / 2), float(random.normal(0, 8 * jitter)), 1)
    premultiplied = np.concatenate([sprite[..., :3] * sprite[..., 3:], sprite[..., 3:]], axis=2)
    turned = cv2.warpAffine(premultiplied, turn, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
    colour = turned[..., :3] / np.maximum(turned[..., 3:], 1e-6)
    return rgba(colour * float(np.exp(random.normal(0, 0.25 * jitter))), turned[..., 3])


def texture(random: Random, height: int, width: int) -> np.ndarray:
    """A ground for scenes: two colours mixed by noise of several sizes, RGB float32 [H, W, 3]."""
    longer = max(height, width)
    noise = np.zeros((height, width), np.float32)
    for octave in range(1, 7):
        cells = 2**octave
        grain = random.random((cells + 2, cells + 2), dtype=np.float32) - 0.5
        enlarged = cv2.resize(grain, (longer, longer), interpolation=cv2.INTER_CUBIC)
        noise += enlarged[:height, :width] * 0.8**octave
    mix = np.clip(0.5 + 0.8 * noise, 0, 1)[..., None]
    first, second = random_colour(random), random_colour(random)
    return (first + mix * 0.5 * (second - first)).astype(np.float32)


def axes() -> tuple[np.ndarray, np.ndarray]:
    """x and y over a sprite, from -1 to 1."""
    line = (np.arange(SIDE, dtype=np.float32) + 0.5) / SIDE * 2 - 1
    x, y = np.meshgrid(line, line)
    return x, y


def inside(depth: np.ndarray) -> np.ndarray:
    """1 where `depth` is positive, 0 where negative, a pixel of slope between."""
    return np.clip(0.5 + depth * SIDE / 2, 0, 1)


def smooth(random: Random, cells: int) -> np.ndarray:
    """Smooth noise in about 0..1 over a sprite."""
    grain = random.random((cells, cells), dtype=np.float32)
    return np.clip(cv2.resize(grain, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC), 0, 1)


def random_colour(random: Random) -> np.ndarray:
    """A random colour, RGB float32 [3], neither black nor white."""
    hsv = np.array(
        [[[random.uniform(0, 360), random.uniform(0.1, 0.9), random.uniform(0.3, 0.95)]]], np.float32
    )
    return cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0]


def rgba(colour: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    return np.clip(np.concatenate([colour, alpha[..., None]], axis=2), 0, 1).astype(np.float32)

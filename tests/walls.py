"""Photos with walls of small lamps: regular in a part of a large picture, with other things beside them."""

from dataclasses import dataclass

import cv2
import numpy as np

from p3i.vision.image import Image


@dataclass(frozen=True)
class Wall:
    """Lamps on a photo: `corner` (x, y) and `step` in pixels, `lamps` to the right and down, a small tilt."""

    corner: tuple[int, int]
    step: float
    lamps: tuple[int, int]
    colour: tuple[float, float, float] = (0.95, 0.85, 0.5)

    @property
    def outline(self) -> np.ndarray:
        """The four corners in turn, [4, 2] pixels."""
        (x, y), (columns, rows) = self.corner, self.lamps
        width, height = columns * self.step, rows * self.step
        return np.array(
            [
                (x, y),
                (x + width, y + 0.04 * height),
                (x + 0.98 * width, y + 0.96 * height),
                (x + 0.02 * width, y + height),
            ],
            np.float32,
        )


def hall(size: tuple[int, int], *walls: Wall, things: int = 40, seed: int = 3) -> Image:
    """A photo of `size` (width, height): a mottled ground, so many things, walls upon them."""
    chance, (width, height) = np.random.default_rng(seed), size
    pixels = np.full((height, width, 3), 0.55, np.float32)
    for grain, strength in ((200, 0.08), (60, 0.05), (12, 0.03)):
        coarse = chance.normal(0, strength, (height // grain + 2, width // grain + 2, 3)).astype(np.float32)
        pixels += cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    for _ in range(things):
        corner = chance.uniform(0, size)
        other = corner + chance.uniform(0.015, 0.09, 2) * width
        colour = tuple(chance.uniform(0.1, 0.9, 3).tolist())
        cv2.rectangle(pixels, corner.astype(int).tolist(), other.astype(int).tolist(), colour, -1)
    for wall in walls:
        tile = np.full((32, 32, 3), 0.12, np.float32)
        cv2.circle(tile, (16, 16), 10, wall.colour, -1, cv2.LINE_AA)
        flat = cv2.GaussianBlur(np.tile(tile, (wall.lamps[1], wall.lamps[0], 1)), (0, 0), 32 / wall.step / 2)
        down, across = flat.shape[:2]
        corners = np.array([(0, 0), (across, 0), (across, down), (0, down)], np.float32)
        matrix = cv2.getPerspectiveTransform(corners, wall.outline)
        shown = cv2.warpPerspective(np.ones((down, across), np.float32), matrix, size)[:, :, None]
        pixels = pixels * (1 - shown) + cv2.warpPerspective(flat, matrix, size) * shown
    pixels = cv2.GaussianBlur(pixels, (0, 0), 0.6) + chance.normal(0, 0.01, pixels.shape)
    return Image(np.clip(pixels, 0, 1).astype(np.float32), np.ones((height, width), bool))

"""Paints examples/tiles.jpg: a terrace of patterned tiles with a lawn around it, seen at a slant.

    python examples/make_tiles.py examples/tiles.jpg

The picture is computed, not photographed: each pixel is the mean of 16 rays, each ray asks `terrace` for
the colour of the plane where it lands. The true program stands in examples/tiles.p3p.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import torch

from p3i.interp.camera import Camera
from p3i.size import Size

SIZE = Size(960, 720)
CAMERA = Camera(rx_deg=-41.0, ry_deg=13.0)
FIRST = np.array([-26.0, -33.0])  # the middle of tile (0, 0), in program units
STEP_I = np.array([9.6, 2.4])
STEP_J = np.array([-2.4, 9.6])
TILES = (7, 6)
SUN = (0.97, 1.0, 1.03)  # a little too blue for blue, green and red, as cameras are


def noise(x: np.ndarray, y: np.ndarray, *, period: float, seed: int) -> np.ndarray:
    """Smooth noise in -1..1 at plane points, with features of about `period` program units."""
    table = np.random.default_rng(seed).uniform(-1, 1, (256, 256))
    u, v = x / period, y / period
    left, top = np.floor(u), np.floor(v)
    s, t = u - left, v - top
    s, t = s * s * (3 - 2 * s), t * t * (3 - 2 * t)
    i, j = left.astype(int) % 256, top.astype(int) % 256
    near, far = table[j, i], table[j, (i + 1) % 256]
    below, beyond = table[(j + 1) % 256, i], table[(j + 1) % 256, (i + 1) % 256]
    return (near * (1 - s) + far * s) * (1 - t) + (below * (1 - s) + beyond * s) * t


def terrace(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The colour (blue, green, red in 0..1) of the plane at (x, y): tiles, their border, and lawn."""
    cell_from_plane = np.linalg.inv(np.stack([STEP_I, STEP_J], axis=1))
    offset = np.stack([x, y], axis=-1) - FIRST
    u, v = np.moveaxis(offset @ cell_from_plane.T, -1, 0)
    i, j = np.round(u), np.round(v)
    du, dv = u - i, v - j
    paved = (i >= 0) & (i < TILES[0]) & (j >= 0) & (j < TILES[1])

    grass = 0.5 + 0.22 * noise(x, y, period=0.3, seed=1) + 0.2 * noise(x, y, period=5.0, seed=2)
    lawn = grass[..., None] * np.array([0.25, 0.55, 0.4])

    # No two tiles are quite alike: each has its own shade, and the clay its own grain.
    kiln = np.random.default_rng(3).uniform(-0.06, 0.06, (TILES[1], TILES[0]))
    shade = np.where(paved, kiln[j.clip(0, TILES[1] - 1).astype(int), i.clip(0, TILES[0] - 1).astype(int)], 0)
    grain = 0.05 * noise(x, y, period=0.35, seed=4) + 0.06 * noise(x, y, period=3.0, seed=5) + shade
    clay = np.array([0.40, 0.52, 0.72]) + grain[..., None]
    glaze = np.array([0.52, 0.33, 0.20]) + 0.7 * grain[..., None]
    cream = np.array([0.72, 0.83, 0.88]) + 0.5 * grain[..., None]
    grout = np.array([0.42, 0.44, 0.45]) + 0.5 * grain[..., None]

    diamond, radius = np.abs(du) + np.abs(dv), np.hypot(du, dv)
    colour = np.where((diamond < 0.36)[..., None], glaze, clay)
    colour = np.where((radius < 0.13)[..., None], cream, colour)
    colour = np.where((np.maximum(np.abs(du), np.abs(dv)) > 0.465)[..., None], grout, colour)
    return np.where(paved[..., None], colour, lawn)


def paint(*, samples: int = 4, seed: int = 6) -> np.ndarray:
    """The picture, uint8 [H, W, 3] in OpenCV's order, with the sensor's noise."""
    plane_from_image = torch.linalg.inv(CAMERA.image_from_plane(SIZE)).numpy()
    rows, columns = np.mgrid[0 : SIZE.height, 0 : SIZE.width].astype(float)
    total = np.zeros((SIZE.height, SIZE.width, 3))
    for a in range(samples):
        for b in range(samples):
            ray = np.stack(
                [columns + (a + 0.5) / samples - 0.5, rows + (b + 0.5) / samples - 0.5, np.ones_like(rows)],
                axis=-1,
            )
            x, y, depth = np.moveaxis(ray @ plane_from_image.T, -1, 0)
            total += terrace(x / depth, y / depth)
    light = 0.92 + 0.12 * (columns / SIZE.width) - 0.1 * (rows / SIZE.height)
    picture = total / samples**2 * light[..., None] * np.array(SUN)
    picture += np.random.default_rng(seed).normal(0, 0.012, picture.shape)
    return np.round(picture.clip(0, 1) * 255).astype(np.uint8)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "tiles.jpg")
    if not cv2.imwrite(str(target), paint(), [cv2.IMWRITE_JPEG_QUALITY, 80]):
        sys.exit(f"cannot write {target}")

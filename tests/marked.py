"""Pictures of programs for tests: a shaded mark on each object, in light that falls off to one side."""

import numpy as np

from p3i import loads
from p3i.place.moves import moves, nearest
from p3i.place.placed import placed
from p3i.vision.image import Image

LATTICE = """SetCameraPose(rx=-30, ry=10)
for i in range(-4, 5):
    for j in range(-3, 4):
        Draw(x=9*i + 1, y=9*j)
"""
RING = """SetCameraPose(rx=-25, ry=5)
for i in range(0, 12):
    Draw(x=26*Cos(30*i), y=26*Sin(30*i))
"""


def drawn(text: str, *, seed: int = 0, width: int = 480, height: int = 400) -> Image:
    """A picture of the program: a shaded mark on each object, whose direction follows its ring."""
    blank = Image(np.zeros((height, width, 3), np.float32), np.ones((height, width), bool))
    laid = placed(loads(text), blank)
    rows, columns = np.mgrid[0:height, 0:width]
    back = np.linalg.inv(laid.image_from_plane)
    at = np.stack([columns, rows, np.ones_like(rows)], -1) @ back.T
    points = (at[..., :2] / at[..., 2:]).reshape(-1, 2)
    number = nearest(laid, points)
    into_first = np.linalg.inv(moves(laid, 0))
    local = np.einsum("nij,nj->ni", into_first[number][:, :2, :2], points) + into_first[number][:, :2, 2]
    local = (local - laid.points[0]).reshape(height, width, 2)
    inside = np.hypot(local[..., 0], local[..., 1]) < 3.2
    light = 0.65 + 0.25 * columns / width
    mark = np.stack([0.3 + 0.08 * local[..., 0], 0.4 + 0.06 * local[..., 1], np.full(light.shape, 0.2)], -1)
    pixels = np.where(inside[..., None], mark, 0.8) * light[..., None]
    noise = np.random.default_rng(seed).normal(0, 0.004, pixels.shape)
    values = np.rint((pixels + noise).clip(0, 1) * 255) / 255
    return Image(values.astype(np.float32), np.ones((height, width), bool))

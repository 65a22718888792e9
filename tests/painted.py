"""A small lattice with known truth: discs that differ in colour, under light that falls off to one side."""

from dataclasses import dataclass

import cv2
import numpy as np
import torch

from p3i import loads
from p3i.paint.fill.npn.cells import Cells, cells_of
from p3i.paint.fill.npn.lessons import lessons, teachers
from p3i.paint.fill.npn.network import Batch
from p3i.paint.fill.npn.stacks import pool_of
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image

PROGRAM = """SetCameraPose(rx=-20, ry=8)
for i in range(-3, 4):
    for j in range(-2, 3):
        Draw(x=13*i, y=13*j)
"""


@dataclass(frozen=True)
class Scene:
    """A photo, its program, a hole, and what the hole hides is in `photo` still (no method may look)."""

    photo: Image
    placed: Placed
    hole: np.ndarray

    @property
    def corrupted(self) -> Image:
        return Image(
            np.where(self.hole[:, :, None], np.float32(0), self.photo.pixels), self.photo.valid & ~self.hole
        )

    def error(self, filled: np.ndarray) -> float:
        """The mean L1 over the hole, 0 to 255."""
        return 255 * float(np.abs(filled - self.photo.pixels)[self.hole].mean())


def scene() -> Scene:
    """160 x 120 pixels, 7 x 5 cells; the hole is a box of 0.7 cells in the middle."""
    height, width = 120, 160
    chance = np.random.default_rng(5)
    blank = Image(np.zeros((height, width, 3), np.float32), np.ones((height, width), bool))
    laid = placed(loads(PROGRAM), blank)
    points = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), -1)
    plane_from_image = np.linalg.inv(laid.image_from_plane)
    moved = points @ plane_from_image[:, :2].T + plane_from_image[:, 2]
    plane = moved[..., :2] / moved[..., 2:]
    pixels = np.full((height, width, 3), 0.65, np.float32)
    # The ring of a disc is of the colour that its middle is a darker shade of: the rim tells of the middle.
    for center in laid.points:
        far = np.hypot(*(plane - center).transpose(2, 0, 1))
        colour = chance.uniform(0.25, 0.95, 3)
        pixels[far < 5.6] = colour
        pixels[far < 3.2] = 0.4 * colour + 0.1
    light = 1 - 0.45 * points[..., :1] / width
    pixels = cv2.GaussianBlur((pixels * light).astype(np.float32), (0, 0), 0.7)
    hole = np.zeros((height, width), bool)
    hole[55:69, 74:88] = True
    return Scene(Image(pixels, np.ones((height, width), bool)), laid, hole)


def cells(found: Scene, *, hidden: bool = True) -> Cells:
    """The scene's cells, its hole hidden or not."""
    hole = found.hole if hidden else np.zeros_like(found.hole)
    return cells_of(found.photo, found.placed, hole, hole, device=torch.device("cpu"))


def batch(found: Scene, *, count: int = 16, seed: int = 0) -> Batch:
    """Lessons of the scene, one batch."""
    seen = cells(found)
    pool = pool_of(seen, torch.arange(1))
    outlines = torch.zeros(0, 1, seen.patch.height, seen.patch.width)
    return lessons(seen, pool, teachers(seen, pool), outlines, count=count, seed=seed)[0]

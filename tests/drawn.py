"""Rings drawn for tests: objects that turn as they go round, seen by a camera, known to the pixel."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import torch

from p3i.grammar.ast import Program
from p3i.interp.camera import Camera, rotation
from p3i.search.config import SearchConfig
from p3i.search.forms.filling import Filling
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.evidence import Evidence
from p3i.size import Size
from p3i.vision.image import Image

torch.set_num_threads(1)

SMALL = Size(448, 336)
_FINER = 4  # drawn larger, then averaged
# A flag: (along, across) the circle, in halves of the object's size; no turn takes it to itself.
_FLAG = np.array([(-1, -1), (1, -1), (1, 0), (-0.3, 0), (-0.3, 1), (-1, 1)], float)
_STRIPE = np.array([(-0.8, -0.8), (0.8, -0.8), (0.8, -0.4), (-0.8, -0.4)], float)


@dataclass(frozen=True)
class DrawnRing:
    """`count` flags of a `size` (program units) on a circle, those in `missing` left out.

    `slots` is how many would close the circle; `nudges` moves objects, in program units, along and across.
    `upright` flags do not turn with the circle.
    """

    count: int = 12
    slots: int = 12
    center: tuple[float, float] = (4.0, -3.0)
    radius: float = 24.0
    first_deg: float = 20.0
    size: float = 6.0
    rx_deg: float = -32.0
    ry_deg: float = 14.0
    focal_mm: float = 35.0
    missing: frozenset[int] = frozenset()
    nudges: Mapping[int, tuple[float, float]] | None = None
    canvas: Size = SMALL
    noise: float = 0.01
    upright: bool = False

    @property
    def image_from_plane(self) -> np.ndarray:
        return Camera(self.rx_deg, self.ry_deg, self.focal_mm).image_from_plane(self.canvas).numpy()

    def places(self) -> np.ndarray:
        """The objects' middles [count, 2] in program units, without their nudges."""
        turn = np.radians(self.first_deg + 360 / self.slots * np.arange(self.count))
        return np.array(self.center) + self.radius * np.stack([np.cos(turn), np.sin(turn)], 1)

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Points [N, 2] in program units as photo pixels [N, 2]."""
        at = np.c_[points, np.ones(len(points))] @ self.image_from_plane.T
        return at[:, :2] / at[:, 2:]

    def image(self) -> Image:
        width, height = self.canvas.width, self.canvas.height
        canvas = np.full((height * _FINER, width * _FINER, 3), (205, 200, 188), np.uint8)
        for number, place in enumerate(self.places()):
            if number in self.missing:
                continue
            turn = math.radians(-90 if self.upright else self.first_deg + 360 / self.slots * number)
            along = np.array([-math.sin(turn), math.cos(turn)])
            across = np.array([-along[1], along[0]])
            a, b = (self.nudges or {}).get(number, (0.0, 0.0))
            middle = place + a * along + b * across
            for shape, colour in ((_FLAG, (40, 60, 150)), (_STRIPE, (240, 190, 60))):
                corners = middle + self.size / 2 * (shape[:, :1] * along + shape[:, 1:] * across)
                at = np.round(((self.seen(corners) + 0.5) * _FINER - 0.5) * 16).astype(np.int32)
                cv2.fillPoly(canvas, [at], colour, cv2.LINE_AA, 4)
        pixels = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
        pixels += np.random.default_rng(0).normal(0, self.noise, pixels.shape).astype(np.float32)
        return Image(pixels.clip(0, 1), np.ones((height, width), bool))

    def evidence(self) -> Evidence:
        return Evidence(self.image(), SearchConfig(), 35.0)

    def numbers(self, filling: Filling, **changes: float) -> torch.Tensor:
        """The free numbers of a ring's sketch that draw this ring; `changes` are added: rx, r, a, x, ..."""
        values = {
            "camera.rx": self.rx_deg + changes.get("rx", 0.0),
            "camera.ry": self.ry_deg + changes.get("ry", 0.0),
            "draw.x.radius.1": self.radius + changes.get("r", 0.0),
            "draw.x.angle.1": self.first_deg + changes.get("a", 0.0),
            "draw.x.angle.j": 360 / self.slots,
            "draw.x.offset.1": self.center[0] + changes.get("x", 0.0),
            "draw.y.offset.1": self.center[1] + changes.get("y", 0.0),
        }
        return torch.tensor([values[unknown.name] for unknown in filling.moving], dtype=torch.float64)

    def filling(self) -> Filling:
        """The sketch of the closed ring, or of the arc."""
        return ring_filling(self.slots, drawn=None if self.count == self.slots else self.count)


def tilt_error_deg(found: Program, rx_deg: float, ry_deg: float) -> float:
    """The angle between the normals of a program's plane and of another."""
    first = np.asarray(rotation(found.camera.rx_deg, found.camera.ry_deg))[:, 2]
    second = np.asarray(rotation(rx_deg, ry_deg))[:, 2]
    return math.degrees(math.acos(min(1.0, abs(float(first @ second)))))


def noise_image(size: Size = SMALL, *, seed: int = 0) -> Image:
    """Blotches of all sizes, and no pattern."""
    random = np.random.default_rng(seed)
    pixels = np.full((size.height, size.width, 3), 0.5, np.float32)
    for cells in (8, 20, 50):
        small = random.normal(0, 0.12, (cells * 3 // 4, cells, 3)).astype(np.float32)
        pixels += cv2.resize(small, (size.width, size.height), interpolation=cv2.INTER_CUBIC)
    return Image(pixels.clip(0, 1), np.ones((size.height, size.width), bool))

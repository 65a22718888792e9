"""A picture of any program: what it draws, laid onto a textured ground. For programs of any kind."""

import math

import cv2
import numpy as np

from p3i.evaluation import looks, ring_looks
from p3i.evaluation.scene import Scene, as_sprite, on_canvas
from p3i.grammar.ast import Polar, Program
from p3i.interp.camera import Camera
from p3i.interp.unroll import affine_at, nest, points
from p3i.paint.draw.sprite import lay
from p3i.paint.draw.view import camera_view
from p3i.search.result import StructureFound
from p3i.size import Size


def program_scene(
    program: Program,
    seed: int,
    *,
    look: str = "flower",
    size: Size | None = None,
    jitter: float = 0.2,
    noise: float = 0.01,
    structure: StructureFound = "lattice",
) -> Scene:
    """The program's objects on a ground; the same seed gives the same pixels.

    Objects on a curve turn with it. `jitter` (0..1) is how much they differ, `noise` that of the pixels.
    """
    size = size or Size(480, 360)
    random = np.random.default_rng(seed)
    drawn = np.array(points(program), dtype=np.float64).reshape(-1, 4)
    apart = np.linalg.norm(drawn[:, None, :2] - drawn[:, :2], axis=2) + 1e9 * np.eye(len(drawn))
    spacing = float(np.median(apart.min(axis=1)))
    first = looks.LOOKS[look](random)
    angle = nest(program).draw.x
    sprites = []
    for _, _, i, j in drawn:
        kind = looks.varied(first, random, jitter=jitter)
        if isinstance(angle, Polar):
            kind = ring_looks.pointed(ring_looks.shrunk(kind, 0.9), affine_at(angle.angle, int(i), int(j)))
        sprites.append(as_sprite(kind))
    moved = drawn[:, :2] + random.normal(0, 0.05 * jitter * spacing, (len(drawn), 2))
    canvas = looks.texture(random, size.height, size.width)
    units = spacing * random.uniform(0.6, 0.85)
    layer = lay(camera_view(Camera.of(program), size), sprites, moved, units=units).astype(np.float32)
    alpha = layer[..., 3:] / 255
    canvas += alpha * (layer[..., :3] / 255 - canvas)
    canvas *= 1 + random.uniform(-0.2, 0.2) * np.linspace(-1, 1, size.width)[None, :, None].astype(np.float32)
    canvas = cv2.GaussianBlur(canvas, (0, 0), 0.6)
    canvas = canvas + random.normal(0, noise, canvas.shape).astype(np.float32)
    centers_px, index, seen = on_canvas(program, size)
    pixels = np.rint(np.clip(canvas, 0, 1) * 255).astype(np.uint8)
    return Scene(pixels, program, centers_px[seen], index[seen], look, seed, structure)


def spacing_px(scene: Scene) -> float:
    """The median distance of an object to its nearest neighbour in the picture; inf for a single one."""
    places = scene.centers_px
    if len(places) < 2:
        return math.inf
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e9 * np.eye(len(places))
    return float(np.median(apart.min(axis=1)))

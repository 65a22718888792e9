"""Rendered lattices: a random basis under a random camera, cut by a guard now and then.

Everything follows from a seed: the same seed gives the same pixels. The pictures of a seed stay as they
are, since docs/benchmarks.md tells what was measured on them.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from p3i.evaluation.looks import LOOKS, Random, texture, varied
from p3i.evaluation.pose_sigma import lattice_sigma_deg
from p3i.evaluation.scene import Scene, as_sprite, least_distance, on_canvas
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, If, Program
from p3i.interp.camera import Camera
from p3i.interp.unroll import nest, points
from p3i.paint.draw.sprite import lay
from p3i.paint.draw.view import camera_view
from p3i.size import Size

_SIZE = Size(640, 480)

_LEAST_VISIBLE = 12
"""Objects that a scene must show."""

_STRAY = 0.05
"""Objects stray from their places by this share of the spacing, times the jitter."""

_LEAST_SPACING_PX = 16.0
"""Objects stand at least this far apart in the picture, or nothing could be told from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneOptions:
    """What scenes are made of: `jitter` (0..1) is how much objects differ, `noise` that of the pixels."""

    size: Size = _SIZE
    tilt_deg: tuple[float, float] = (5.0, 60.0)
    focal_mm: float = 35.0
    look: str | None = None
    jitter: float = 0.3
    noise: float = 0.015
    clutter: int = 4
    guards: float = 0.2
    """The share of scenes whose outline a guard cuts."""


def lattice_scene(seed: int, options: SceneOptions | None = None, **changes: Any) -> Scene:
    """The scene of a seed: a random lattice under a random camera. `changes` are fields of SceneOptions."""
    options = dataclasses.replace(options or SceneOptions(), **changes)
    random = np.random.default_rng(seed)
    look = options.look or str(random.choice(sorted(LOOKS)))
    while True:
        program = _program(random, options)
        centers_px, index, seen = on_canvas(program, options.size)
        centers_px, index = centers_px[seen], index[seen]
        if len(index) >= _LEAST_VISIBLE and least_distance(centers_px) >= _LEAST_SPACING_PX:
            break
    pixels = _pixels(program, look, random, options)
    stray = _STRAY * options.jitter * _spacing(program)
    sigma = lattice_sigma_deg(program, index, options.size, stray_units=stray)
    hidden = np.zeros(len(index), bool)
    return Scene(pixels, program, centers_px, index, look, seed, hidden=hidden, pose_sigma_deg=sigma)


def _program(random: Random, options: SceneOptions) -> Program:
    """A random lattice: u about horizontal, a reduced basis, indices around the middle of the picture."""
    tilt = math.radians(random.uniform(*options.tilt_deg))
    azimuth = random.uniform(0, 2 * math.pi)
    normal = (math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt))
    camera = Camera.from_normal(normal)
    turn = math.radians(random.uniform(-30, 30))
    across = math.radians(random.choice([90.0, random.uniform(70, 110)]))
    length, ratio = random.uniform(7, 17), random.choice([1.0, random.uniform(0.75, 1.33)])
    u = (length * math.cos(turn), length * math.sin(turn))
    v = (length * ratio * math.cos(turn + across), length * ratio * math.sin(turn + across))
    count_i, count_j = (int(random.integers(4, 12)) for _ in range(2))
    middle = [random.uniform(-8, 8) - (count_i - 1) / 2 * u[k] - (count_j - 1) / 2 * v[k] for k in (0, 1)]
    x, y = (Affine(round(u[k], 2), round(v[k], 2), round(middle[k], 2)) for k in (0, 1))
    body: Draw | If = Draw(x, y)
    if random.random() < options.guards:
        cut = int(random.integers(2, max(3, (count_i + count_j) // 2)))
        body = If(Affine(1, 1, -cut), body)
    inner = For("j", Affine(), Affine(constant=count_j), body)
    world = For("i", Affine(), Affine(constant=count_i), inner)
    pose = CameraPose(round(camera.rx_deg, 2), round(camera.ry_deg, 2))
    header = Header(canvas=(options.size.width, options.size.height), focal_mm=options.focal_mm)
    return Program(pose, world, header=header)


def _pixels(program: Program, look: str, random: Random, options: SceneOptions) -> np.ndarray:
    size = options.size
    canvas = texture(random, size.height, size.width)
    _add_clutter(canvas, random, options.clutter)
    first = LOOKS[look](random)
    kinds = [varied(first, random, jitter=options.jitter) for _ in range(24)]
    sprites = [as_sprite(kind) for kind in kinds]
    drawn = np.array(points(program), dtype=np.float64).reshape(-1, 4)[:, :2]
    spacing = _spacing(program)
    moved = drawn + random.normal(0, _STRAY * options.jitter * spacing, drawn.shape)
    turns = random.permutation(max(1, len(sprites)))
    layer = lay(
        camera_view(Camera.of(program), size),
        [sprites[turn] for turn in turns],
        moved,
        units=spacing * random.uniform(0.6, 0.95),
    ).astype(np.float32)
    alpha = layer[..., 3:] / 255
    shadow = cv2.GaussianBlur(np.roll(alpha[..., 0], (2, 3), axis=(0, 1)), (0, 0), 2.5)[..., None]
    canvas *= 1 - 0.4 * shadow
    canvas += alpha * (layer[..., :3] / 255 - canvas)
    light = 1 + random.uniform(-0.25, 0.25) * np.linspace(-1, 1, size.width)[None, :, None]
    light = light + random.uniform(-0.25, 0.25) * np.linspace(-1, 1, size.height)[:, None, None]
    canvas = cv2.GaussianBlur(canvas * light.astype(np.float32), (0, 0), random.uniform(0.4, 0.9))
    canvas = canvas + random.normal(0, options.noise, canvas.shape).astype(np.float32)
    return np.rint(np.clip(canvas, 0, 1) * 255).astype(np.uint8)


def _spacing(program: Program) -> float:
    """The shorter step of a lattice, in program units."""
    draw = nest(program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    return min(math.hypot(draw.x.i, draw.y.i), math.hypot(draw.x.j, draw.y.j))


def _add_clutter(canvas: np.ndarray, random: Random, count: int) -> None:
    """Paint things that belong to no pattern onto a ground, in place."""
    height, width = canvas.shape[:2]
    for _ in range(count):
        center = (int(random.uniform(0, width)), int(random.uniform(0, height)))
        axes = tuple(int(random.uniform(0.03, 0.15) * width) for _ in range(2))
        colour = tuple(float(part) for part in random.uniform(0.2, 0.9, 3))
        cv2.ellipse(canvas, center, axes, float(random.uniform(0, 180)), 0, 360, colour, -1, cv2.LINE_AA)

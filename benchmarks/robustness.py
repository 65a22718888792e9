"""How much a picture may be spoilt before `p3i.synth` loses its lattice: rendered scenes, one harm at a time.

python benchmarks/robustness.py                          # every harm, 8 scenes a level
python benchmarks/robustness.py --harm blur tilt --scenes 20
python benchmarks/robustness.py --out rows.json          # a row for each picture as well

The truth is that of the scene before it was spoilt. Everything follows from the seeds.
"""

import argparse
import dataclasses
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

import p3i
from p3i.evaluation.looks import LOOKS, Random, texture, varied
from p3i.evaluation.scenes import Scene, lattice_scene
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, Program
from p3i.interp.camera import Camera, project
from p3i.interp.unroll import nest, points
from p3i.paint.draw.sprite import lay, sprite_of
from p3i.paint.draw.view import camera_view
from p3i.search.config import SearchConfig
from p3i.search.result import SynthesisResult
from p3i.size import Size
from p3i.vision.decode import Source
from p3i.vision.image import Image

SIZE = Size(640, 480)
WHOLE = 0.15
"""Lattice vectors agree when they are whole combinations of the true ones up to this."""

_LEAST_SEEN = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What came of one picture; `pose_deg` is 90 without an answer."""

    harm: str
    level: str
    seed: int
    look: str
    tilt_deg: float
    objects: int
    answered: bool
    same_lattice: bool = False
    pose_deg: float = 90.0
    score: float = 0.0
    seconds: float = 0.0


Spoilt = Callable[[int], Scene]


def harms() -> dict[str, dict[str, Spoilt]]:
    """Every harm with its levels, the mildest first; a level makes the picture of a seed."""
    return {
        "none": {"-": lattice_scene},
        "blur": {f"{sigma:g} px": _afterwards(_blurred, sigma) for sigma in (1.5, 3.0, 5.0)},
        "jpeg": {f"quality {quality}": _afterwards(_compressed, quality) for quality in (30, 10, 5)},
        "noise": {f"{spread:g}": _afterwards(_noisy, spread) for spread in (0.05, 0.1, 0.2)},
        "light": {f"1:{ratio}": _afterwards(_lit, ratio) for ratio in (3, 6, 12)},
        "vignette": {f"1:{ratio}": _afterwards(_vignetted, ratio) for ratio in (3, 6)},
        "occlusion": {f"{share:.0%}": _afterwards(_covered, share) for share in (0.2, 0.4)},
        "missing": {f"{share:.0%}": _relaid(missing=share) for share in (0.15, 0.3, 0.45)},
        "looks": {f"jitter {jitter:g}": _relaid(jitter=jitter) for jitter in (0.7, 1.2, 2.0)},
        "area": {f"{share:.0%} of the frame": _small(share) for share in (0.2, 0.1, 0.05)},
        "period": {f"{period:.0f} px": _periodic(period) for period in (8, 12, 16, 24, 100, 160)},
        "tilt": {f"{low}-{low + 5} degrees": _tilted(low) for low in (60, 65, 70)},
    }


def _afterwards(harm: Callable[[Scene, float, Random], np.ndarray], amount: float) -> Spoilt:
    """A harm done to the finished picture: float [H, W, 3] in 0..1 -> the same."""

    def spoilt(seed: int) -> Scene:
        scene = lattice_scene(seed)
        pixels = harm(scene, amount, np.random.default_rng(10_000 + seed))
        return dataclasses.replace(scene, pixels=_bytes(pixels))

    return spoilt


def _blurred(scene: Scene, sigma: float, random: Random) -> np.ndarray:
    return cv2.GaussianBlur(_floats(scene), (0, 0), sigma)


def _compressed(scene: Scene, quality: float, random: Random) -> np.ndarray:
    _, file = cv2.imencode(".jpg", scene.pixels, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
    return np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR), np.float32) / 255


def _noisy(scene: Scene, spread: float, random: Random) -> np.ndarray:
    return _floats(scene) + random.normal(0, spread, scene.pixels.shape)


def _lit(scene: Scene, ratio: float, random: Random) -> np.ndarray:
    """Light that falls off across the picture, in any direction, to one `ratio`-th."""
    height, width = scene.pixels.shape[:2]
    turn = random.uniform(0, 2 * math.pi)
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    along = math.cos(turn) * x + math.sin(turn) * y
    along = (along - along.min()) / (along.max() - along.min())
    return _floats(scene) * (1.25 * ratio ** -along[..., None])


def _vignetted(scene: Scene, ratio: float, random: Random) -> np.ndarray:
    height, width = scene.pixels.shape[:2]
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    return _floats(scene) * (1.1 * ratio ** -((x * x + y * y) / 2)[..., None])


def _covered(scene: Scene, share: float, random: Random) -> np.ndarray:
    """Uneven blobs, as of people or leaves, laid on the picture until `share` of the objects is covered."""
    pixels = _floats(scene).copy()
    hidden = np.zeros(pixels.shape[:2], np.uint8)
    column, row = np.round(scene.centers_px).astype(int).T
    while hidden[row, column].mean() < share:
        middle = scene.centers_px[random.integers(len(scene.centers_px))]
        turns = np.linspace(0, 2 * math.pi, 40, endpoint=False)
        reach = random.uniform(25, 60) * (1 + 0.25 * np.cos(3 * turns + random.uniform(0, 6)))
        outline = middle + reach[:, None] * np.stack(
            [np.cos(turns), random.uniform(0.6, 1.6) * np.sin(turns)], 1
        )
        blob = cv2.fillPoly(np.zeros_like(hidden), [np.round(outline).astype(np.int32)], 1).astype(bool)
        ground = texture(random, hidden.shape[0], hidden.shape[1])
        pixels[blob] = ground[blob]
        hidden[blob] = 1
    return pixels


def _relaid(*, missing: float = 0.0, jitter: float = 0.3) -> Spoilt:
    """The lattice of a scene painted anew, with other objects."""

    def spoilt(seed: int) -> Scene:
        scene = lattice_scene(seed)
        return _painted(scene.program, scene.look, seed, missing=missing, jitter=jitter)

    return spoilt


def _small(share: float) -> Spoilt:
    """Six by six objects on `share` of the frame, anywhere in it."""

    def spoilt(seed: int) -> Scene:
        random = np.random.default_rng(20_000 + seed)
        period = math.sqrt(share * SIZE.width * SIZE.height / 36)
        reach = 3.5 * period / np.array([SIZE.width, SIZE.height])
        at = np.array([random.uniform(low, 1 - low) for low in np.minimum(reach, 0.45)])
        middle_px = at * (SIZE.width, SIZE.height)
        program = _lattice(
            random, tilt_deg=random.uniform(5, 50), period_px=period, count=6, middle_px=middle_px
        )
        return _painted(program, _look(random), seed, clutter=12)

    return spoilt


def _periodic(period: float) -> Spoilt:
    """Objects `period` pixels apart in the middle; they fill the frame where 24 x 24 are enough."""

    def spoilt(seed: int) -> Scene:
        random = np.random.default_rng(30_000 + seed)
        count = int(np.clip(round(720 / period), 4, 24))
        program = _lattice(random, tilt_deg=random.uniform(5, 40), period_px=period, count=count)
        return _painted(program, _look(random), seed)

    return spoilt


def _tilted(low_deg: float) -> Spoilt:
    def spoilt(seed: int) -> Scene:
        random = np.random.default_rng(40_000 + seed)
        tilt_deg = random.uniform(low_deg, low_deg + 5)
        program = _lattice(random, tilt_deg=tilt_deg, period_px=random.uniform(50, 80), count=11)
        return _painted(program, _look(random), seed)

    return spoilt


def _lattice(
    random: Random, *, tilt_deg: float, period_px: float, count: int, middle_px: np.ndarray | None = None
) -> Program:
    """`count` x `count` objects, in the picture's middle `period_px` apart (by area) around `middle_px`."""
    tilt, azimuth = math.radians(tilt_deg), random.uniform(0, 2 * math.pi)
    normal = (math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt))
    camera = Camera.from_normal(normal)
    matrix = camera.image_from_plane(SIZE).numpy()
    middle_px = np.array(SIZE.middle) if middle_px is None else middle_px
    middle = np.linalg.inv(matrix) @ [*middle_px, 1.0]
    middle = middle[:2] / middle[2]
    depth = matrix[2] @ [*middle, 1.0]
    unit_px = math.sqrt(abs(np.linalg.det(matrix)) / depth**3)
    turn, across = math.radians(random.uniform(-30, 30)), math.radians(random.uniform(75, 105))
    length, ratio = period_px / unit_px, math.sqrt(random.uniform(0.8, 1.25))
    u = length / ratio * np.array([math.cos(turn), math.sin(turn)])
    v = length * ratio / math.sin(across) * np.array([math.cos(turn + across), math.sin(turn + across)])
    first = middle - (count - 1) / 2 * (u + v)
    draw = Draw(Affine(u[0], v[0], first[0]), Affine(u[1], v[1], first[1]))
    bound = Affine(constant=count)
    world = For("i", Affine(), bound, For("j", Affine(), bound, draw))
    header = Header(canvas=(SIZE.width, SIZE.height), focal_mm=35.0)
    return Program(CameraPose(camera.rx_deg, camera.ry_deg), world, header=header)


def _painted(
    program: Program, look: str, seed: int, *, missing: float = 0.0, jitter: float = 0.3, clutter: int = 4
) -> Scene:
    """The picture of a lattice: objects of one kind, some of them missing, on a ground with clutter."""
    random = np.random.default_rng(50_000 + seed)
    view = camera_view(Camera.of(program), SIZE)
    drawn = np.array(points(program), dtype=np.float64).reshape(-1, 4)
    centers_px, depth = view.project(drawn[:, :2])
    limits = np.array([SIZE.width - 1, SIZE.height - 1])
    with np.errstate(invalid="ignore"):
        seen = (depth > 0) & (centers_px >= 0).all(1) & (centers_px <= limits).all(1)
    if seen.sum() < _LEAST_SEEN:
        raise ValueError(f"the scene of seed {seed} shows {seen.sum()} objects")
    canvas = texture(random, SIZE.height, SIZE.width)
    for _ in range(clutter):
        at = tuple(int(random.uniform(0, side)) for side in (SIZE.width, SIZE.height))
        axes = tuple(int(random.uniform(0.03, 0.12) * SIZE.width) for _ in range(2))
        colour = tuple(float(part) for part in random.uniform(0.2, 0.9, 3))
        cv2.ellipse(canvas, at, axes, float(random.uniform(0, 180)), 0, 360, colour, -1, cv2.LINE_AA)
    draw = nest(program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    spacing = min(math.hypot(draw.x.i, draw.y.i), math.hypot(draw.x.j, draw.y.j))
    first = LOOKS[look](random)
    kinds = [varied(first, random, jitter=jitter) for _ in range(24)]
    sprites = [sprite_of(_image(kind)) for kind in kinds]
    there = random.uniform(size=len(drawn)) >= missing
    moved = drawn[there, :2] + random.normal(0, 0.05 * min(jitter, 1.0) * spacing, (int(there.sum()), 2))
    layer = lay(view, sprites, moved, units=0.8 * spacing).astype(np.float32) / 255
    canvas += layer[..., 3:] * (layer[..., :3] - canvas)
    canvas = canvas + random.normal(0, 0.015, canvas.shape)
    return Scene(_bytes(canvas), program, centers_px[seen], drawn[seen, 2:].astype(np.int64), look, seed)


def _look(random: Random) -> str:
    return str(random.choice(sorted(LOOKS)))


def _image(sprite: np.ndarray) -> Image:
    alpha = np.ascontiguousarray(sprite[..., 3])
    return Image(np.ascontiguousarray(sprite[..., :3]), alpha >= 0.5, None, Source("PNG", alpha=alpha))


def _floats(scene: Scene) -> np.ndarray:
    return scene.pixels.astype(np.float32) / 255


def _bytes(pixels: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)


def same_lattice(scene: Scene, result: SynthesisResult) -> bool:
    """Whether the found steps are the true ones, up to the choice of a basis, where objects were found."""
    centers = np.array(result.centers).reshape(-1, 4)
    if len(centers) < 4:
        return False
    draw = nest(scene.program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    basis = np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]])
    plane_from_image = torch.linalg.inv(scene.camera.image_from_plane(scene.size))
    plane, _ = project(plane_from_image, torch.from_numpy(centers[:, :2].copy()))
    design = np.column_stack([centers[:, 2:], np.ones(len(centers))])
    steps = np.linalg.lstsq(design, plane.numpy() @ np.linalg.inv(basis), rcond=None)[0][:2]
    return bool(np.abs(steps - np.round(steps)).max() < WHOLE and abs(abs(np.linalg.det(steps)) - 1) < 0.2)


def pose_error_deg(scene: Scene, program: Program) -> float:
    """The angle between the true and the found normal."""
    cosine = sum(a * b for a, b in zip(scene.camera.normal, Camera.of(program).normal, strict=True))
    return math.degrees(math.acos(min(1.0, cosine)))


def judged(harm: str, level: str, scene: Scene, config: SearchConfig) -> Row:
    """Search a spoilt scene and hold the answer to its truth."""
    image, begun = scene.image(), time.process_time()
    result = p3i.synth(image, config)
    row = Row(
        harm=harm, level=level, seed=scene.seed, look=scene.look, tilt_deg=round(scene.camera.tilt_deg, 1),
        objects=len(scene.index), answered=result.program is not None, score=round(result.score or 0.0, 4),
        seconds=round(time.process_time() - begun, 2),
    )  # fmt: skip
    if result.program is None:
        return row
    pose_deg = round(pose_error_deg(scene, result.program), 3)
    return dataclasses.replace(row, same_lattice=same_lattice(scene, result), pose_deg=pose_deg)


def summary(rows: list[Row]) -> str:
    """A line of the table: what came of the pictures of one level."""
    right = [row.pose_deg for row in rows if row.same_lattice]
    cells = [
        rows[0].harm,
        rows[0].level,
        f"{np.mean([row.answered for row in rows]):.0%}",
        f"{np.mean([row.same_lattice for row in rows]):.0%}",
        f"{np.median(right):.2f}" if right else "-",
        f"{max(right):.2f}" if right else "-",
        f"{np.mean([row.seconds for row in rows]):.1f}",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    every = harms()
    parser.add_argument("--harm", nargs="+", choices=sorted(every), help="these only")
    parser.add_argument("--scenes", type=int, default=8, help="how many a level")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--structure", default="auto", help="as of p3i synth")
    parser.add_argument("--out", type=Path, help="a JSON file for a row of each picture")
    given = parser.parse_args()
    config = SearchConfig(structure=given.structure)
    print("| harm | level | answered | right lattice | pose, median of the right | at worst | CPU s |")
    print("|---|---|---|---|---|---|---|", flush=True)
    rows: list[Row] = []
    for harm in given.harm or every:
        for level, spoilt in every[harm].items():
            seeds = range(given.first, given.first + given.scenes)
            found = [judged(harm, level, spoilt(seed), config) for seed in seeds]
            print(summary(found), flush=True)
            rows += found
            if given.out is not None:
                given.out.write_text(json.dumps([dataclasses.asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()

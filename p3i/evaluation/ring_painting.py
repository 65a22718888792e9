"""From a layout of rings to a picture: plates, objects that differ a little, gaps, things in the way."""

from dataclasses import dataclass

import numpy as np
import cv2

from p3i.evaluation import stage
from p3i.evaluation.looks import Random, texture, varied
from p3i.evaluation.ring_layout import RingLayout, pose_sigma_deg
from p3i.evaluation.ring_looks import DOTS, MARKS, pointed, shrunk
from p3i.evaluation.scene import Scene, as_sprite, on_canvas
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.paint.sprite import lay
from p3i.paint.view import View, camera_view
from p3i.search.result import StructureFound
from p3i.size import Size

_STRAY = 0.004
"""How far objects stray from their places, as a share of their distance; at most 1 %."""

_CONTRAST = 22.0
"""How far the colour of an object lies from that below it, in Lab."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingOptions:
    """What scenes with rings are made of.

    `jitter` (0..1) is how much objects differ, `noise` that of the pixels, `clutter` how many things lie about at
    most, `hidden` the largest share of objects that are left out or covered, `plates` the share of scenes with a
    plate below the objects. `size` None draws one from 480 to 900 pixels. `focals` gives a third of the
    scenes another lens than one of `focal_mm`.
    """

    size: Size | None = None
    tilt_deg: tuple[float, float] = (8.0, 60.0)
    focal_mm: float = 35.0
    focals: bool = False
    look: str | None = None
    jitter: float = 0.3
    noise: float = 0.015
    clutter: int = 6
    hidden: float = 0.15
    plates: float = 0.55
    jpeg: float = 0.5
    """The share of scenes that are squeezed as JPEG."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Staged:
    """A layout under a camera, with the size of its objects in units."""

    layout: RingLayout
    camera: Camera
    size: Size
    diameter: float
    sigma_deg: float

    @property
    def view(self) -> View:
        return camera_view(self.camera, self.size)


def random_size(random: Random, options: RingOptions) -> Size:
    """A canvas of 480 to 900 pixels, mostly wider than high."""
    if options.size is not None:
        return options.size
    longer = int(random.integers(480, 901))
    shorter = round(longer * float(random.choice([0.667, 0.75, 0.75, 0.85, 1.0])))
    return Size(shorter, longer) if random.random() < 0.2 else Size(longer, shorter)


def random_camera(random: Random, options: RingOptions) -> Camera:
    """A tilt evenly between the bounds, towards any side."""
    tilt = np.radians(random.uniform(*options.tilt_deg))
    azimuth = random.uniform(0, 2 * np.pi)
    normal = (np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt))
    focal = options.focal_mm
    if options.focals and random.random() < 1 / 3:
        focal = round(float(random.uniform(24, 60)), 1)
    camera = Camera.from_normal(normal, focal_mm=focal)
    return Camera(round(camera.rx_deg, 2), round(camera.ry_deg, 2), focal)


def staged(
    layout: RingLayout, camera: Camera, size: Size, diameter: float, *, least_seen: float = 1.0
) -> Staged | None:
    """The layout under the camera if the picture shows it well enough to be found, else None.

    At least the share `least_seen` of the objects lies on the canvas, with a margin; none is smaller than
    7 pixels across its narrow side, neighbours stand 14 pixels apart (of 640), and places fix the tilt.
    """
    drawn = np.array(points(layout.program(camera, size)), dtype=np.float64)[:, :2]
    view = camera_view(camera, size)
    places, depth = view.project(drawn)
    if not (depth > 0.25 * view.depth_unit).all():
        return None
    margin = 0.5 * diameter * size.unit_px
    corner = np.array([size.width, size.height])
    whole = ((places > margin) & (places < corner - margin)).all(axis=1)
    if whole.mean() < least_seen:
        return None
    narrow = np.array([_narrow_px(view, point) for point in drawn]) * diameter
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e9 * np.eye(len(places))
    if narrow.min() < 9.0 or apart.min() < 14.0 * size.longer / 640:
        return None
    sigma = pose_sigma_deg(layout, camera, size, jitter_units=_STRAY * layout.chord())
    if len(drawn) >= 8 and sigma > 0.3:
        return None
    return Staged(layout=layout, camera=camera, size=size, diameter=diameter, sigma_deg=sigma)


def painted(
    plan: Staged,
    random: Random,
    options: RingOptions,
    *,
    structure: StructureFound,
    seed: int,
    plates: tuple[stage.Plate, ...],
) -> Scene:
    """The picture of a plan, with the truth about it."""
    size, view, layout = plan.size, plan.view, plan.layout
    program = layout.program(plan.camera, size)
    places_px, index, seen = on_canvas(program, size)
    drawn = np.array(points(program), dtype=np.float64)[:, :2]
    canvas = texture(random, size.height, size.width)
    stage.add_patches(canvas, random, int(random.integers(0, options.clutter + 1)))
    if plates:
        base = stage.colours_apart(random, [canvas.mean(axis=(0, 1))], least=15)
        for plate in plates:
            stage.add_plate(canvas, view, plate, random, base=base)
    ground = stage.beneath(canvas, places_px[seen])
    name, marks = _chosen_look(random, options)
    look = _visible_look(name, random, ground)
    gone = _left_out(layout, index, random, share=options.hidden / 2)
    sprites = []
    for i, j in index.tolist():
        one = varied(look, random, jitter=options.jitter)
        if marks:
            one = pointed(one, layout.phase_deg + j * layout.step_deg)
        sprites.append(as_sprite(shrunk(one, 1.0) if i is None else one))
    stray = np.clip(random.normal(0, _STRAY, drawn.shape), -0.007, 0.007) * layout.chord()
    kept = ~gone
    layer = lay(
        view,
        [sprite for sprite, stays in zip(sprites, kept, strict=True) if stays],
        (drawn + stray)[kept],
        units=plan.diameter,
    ).astype(np.float32)
    alpha = layer[..., 3:] / 255
    shadow = cv2.GaussianBlur(np.roll(alpha[..., 0], (1, 2), axis=(0, 1)), (0, 0), 2.0)[..., None]
    canvas *= 1 - 0.35 * shadow * (1 - alpha)
    canvas += alpha * (layer[..., :3] / 255 - canvas)
    covered = _covered(canvas, places_px, plan, random, budget=int(options.hidden * len(drawn)) - int(gone.sum()))
    pixels, jpeg = stage.photographed(
        stage.shine(canvas, random), random, noise=options.noise, squeezed=random.random() < options.jpeg
    )
    return Scene(
        pixels,
        program,
        places_px[seen],
        index[seen],
        name,
        seed,
        structure=structure,
        hidden=(gone | covered)[seen],
        jpeg=jpeg,
        pose_sigma_deg=plan.sigma_deg,
    )


def _chosen_look(random: Random, options: RingOptions) -> tuple[str, bool]:
    """The name of a look, and whether it turns with the ring."""
    names = sorted(DOTS) + sorted(MARKS)
    name = options.look or names[int(random.integers(len(names)))]
    return name, name in MARKS


def _visible_look(name: str, random: Random, ground: np.ndarray) -> np.ndarray:
    """A sprite of the look that stands out from the colours below, or the last of many."""
    make = DOTS.get(name) or MARKS[name]
    for _ in range(60):
        look = make(random)
        if stage.stands_out(look, ground, least=_CONTRAST):
            break
    return look


def _left_out(layout: RingLayout, index: np.ndarray, random: Random, *, share: float) -> np.ndarray:
    """Objects that are simply not there, bool [N]: none in most scenes, and never the end of an arc."""
    gone = np.zeros(len(index), bool)
    if random.random() < 0.6:
        return gone
    ends = np.zeros(len(index), bool)
    if not layout.closed:
        last = index[:, 1].copy()
        for i, count in layout.counts().items():
            last[index[:, 0] == i] = count - 1
        ends = (index[:, 1] == 0) | (index[:, 1] == last)
    free = np.flatnonzero(~ends)
    most = int(share * len(index))
    if most:
        gone[random.permutation(free)[: int(random.integers(1, most + 1))]] = True
    return gone


def _covered(
    canvas: np.ndarray, places_px: np.ndarray, plan: Staged, random: Random, *, budget: int
) -> np.ndarray:
    """Paint something over a few objects now and then; which places it covers, bool [N], at most `budget`."""
    covered = np.zeros(len(places_px), bool)
    if budget < 1 or random.random() < 0.65:
        return covered
    reach_px = plan.diameter * plan.size.unit_px * random.uniform(0.7, 1.3)
    target = places_px[int(random.integers(len(places_px)))] + random.normal(0, 0.4 * reach_px, 2)
    trial = canvas.copy()
    hides = stage.add_obstacle(trial, random, target, reach_px)
    height, width = hides.shape
    columns, rows = np.clip(np.rint(places_px).astype(int), 0, (width - 1, height - 1)).T
    covered = hides[rows, columns]
    if covered.sum() > budget:
        return np.zeros(len(places_px), bool)
    canvas[:] = trial
    return covered


def _narrow_px(view: View, point: np.ndarray) -> float:
    """Pixels to a unit at a plane point, in the direction where the picture is densest."""
    (here, right, down), _ = view.project(point + 1e-3 * np.array([(0, 0), (1.0, 0), (0, 1)]))
    jacobian = np.stack([right - here, down - here], axis=1) / 1e-3
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])

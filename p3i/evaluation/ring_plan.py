"""From a seed to a layout of rings, a camera and a canvas that show it well enough to be found."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from p3i.errors import UsageError
from p3i.evaluation.looks import Random
from p3i.evaluation.ring_layout import RingLayout, pose_sigma_deg
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.paint.draw.view import View, camera_view
from p3i.size import Size

STRAY = 0.004
"""How far objects stray from their places, as a share of their distance (the standard deviation)."""

_NARROW_PX = 10.0
"""The least width of a sprite on the picture; its object fills most of it, so 7 pixels or more."""

_APART_PX = 14.0
"""The least distance of neighbours, on a picture of 640 pixels."""

_SIGMA_DEG = 0.3
"""Patterns of eight objects or more fix the tilt this well, so that it can be asked for to a degree."""

_LAYOUTS, _CAMERAS = 150, 40
"""How many layouts are tried under a camera, and how many cameras on a canvas."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingOptions:
    """What scenes with rings are made of.

    `jitter` (0..1) is how much objects differ, `noise` that of the pixels, `clutter` how many things at most
    lie about, `hidden` the largest share of objects that are left out or covered, `arcs` the share of single
    rings that are open, `plates` that of scenes with a plate below the objects, `jpeg` that of scenes packed
    as JPEG. `size` None draws one from 480 to 900 pixels. `focals` gives a third of the scenes another lens
    (24 to 60 mm) than `focal_mm`.
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
    arcs: float = 0.2
    plates: float = 0.55
    jpeg: float = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Staged:
    """A layout under a camera, with the size of its objects in units.

    Where objects are `swelling`, they grow with the radius of their ring, up to `diameter`. `sigma_deg` is
    how well their places fix the tilt.
    """

    layout: RingLayout
    camera: Camera
    size: Size
    diameter: float
    swelling: bool
    sigma_deg: float

    @property
    def view(self) -> View:
        """What the camera sees."""
        return camera_view(self.camera, self.size)

    def share_of(self, i: int) -> float:
        """The size of the objects of ring i, as a share of `diameter`."""
        return _share_of(self.layout, i) if self.swelling else 1.0


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


def planned(
    draw: Callable[[Random], tuple[RingLayout, float]],
    random: Random,
    options: RingOptions,
    *,
    cut: float,
    swelling: bool = False,
) -> Staged:
    """A layout that a picture shows well, from `draw`, which gives one and the size of its objects.

    Tilts come evenly: layouts are drawn again and again under one camera before the next. In a fifth of the
    scenes the share `cut` of the objects may lie beyond the picture's edge. Raises UsageError where the
    canvas, or the tilt, leaves no room for such a pattern.
    """
    size = random_size(random, options)
    least_seen = 1 - cut if random.random() < 0.2 else 1.0
    for _ in range(_CAMERAS):
        camera = random_camera(random, options)
        for _ in range(_LAYOUTS):
            layout, diameter = draw(random)
            plan = _staged(layout, camera, size, diameter, swelling=swelling, least_seen=least_seen)
            if plan is not None:
                return plan
    raise UsageError(
        f"no pattern of rings can be seen well on {size.width} x {size.height} pixels at tilts of "
        f"{options.tilt_deg[0]:g} to {options.tilt_deg[1]:g} degrees; make the picture larger"
    )


def _staged(
    layout: RingLayout,
    camera: Camera,
    size: Size,
    diameter: float,
    *,
    swelling: bool,
    least_seen: float,
) -> Staged | None:
    """The layout under the camera if the picture shows it well enough to be found, else None."""
    drawn = np.array(points(layout.program(camera, size)), dtype=np.float64)
    view = camera_view(camera, size)
    places, depth = view.project(drawn[:, :2])
    if not (depth > 0.25 * view.depth_unit).all():
        return None
    margin = 0.5 * diameter * size.unit_px
    corner = np.array([size.width, size.height])
    if ((places > margin) & (places < corner - margin)).all(axis=1).mean() < least_seen:
        return None
    shares = [_share_of(layout, int(i)) if swelling else 1.0 for i in drawn[:, 2]]
    narrow = diameter * np.array(shares) * [_narrow_px(view, point) for point in drawn[:, :2]]
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e9 * np.eye(len(places))
    if narrow.min() < _NARROW_PX or apart.min() < _APART_PX * size.longer / 640:
        return None
    sigma = pose_sigma_deg(layout, camera, size, jitter_units=STRAY * layout.chord())
    if len(drawn) >= 8 and sigma > _SIGMA_DEG:
        return None
    return Staged(
        layout=layout, camera=camera, size=size, diameter=diameter, swelling=swelling, sigma_deg=sigma
    )


def _share_of(layout: RingLayout, i: int) -> float:
    largest = max(layout.radius_of(ring) for ring in layout.counts())
    return max(0.6, layout.radius_of(i) / largest)


def _narrow_px(view: View, point: np.ndarray) -> float:
    """Pixels to a unit at a plane point, in the direction where the picture is densest."""
    (here, right, down), _ = view.project(point + 1e-3 * np.array([(0, 0), (1.0, 0), (0, 1)]))
    jacobian = np.stack([right - here, down - here], axis=1) / 1e-3
    return float(np.linalg.svd(jacobian, compute_uv=False)[-1])

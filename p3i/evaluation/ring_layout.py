"""Rings in numbers: one ring, rings around one centre, or a ring repeated along a line, and what they fix.

All three are `x = radius*Cos(angle) + offset`, `y = radius*Sin(angle) + offset` with radius and offset affine
in i and the angle in j, so one record of numbers holds them.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from p3i.evaluation.scene import on_canvas
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, Polar, Program
from p3i.interp.camera import Camera
from p3i.size import Size

_PLACE_PX = 0.25
"""How well the middle of an object can be read off a picture at best, in pixels."""

_STEP = 1e-4
"""The step of finite differences, in degrees and program units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLayout:
    """The numbers of a program of rings; units and degrees.

    Ring i has its centre at `center + i*along`, the radius `radius + i*growth`, and its object j at the
    angle `phase_deg + j*step_deg`. `rings` is None for a single ring without a loop over i, else the range
    of i. j runs through `count` objects, or through `count*i` where `counted_by_ring`, as in Table 1.
    """

    center: tuple[float, float]
    radius: float
    step_deg: float
    count: int
    phase_deg: float = 0.0
    rings: tuple[int, int] | None = None
    growth: float = 0.0
    along: tuple[float, float] = (0.0, 0.0)
    counted_by_ring: bool = False

    @property
    def closed(self) -> bool:
        """Whether each ring goes all the way round."""
        return not self.counted_by_ring and abs(self.count * self.step_deg - 360) < 1e-6

    def counts(self) -> dict[int, int]:
        """How many objects each ring has; a single ring is ring 1, since an unbound i reads as 1."""
        if self.rings is None:
            return {1: self.count}
        return {i: self.count * i if self.counted_by_ring else self.count for i in range(*self.rings)}

    def center_of(self, i: int) -> np.ndarray:
        """The centre of ring i, [2]."""
        return np.array(self.center) + i * np.array(self.along)

    def radius_of(self, i: int) -> float:
        """The radius of ring i."""
        return self.radius + i * self.growth

    def chord(self) -> float:
        """The least distance between neighbours, on a ring and from ring to ring."""
        within = 2 * np.sin(np.radians(self.step_deg) / 2) * min(map(self.radius_of, self.counts()))
        between = abs(self.growth) if self.growth else within
        along = float(np.hypot(*self.along))
        if along:
            between = max(along - 2 * self.radius, 1e-3)
        return float(min(within, between))

    def program(self, camera: Camera, size: Size) -> Program:
        """The program that draws the rings under `camera`, told for a canvas of this size."""
        x, y = (
            Polar(
                "Cos" if axis == 0 else "Sin",
                Affine(i=self.growth, constant=self.radius),
                Affine(j=self.step_deg, constant=self.phase_deg),
                Affine(i=self.along[axis], constant=self.center[axis]),
            )
            for axis in (0, 1)
        )
        stop = Affine(i=self.count) if self.counted_by_ring else Affine(constant=self.count)
        world = For("j", Affine(), stop, Draw(x, y))
        if self.rings is not None:
            first, end = self.rings
            world = For("i", Affine(constant=first), Affine(constant=end), world)
        header = Header(canvas=(size.width, size.height), focal_mm=camera.focal_mm)
        return Program(CameraPose(camera.rx_deg, camera.ry_deg), world, header=header)


def pose_sigma_deg(layout: RingLayout, camera: Camera, size: Size, *, jitter_units: float) -> float:
    """The standard error of the tilt in degrees, where all objects are read as well as they can be.

    Least squares with the focal and the structure known; objects stray by `jitter_units` on the plane and
    their places are read to a quarter of a pixel.
    """
    around = _numbers(layout, camera)
    _, _, seen = on_canvas(layout.program(camera, size), size)
    columns = []
    for k in range(len(around)):
        ends = []
        for sign in (1, -1):
            moved = around.copy()
            moved[k] += sign * _STEP
            centers_px, _, _ = on_canvas(_with_numbers(layout, camera, moved, size), size)
            ends.append(centers_px[seen])
        columns.append((ends[0] - ends[1]).ravel() / (2 * _STEP))
    jacobian = np.column_stack(columns)
    error_px = np.hypot(_PLACE_PX, jitter_units * size.unit_px)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * error_px**2
    return float(np.sqrt(np.trace(covariance[:2, :2])))


def _numbers(layout: RingLayout, camera: Camera) -> np.ndarray:
    """What a search would fit: the camera, the centre, the radius, the phase, and what changes with i."""
    numbers = [camera.rx_deg, camera.ry_deg, *layout.center, layout.radius, layout.phase_deg]
    if layout.growth:
        numbers.append(layout.growth)
    if any(layout.along):
        numbers.extend(layout.along)
    return np.array(numbers, dtype=np.float64)


def _with_numbers(layout: RingLayout, camera: Camera, numbers: np.ndarray, size: Size) -> Program:
    rx_deg, ry_deg, x, y, radius, phase_deg, *rest = numbers.tolist()
    layout = dataclasses.replace(layout, center=(x, y), radius=radius, phase_deg=phase_deg)
    if layout.growth:
        layout = dataclasses.replace(layout, growth=rest.pop(0))
    if any(layout.along):
        layout = dataclasses.replace(layout, along=(rest[0], rest[1]))
    return layout.program(Camera(rx_deg, ry_deg, camera.focal_mm), size)

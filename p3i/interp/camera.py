"""The camera: a tilt and a focal length, and the homography that they give.

Convention (docs/geometry.md holds the derivation, a golden test the numbers):
- plane points are (x, y) in program units: x right, y down, origin where the optical axis meets the plane;
- camera coordinates are x right, y down, z forward; R = Ry(ry) Rx(rx) turns plane axes into camera axes;
- pixel centres lie at whole numbers, the principal point in the middle of the canvas;
- angles are degrees, focals are 35 mm-equivalent: f_px = focal / 36 * the longer side;
- `image_from_plane` maps program units to pixels, its third row gives the depth along the optical axis.

Everything here is free of in-place writes and of branches on values, so torch.func (vmap, jacfwd, grad)
goes through it; numbers become float64 tensors, tensors keep their dtype and device.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.size import Size

DEFAULT_FOCAL_MM = 35.0
"""The focal that the paper assumes where nothing is known."""

FILM_MM = 36.0
"""The longer side of the film that focals refer to."""

# In place of torch.deg2rad, which torch.func takes apart in Python: it cost a fifth of every Jacobian.
_RADIANS = math.pi / 180

_Number = TypeVar("_Number", float, Tensor)

_AT_CAMERA = 1e-9
"""Depths up to this share of the numbers they are summed from count as at the camera."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera's tilt against the plane (degrees) and its 35 mm-equivalent focal (mm)."""

    rx_deg: float = 0.0
    ry_deg: float = 0.0
    focal_mm: float = DEFAULT_FOCAL_MM

    def __post_init__(self) -> None:
        if not (math.isfinite(self.rx_deg) and math.isfinite(self.ry_deg)):
            raise ValueError(f"the camera's angles are finite, not {self.rx_deg}, {self.ry_deg}")
        if not (math.isfinite(self.focal_mm) and self.focal_mm > 0):
            raise ValueError(f"a focal length is positive, not {self.focal_mm}")

    @classmethod
    def of(cls, program: Program, *, focal_mm: float | None = None) -> "Camera":
        """The camera of a program; a `focal_mm` given here wins over the header's, 35 stands in for both."""
        if focal_mm is None and program.header is not None:
            focal_mm = program.header.focal_mm
        if focal_mm is None:
            focal_mm = DEFAULT_FOCAL_MM
        return cls(program.camera.rx_deg, program.camera.ry_deg, focal_mm)

    @classmethod
    def from_normal(
        cls, normal: tuple[float, float, float], *, focal_mm: float = DEFAULT_FOCAL_MM
    ) -> "Camera":
        """The camera that sees a plane with this normal (any length; either sign means the same plane).

        The tilt comes back with rx in [-90, 90] and ry in [-90, 90].
        Raises ValueError for a normal of length zero.
        """
        length = math.hypot(*normal)
        if not (math.isfinite(length) and length > 0):
            raise ValueError(f"a normal has a direction, {normal} has none")
        x, y, z = (component / length for component in normal)
        if z < 0:
            x, y, z = -x, -y, -z
        rx_deg = math.degrees(math.asin(max(-1.0, min(1.0, -y))))
        return cls(rx_deg, math.degrees(math.atan2(x, z)), focal_mm)

    @property
    def normal(self) -> tuple[float, float, float]:
        """The plane's unit normal in camera coordinates: R's third column, pointing away from the camera."""
        a, b = math.radians(self.rx_deg), math.radians(self.ry_deg)
        return math.cos(a) * math.sin(b), -math.sin(a), math.cos(a) * math.cos(b)

    @property
    def tilt_deg(self) -> float:
        """The angle between the optical axis and the plane's normal: 0 is seen straight on."""
        x, y, z = self.normal
        return math.degrees(math.atan2(math.hypot(x, y), abs(z)))

    def focal_px(self, size: Size) -> float:
        """The focal length in pixels on a canvas of this size."""
        return self.focal_mm / FILM_MM * size.longer

    def horizon(self, size: Size) -> tuple[float, float, float] | None:
        """The vanishing line a*x + b*y + c = 0 in pixels, with a^2 + b^2 = 1; None when seen straight on.

        a*x + b*y + c is the distance to the line in pixels, positive on the side where the plane is seen.
        """
        n_x, n_y, n_z = self.normal
        if n_z < 0:  # the plane's back is seen (a tilt beyond 90 degrees)
            n_x, n_y, n_z = -n_x, -n_y, -n_z
        length = math.hypot(n_x, n_y)
        if length < 1e-12:
            return None
        (middle_x, middle_y), focal_px = size.middle, self.focal_px(size)
        a, b = n_x / length, n_y / length
        return a, b, focal_px * n_z / length - a * middle_x - b * middle_y

    def refocused(self, focal_mm: float) -> "Camera":
        """The camera with another focal that sees the same vanishing line.

        The straightened views of the two differ by an affine map only: one photo of a plane fixes
        the camera up to this change (section 3.4 of the paper).
        """
        x, y, z = self.normal
        ratio = focal_mm / self.focal_mm
        return Camera.from_normal((x * ratio, y * ratio, z), focal_mm=focal_mm)

    def image_from_plane(self, size: Size) -> Tensor:
        """This camera's homography, program units to pixels: float64 [3, 3]."""
        return image_from_plane(self.rx_deg, self.ry_deg, size=size, focal_mm=self.focal_mm)


def rotation(rx_deg: Tensor | float, ry_deg: Tensor | float) -> Tensor:
    """The matrices Ry(ry) Rx(rx), [..., 3, 3]; differentiable in the angles (degrees), which broadcast."""
    rx, ry = (angle * _RADIANS for angle in _tensors(rx_deg, ry_deg))
    sin_x, cos_x, sin_y, cos_y = rx.sin(), rx.cos(), ry.sin(), ry.cos()
    return _matrix(
        (cos_y, sin_y * sin_x, sin_y * cos_x),
        (torch.zeros_like(rx), cos_x, -sin_x),
        (-sin_y, cos_y * sin_x, cos_y * cos_x),
    )


def image_from_plane(
    rx_deg: Tensor | float,
    ry_deg: Tensor | float,
    *,
    size: Size,
    focal_mm: Tensor | float = DEFAULT_FOCAL_MM,
) -> Tensor:
    """The homography from program units to pixels, [..., 3, 3].

    Convention: H (x, y, 1)^T = depth * (column, row, 1)^T with the depth in pixels, f_px at the origin.
    Differentiable in the angles (degrees) and in the focal (mm), which broadcast. Do not rescale H: the
    sign of its third coordinate says what is in front, for its inverse (`torch.linalg.inv`) too.
    """
    numbers = [value for value in (rx_deg, ry_deg, focal_mm) if not isinstance(value, Tensor)]
    if len(numbers) == 3:  # a search asks for thousands: without tensors a tenth of the time
        rx_deg, ry_deg, focal_mm = numbers
        rx, ry, focal_px = math.radians(rx_deg), math.radians(ry_deg), focal_mm * (size.longer / FILM_MM)
        rows = _homography(math.sin(rx), math.cos(rx), math.sin(ry), math.cos(ry), focal_px, size)
        return torch.tensor(rows, dtype=torch.float64)
    rx, ry, focal = _tensors(rx_deg, ry_deg, focal_mm)
    rx, ry, focal_px = rx * _RADIANS, ry * _RADIANS, focal * (size.longer / FILM_MM)
    rows = _homography(rx.sin(), rx.cos(), ry.sin(), ry.cos(), focal_px, size)
    return torch.stack([entry for row in rows for entry in row], dim=-1).unflatten(-1, (3, 3))


def _homography(
    sin_x: _Number, cos_x: _Number, sin_y: _Number, cos_y: _Number, focal_px: _Number, size: Size
) -> tuple[tuple[_Number, _Number, _Number], ...]:
    """The rows of lens @ [the first two columns of Ry(ry) Rx(rx), in pixels a unit | (0, 0, f_px)].

    The plane's origin lies f_px before the camera.
    """
    (middle_x, middle_y), unit = size.middle, size.unit_px
    wide = focal_px * unit
    depth_x, depth_y = -unit * sin_y, unit * (cos_y * sin_x)
    return (
        (wide * cos_y + middle_x * depth_x, wide * (sin_y * sin_x) + middle_x * depth_y, middle_x * focal_px),
        (middle_y * depth_x, wide * cos_x + middle_y * depth_y, middle_y * focal_px),
        (depth_x, depth_y, focal_px),
    )


def project(matrix: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
    """Points through a homography: ([..., N, 2], the mask [..., N] of those in front of the camera).

    Convention: `matrix` [..., 3, 3], `points` [..., N, 2] as (x, y); leading dimensions broadcast. Works
    both ways, with H and with its inverse. Points at or behind the camera come back finite but without
    meaning (so that gradients stay finite): use the mask.
    """
    mapped = points @ matrix[..., :2].mT + matrix[..., None, :, 2]
    depth = mapped[..., 2]
    row = matrix[..., 2, :].abs()
    rounding = (points.abs() @ row[..., :2, None]).squeeze(-1) + row[..., None, 2]
    in_front = depth > _AT_CAMERA * rounding
    return mapped[..., :2] / torch.where(in_front, depth, torch.ones_like(depth)).unsqueeze(-1), in_front


def _tensors(*values: Tensor | float) -> tuple[Tensor, ...]:
    """The values as tensors of one shape; plain numbers take a tensor's dtype and device, else float64."""
    like = next(
        (value for value in values if isinstance(value, Tensor)), torch.zeros((), dtype=torch.float64)
    )
    tensors = [torch.as_tensor(value, dtype=like.dtype, device=like.device) for value in values]
    return tuple(torch.broadcast_tensors(*tensors))


def _matrix(*rows: tuple[Tensor, ...]) -> Tensor:
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)

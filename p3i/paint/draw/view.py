"""Which part of the world a picture shows: the canvas, and the homography from the plane to it.

Convention: arrays of float64; matrices map program units to pixels of the canvas, their third row is the
depth along the optical axis (positive in front of the camera), 1 everywhere in a straight view.
"""

import math
from dataclasses import dataclass

import numpy as np

from p3i.interp.camera import Camera
from p3i.place.clip import cut
from p3i.size import Size

AUTO_PX = 1024
"""The longer side of a picture whose size nobody named."""

_CLOSEST = 0.3
"""A canvas is fitted to what lies farther than this share of the focal; closer up there is no end."""

_NEAR = 0.02
"""Lines are cut off where they come closer to the camera than this share of the focal."""

_NOTHING = np.array([(-50.0, -50.0), (50.0, 50.0)])
"""The stretch of the plane, or of the picture, that is shown where nothing is drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A canvas, and what it shows: `canvas_from_plane` [3, 3]; `plane` says that the view is straight."""

    size: Size
    canvas_from_plane: np.ndarray
    camera: Camera
    plane: bool

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plane points [..., 2] as (pixels [..., 2], depth [...]); nan and 0 or less where not in front."""
        moved = points @ self.canvas_from_plane[:, :2].T + self.canvas_from_plane[:, 2]
        depth = moved[..., 2]
        depth = np.where(depth > 1e-6 * self.depth_unit, depth, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(depth[..., None] > 0, moved[..., :2] / depth[..., None], np.nan), depth

    @property
    def depth_unit(self) -> float:
        """The depth of the plane's origin."""
        return float(self.canvas_from_plane[2, 2])

    @property
    def horizon(self) -> tuple[float, float, float] | None:
        """The vanishing line a*x + b*y + c = 0 in pixels of the canvas, or None; a^2 + b^2 = 1."""
        # A line of the picture is a row vector; the plane's line at infinity is (0, 0, 1).
        line = np.linalg.inv(self.canvas_from_plane)[2]
        length = math.hypot(line[0], line[1])
        if self.plane or length * self.size.longer < 1e-9 * abs(line[2]):
            return None
        return float(line[0] / length), float(line[1] / length), float(line[2] / length)

    def project_segments(self, segments: np.ndarray) -> np.ndarray:
        """Segments of the plane [S, 2, 2] in pixels, cut off before the camera and around the canvas."""
        depth = segments @ self.canvas_from_plane[2, :2] + self.canvas_from_plane[2, 2]
        segments, _ = cut(segments, depth - _NEAR * self.depth_unit)
        pixels, _ = self.project(segments)
        return clip_to_canvas(pixels, self.size)


def camera_view(camera: Camera, size: Size) -> View:
    """What a camera sees on a canvas of this size."""
    return View(size, camera.image_from_plane(size).numpy(), camera, plane=False)


def fitted_camera_view(camera: Camera, around: np.ndarray) -> View:
    """What a camera sees of the plane points `around` [..., 2], on a canvas that just holds them.

    The optical axis keeps its place, so the perspective is the program's; the canvas is a window beside it.
    """
    camera_px = camera_view(camera, Size(1000, 1000))
    pixels, depth = camera_px.project(around.reshape(-1, 2))
    fits = pixels[depth > _CLOSEST * camera_px.depth_unit]
    if not len(fits):
        fits = 499.5 + 10 * _NOTHING
    size, canvas_from_camera_px = _window(fits, None, AUTO_PX)
    return View(size, canvas_from_camera_px @ camera_px.canvas_from_plane, camera, plane=False)


def straight_view(camera: Camera, around: np.ndarray, *, size: Size | None, longer: int) -> View:
    """The plane as it is, from straight above: all of `around` [..., 2], on `size` or `longer` pixels."""
    points = around.reshape(-1, 2)
    size, canvas_from_plane = _window(points if len(points) else _NOTHING, size, longer)
    return View(size, canvas_from_plane, camera, plane=True)


def clip_to_canvas(segments: np.ndarray, size: Size) -> np.ndarray:
    """The parts of the segments [S, 2, 2] (pixels) that lie on the canvas or just beside it."""
    margin = 8 + size.longer / 100
    for axis, last in ((0, size.width - 1), (1, size.height - 1)):
        segments, _ = cut(segments, segments[..., axis] + margin)
        segments, _ = cut(segments, last + margin - segments[..., axis])
    return segments


def _window(points: np.ndarray, size: Size | None, longer: int) -> tuple[Size, np.ndarray]:
    """A canvas that shows all `points` [K, 2], and the similarity to its pixels [3, 3]."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 1e-3 * max(1e-6, float((high - low).max())))
    if size is None:
        width, height = (max(1, round(float(side))) for side in extent / extent.max() * longer)
        size = Size(width, height)
    scale = min(size.width / extent[0], size.height / extent[1])
    middle = (low + high) / 2
    shift = np.array(size.middle) - scale * middle
    return size, np.array([[scale, 0, shift[0]], [0, scale, shift[1]], [0, 0, 1.0]])

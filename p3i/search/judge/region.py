"""Where a program's objects lie on the photo, and the part of the photo on which it holds."""

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.grammar.ast import Program
from p3i.interp import unroll
from p3i.interp.camera import Camera, project
from p3i.interp.compile import compile
from p3i.interp.lens import photo_from_straight
from p3i.search.answer import Answer
from p3i.search.look.part import shown
from p3i.search.look.patches import frames, spacing
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import in_frame


def centers_px(
    program: Program, image: Image, focal_mm: float, *, lens_k1: float | None = None
) -> tuple[tuple[float, float, int, int], ...]:
    """The program's objects on the photo: (x, y) in pixels and (i, j); those outside the frame left out."""
    points = unroll.points(program)
    if not points:
        return ()
    plane = torch.tensor([point[:2] for point in points], dtype=torch.float64)
    pixels, seen = photo_points(program, plane, image.size, focal_mm, lens_k1=lens_k1)
    inside = seen & in_frame(pixels, image.size)
    return tuple(
        (float(pixels[place, 0]), float(pixels[place, 1]), *points[place][2:])
        for place in unroll.distinct(points)
        if bool(inside[place])
    )


def objects_px(answer: Answer, image: Image, assumed_mm: float) -> NDArray[np.float64]:
    """The objects of an answer on the photo, `centers_px`, as an array [N, 4]: x, y, i, j."""
    focal_mm = answer.focal_mm or assumed_mm
    centers = centers_px(answer.program, image, focal_mm, lens_k1=answer.lens_k1)
    return np.array(centers, float).reshape(-1, 4)


def share_in_sight(program: Program, image: Image, focal_mm: float, *, lens_k1: float | None = None) -> float:
    """The share of the program's objects that the photo shows, 0 to 1, in its region of interest.

    Draws that coincide are one object.
    """
    drawn = len(unroll.distinct(unroll.points(program)))
    centers = torch.tensor(centers_px(program, image, focal_mm, lens_k1=lens_k1)).reshape(-1, 4)
    return int(shown(image, centers[:, :2]).sum()) / max(drawn, 1)


def region_px(
    program: Program, image: Image, focal_mm: float, *, lens_k1: float | None = None
) -> tuple[tuple[float, float], ...]:
    """The convex polygon around the ground of the objects that the photo shows: (x, y) in pixels, in turn.

    An object's ground reaches half the spacing to each side of it, and no farther than the frame. Empty where
    no object shows.
    """
    pattern = compile(program)
    centers, seen = photo_points(program, pattern.centers(), image.size, focal_mm, lens_k1=lens_k1)
    index = pattern.index[seen & in_frame(centers, image.size)].double()
    if len(index) == 0:
        return ()
    where = frames(pattern, pattern.theta, index, side=spacing(pattern, pattern.theta))
    corners = torch.tensor([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], dtype=torch.float64)
    ground = where.points(corners[None]).reshape(-1, 2)
    points, shown = photo_points(program, ground, image.size, focal_mm, lens_k1=lens_k1)
    hull = cv2.convexHull(points[shown].numpy().astype(np.float32))
    width, height = image.size.width, image.size.height
    frame = np.array([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)], np.float32)
    if len(hull) < 3:
        return ()
    _, cut = cv2.intersectConvexConvex(hull, frame)
    return tuple((float(x), float(y)) for x, y in np.asarray(cut).reshape(-1, 2))


def photo_points(
    program: Program, plane: torch.Tensor, size: Size, focal_mm: float, *, lens_k1: float | None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Plane points [N, 2] on the photo, through camera and lens: pixels [N, 2], and which are seen [N]."""
    camera = Camera.of(program, focal_mm=focal_mm)
    pixels, in_front = project(camera.image_from_plane(size), plane)
    if not lens_k1:
        return pixels, in_front
    pixels, shown = photo_from_straight(pixels, lens_k1, size=size)
    return pixels, in_front & shown

"""A program laid over its photo: the camera, the objects, and the steps from one to the next.

Convention: arrays of float64; points of the plane in program units, points of the photo in pixels, pixel
centres at whole numbers; matrices map program units to pixels, their third row is the depth (positive in
front). On a photo whose lens bends lines (header key lens_k1) they lead to pinhole pixels: see flat.py.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch

from p3i.errors import ProgramError
from p3i.grammar.ast import Affine, Program
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.interp.degenerate import FAR, refuse_edge_on, refuse_far_steps
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import distinct, nest, points
from p3i.place.lens import bent_points
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.sheet import project

FocalSource = Literal["option", "header", "exif", "default"]


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A program on a canvas of `size`, seen by `camera`.

    `index` [M, 2] int64 and `points` [M, 2] are its objects in program order (coinciding draws are one);
    `image_from_plane` is [3, 3]. Objects at or behind the camera are among them: `centers_px` tells; `far`
    counts the draws that were left out, beyond FAR. `lens_k1` bends the canvas; None where it is straight.
    """

    pattern: Pattern
    camera: Camera
    size: Size
    image_from_plane: np.ndarray
    index: np.ndarray
    points: np.ndarray
    far: int = 0
    lens_k1: float | None = None

    def on_canvas(self, corner: tuple[int, int], size: Size) -> "Placed":
        """The same on a canvas of `size`, on which this one's corner lies at pixel `corner` (x, y)."""
        shift = np.array([[1.0, 0, corner[0]], [0, 1, corner[1]], [0, 0, 1]])
        return replace(self, size=size, image_from_plane=shift @ self.image_from_plane)

    def centers_px(self) -> tuple[np.ndarray, np.ndarray]:
        """The objects in pinhole pixels [M, 2], and which lie in front of the camera [M]."""
        return project(self.image_from_plane, self.points)

    def shown_px(self) -> tuple[np.ndarray, np.ndarray]:
        """The objects where the lens shows them: pixels [M, 2], and which it shows [M]."""
        pixels, front = self.centers_px()
        if self.lens_k1 is None:
            return pixels, front
        pixels, shown = bent_points(np.where(front[:, None], pixels, np.nan), self.size, self.lens_k1)
        return pixels, front & shown

    def in_sight(self) -> np.ndarray:
        """Which objects [M] lie on the photo."""
        pixels, front = self.shown_px()
        limits = np.array([self.size.width, self.size.height]) - 0.5
        with np.errstate(invalid="ignore"):
            return front & (pixels >= -0.5).all(1) & (pixels <= limits).all(1)

    def at(self, index: np.ndarray) -> np.ndarray:
        """The plane points [K, 2] of any (i, j) [K, 2], drawn or not, fractions too."""
        return self.pattern.points_at(torch.as_tensor(np.asarray(index, float))).numpy()

    @property
    def basis(self) -> np.ndarray | None:
        """The lattice basis [2, 2], rows u (a step of i) and v (a step of j); None where there is none.

        Neither rings nor programs whose objects form one row are lattices.
        """
        draw = nest(self.pattern.program).draw
        if not (isinstance(draw.x, Affine) and isinstance(draw.y, Affine)):
            return None
        basis = np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]], float)
        lengths = np.linalg.norm(basis, axis=1)
        return basis if abs(np.linalg.det(basis)) > 1e-6 * lengths.prod() + 1e-12 else None

    @property
    def origin(self) -> np.ndarray:
        """The plane point [2] of (i, j) = (0, 0)."""
        return self.at(np.zeros((1, 2)))[0]


def camera_of(
    program: Program, photo: Image | None, *, focal_mm: float | None = None
) -> tuple[Camera, FocalSource]:
    """The camera of a program and where its focal is from: `focal_mm`, the header, the photo, or 35 mm."""
    header_mm = program.header.focal_mm if program.header else None
    choices: list[tuple[float | None, FocalSource]] = [(focal_mm, "option"), (header_mm, "header")]
    choices.append((photo.focal_mm if photo else None, "exif"))
    for known_mm, origin in choices:
        if known_mm is not None:
            return Camera.of(program, focal_mm=known_mm), origin
    return Camera.of(program), "default"


def placed(program: Program, photo: Image, *, focal_mm: float | None = None) -> Placed:
    """`program` on the canvas of `photo`; the focal is `focal_mm`, else the header's, the photo's, 35 mm.

    That objects stand upright on their ring is for the header to say, as `synth` writes it: `upright = true`.

    Raises ProgramError for a program without objects, with none in front of the camera, whose plane is seen
    edge-on, or whose loops step farther than any picture reaches.
    """
    camera, _ = camera_of(program, photo, focal_mm=focal_mm)
    refuse_edge_on(camera)
    drawn = points(program)
    found = [place for place in drawn if abs(place[0]) < FAR and abs(place[1]) < FAR]
    kept = [found[place] for place in distinct(found)]
    facts = dict(program.header.fit) if program.header else {}
    pattern = replace(compile(program), upright=facts.get("upright") is True)
    result = Placed(
        pattern,
        camera,
        photo.size,
        camera.image_from_plane(photo.size).numpy(),
        np.array([place[2:] for place in kept], np.int64).reshape(-1, 2),
        np.array([place[:2] for place in kept], float).reshape(-1, 2),
        len(drawn) - len(found),
        (program.header.lens_k1 if program.header else None) or None,
    )
    if not len(kept) or not result.centers_px()[1].any():
        raise ProgramError("the program draws nothing in front of its camera: `p3i check` says where it does")
    refuse_far_steps(pattern, result.index)
    return result

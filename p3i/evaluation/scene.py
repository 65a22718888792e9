"""A rendered scene: a picture, and the truth about it."""

from dataclasses import dataclass, field

import numpy as np

from p3i.grammar.ast import Program
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.paint.draw.sprite import Sprite, sprite_of
from p3i.paint.draw.view import camera_view
from p3i.search.result import StructureFound
from p3i.size import Size
from p3i.vision.decode import Source
from p3i.vision.image import Image


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A picture and the truth about it.

    `pixels` uint8 [H, W, 3] RGB; `centers_px` [N, 2] and `index` [N, 2] are the objects of `program` that
    lie on the picture (their true places, before jitter). `hidden` bool [N] marks those that the program
    draws but the picture does not show: left out, or behind something. `jpeg` is the file that the pixels
    were read from, where they were squeezed. `pose_sigma_deg` is how well the places of the objects fix the
    tilt, where it was worked out.
    """

    pixels: np.ndarray
    program: Program
    centers_px: np.ndarray
    index: np.ndarray
    look: str
    seed: int
    structure: StructureFound = "lattice"
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    jpeg: bytes | None = None
    pose_sigma_deg: float | None = None

    @property
    def size(self) -> Size:
        """The canvas."""
        return Size(self.pixels.shape[1], self.pixels.shape[0])

    @property
    def camera(self) -> Camera:
        """The true camera, with the focal that the picture was drawn with."""
        return Camera.of(self.program)

    def image(self) -> Image:
        """The picture as the vision part takes it; it says nothing about the focal."""
        pixels = self.pixels.astype(np.float32) / 255
        return Image(pixels, np.ones(pixels.shape[:2], bool))


def on_canvas(program: Program, size: Size) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The drawn objects and which of them the canvas shows.

    Returns pixels [N, 2] (nan behind the camera), indices int64 [N, 2] and a mask [N], in loop order.
    """
    drawn = np.array(points(program), dtype=np.float64).reshape(-1, 4)
    centers_px, depth = camera_view(Camera.of(program), size).project(drawn[:, :2])
    with np.errstate(invalid="ignore"):
        seen = (depth > 0) & (centers_px >= 0).all(axis=1)
        seen &= (centers_px <= (size.width - 1, size.height - 1)).all(axis=1)
    return centers_px, drawn[:, 2:].astype(np.int64), seen


def least_distance(places: np.ndarray) -> float:
    """How close the closest two of the places [N, 2] stand; 0 where there are no two."""
    if len(places) < 2:
        return 0.0
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e9 * np.eye(len(places))
    return float(apart.min())


def as_sprite(pixels: np.ndarray) -> Sprite:
    """A look (RGBA float32 [S, S, 4], plain alpha) as a sprite that can be laid onto the plane."""
    alpha = np.ascontiguousarray(pixels[..., 3])
    colour = np.ascontiguousarray(pixels[..., :3])
    return sprite_of(Image(colour, alpha >= 0.5, None, Source("PNG", alpha=alpha)))

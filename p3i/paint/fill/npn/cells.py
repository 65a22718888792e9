"""The cells of a program as patches of one size: the plane split by its centres, each cell seen alike.

A patch is laid on one object's cell (Voronoi) and a margin, so that there its pixels are those of the photo
at the network's scale; the program's own moves lay it on every other cell, turned on rings and in
perspective. The same pixel of two patches is then the same place of the pattern. All reading is batched, on
any device.

Convention: M objects of the program, patches [.., h, w]; matrices float64, `views` [M, 3, 3] take a patch's
pixels to those of the reduced photo; points (x, y), pixel centres at whole numbers.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from p3i.interp.camera import project
from p3i.place.moves import moves, nearest, pitch_px
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision import sheet
from p3i.vision.image import Image, resized, resized_from_photo
from p3i.vision.warp import pixel_grid, sample

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# The network sees objects this far apart, in pixels, where the photo is not smaller, ...
_PITCH_PX = 24
# ... and patches of about so many pixels a side in the mean, and no longer side than this.
_SIDE_PX, _MOST_PX = 40, 80
# Sources are laid exactly on patches with so many times as many pixels a side at most.
_FINE = 3.0
# A patch shows this much round its cell, in distances to the next object; a cell of a single row has no end.
_MARGIN = 0.3
_MOST_REACH = 1.25
# The network halves a patch twice.
_WHOLE = 4
# So many objects are asked how far the next one lies.
_ASKED = 64


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """The cells of a program on a photo, at the network's scale.

    `from_photo` [3, 3] takes the photo's pixels to those of `pixels` [3, H, W]; `known` and `shown` [H, W]
    are 1 where a pixel is evidence, and where it can be looked at beside a hole (what was filled, too).
    `patch` is the patches' size, `views` [M, 3, 3] lay them (nan where none lies), `cell` [h, w] is the
    reference's own ground in its patch, `pitch_px` how far the next object lies there; `centers` [M, 2] the
    objects' places. `to_coarse` [3, 3] takes the pixels of finer patches to those of coarser ones that they
    are made from.
    """

    from_photo: Array
    pixels: Tensor
    known: Tensor
    shown: Tensor
    patch: Size
    views: Tensor
    cell: Mask
    pitch_px: float
    centers: Array
    to_coarse: Tensor

    @property
    def device(self) -> torch.device:
        """Where the patches are read."""
        return self.pixels.device

    def without(self, hidden: Mask) -> "Cells":
        """The same cells with some more of the photo [H, W] hidden, neither evidence nor shown."""
        free = 1 - _reduced(hidden, self.from_photo, self.known)
        return dataclasses.replace(self, known=self.known * free, shown=self.shown * free)

    def read(self, views: Tensor, *, shown: bool = False) -> tuple[Tensor, Tensor]:
        """Patches laid by `views` [..., 3, 3]: colours [..., 3, h, w], and 1 where all is known [..., 1, h,
        w].

        With `shown`, where all can be looked at instead.
        """
        points, front = laid(views, self.patch)
        sure = self.shown if shown else self.known
        values = sample(torch.cat([self.pixels, sure[None]]), points).movedim(-1, -3)
        height, width = sure.shape
        inside = (
            front & (points >= 0).all(-1) & (points[..., 0] <= width - 1) & (points[..., 1] <= height - 1)
        )
        return values[..., :3, :, :], ((values[..., 3, :, :] > 0.99) & inside).float().unsqueeze(-3)


def laid(views: Tensor, patch: Size) -> tuple[Tensor, Tensor]:
    """Where the pixels of a patch lie under views [..., 3, 3]: points [..., h, w, 2] float32, and which in
    front."""
    points, front = project(views, pixel_grid(patch, dtype=views.dtype, device=views.device).reshape(-1, 2))
    # nan would be read as a corner; float32 is what the photo is read in.
    points = torch.nan_to_num(points, nan=-1e6).clamp(-1e6, 1e6).float()
    rows = (patch.height, patch.width)
    return points.unflatten(-2, rows), front.unflatten(-1, rows)


def cells_of(photo: Image, placed: Placed, hole: Mask, bare: Mask, *, device: torch.device) -> Cells:
    """The cells of a straight photo whose `hole` [H, W] is filled, but not where it is `bare` [H, W]."""
    reference, pitch = _reference(placed)
    plane_from_patch, low, high = _box(placed, reference, pitch)
    sides = high - low
    scale = min(
        1.0, _PITCH_PX / pitch, _SIDE_PX / float(np.sqrt(sides.prod())), _MOST_PX / float(sides.max())
    )
    longer = max(1, round(photo.size.longer * scale))
    scale = longer / photo.size.longer
    from_photo = resized_from_photo(scale)
    pixels, known, shown = _seen(photo, hole, bare, from_photo, longer, device)
    width, height = (int(np.ceil(side * scale / _WHOLE)) * _WHOLE for side in sides)
    # From the patch's pixels, to offsets from the object in pixels of the photo, to the plane.
    middle = (low + high) / 2
    offset = np.array(
        [
            [1 / scale, 0, middle[0] - (width - 1) / 2 / scale],
            [0, 1 / scale, middle[1] - (height - 1) / 2 / scale],
            [0, 0, 1],
        ]
    )
    views = from_photo @ placed.image_from_plane @ moves(placed, reference) @ plane_from_patch @ offset
    grid = pixel_grid(Size(width, height), dtype=torch.float64).numpy().reshape(-1, 2)
    on_plane, _ = sheet.project(plane_from_patch @ offset, grid)
    return Cells(
        from_photo,
        pixels,
        known,
        shown,
        Size(width, height),
        torch.from_numpy(views).to(device),
        (nearest(placed, on_plane) == reference).reshape(height, width),
        pitch * scale,
        placed.points,
        torch.eye(3, dtype=torch.float64, device=device),
    )


def finer(cells: Cells, photo: Image, hole: Mask, bare: Mask) -> Cells:
    """The same cells with up to `_FINE` times as many pixels a side, as far as the photo has them.

    The arguments are those of `cells_of`, `hole` and `bare` [H, W].
    """
    longer = max(cells.known.shape)
    wanted = min(photo.size.longer, round(longer * _FINE))
    from_photo = resized_from_photo(wanted / photo.size.longer)
    more = from_photo[0, 0] / cells.from_photo[0, 0]
    to_coarse = torch.from_numpy(resized_from_photo(1 / more)).to(cells.device)
    to_fine = torch.from_numpy(from_photo @ np.linalg.inv(cells.from_photo)).to(cells.device)
    pixels, known, shown = _seen(photo, hole, bare, from_photo, wanted, cells.device)
    return dataclasses.replace(
        cells,
        from_photo=from_photo,
        pixels=pixels,
        known=known,
        shown=shown,
        patch=Size(round(cells.patch.width * more), round(cells.patch.height * more)),
        views=to_fine @ cells.views @ to_coarse,
        pitch_px=cells.pitch_px * more,
        to_coarse=to_coarse,
    )


def _seen(
    photo: Image, hole: Mask, bare: Mask, from_photo: Array, longer: int, device: torch.device
) -> tuple[Tensor, Tensor, Tensor]:
    """The reduced photo [3, H, W], what is evidence on it and what can be looked at [H, W]."""
    small = resized(Image(photo.pixels, np.ones(hole.shape, bool)), longer).pixels
    pixels = torch.from_numpy(np.ascontiguousarray(small.transpose(2, 0, 1))).to(device)
    known, shown = (
        1 - _reduced(unknown, from_photo, pixels[0])
        for unknown in (hole | ~photo.valid, bare | (~photo.valid & ~hole))
    )
    return pixels, known, shown


def _reduced(marked: Mask, from_photo: Array, like: Tensor) -> Tensor:
    """1 where a pixel [H, W] of the reduced photo holds any of what is marked on the photo."""
    longer = max(like.shape)
    pixels = marked[:, :, None].astype(np.float32).repeat(3, 2)
    small = resized(Image(pixels, np.ones(marked.shape, bool)), longer).pixels[:, :, 0]
    return torch.from_numpy((small > 1e-3).astype(np.float32)).to(like.device)


def _reference(placed: Placed) -> tuple[int, float]:
    """The object whose next one lies as far as is usual on the photo, and how far, in pixels."""
    seen = np.flatnonzero(placed.in_sight())
    if not len(seen):
        seen = np.flatnonzero(placed.centers_px()[1])
    asked = seen[np.linspace(0, len(seen) - 1, min(len(seen), _ASKED)).astype(int)]
    far = np.array([pitch_px(placed, int(number)) for number in asked])
    place = int(np.argsort(far, kind="stable")[len(far) // 2])
    return int(asked[place]), float(far[place])


def _box(placed: Placed, reference: int, pitch: float) -> tuple[Array, Array, Array]:
    """The plane from offsets round an object in pixels of the photo [3, 3], and the box of its cell there.

    The box holds a margin; its ends are `low` and `high` [2].
    """
    center = placed.points[reference]
    matrix = placed.image_from_plane
    mapped = matrix @ [*center, 1]
    at = mapped[:2] / mapped[2]
    slopes = (matrix[:2, :2] - at[:, None] * matrix[2, :2]) / mapped[2]
    plane_from_offset = np.eye(3)
    plane_from_offset[:2, :2] = np.linalg.inv(slopes)
    plane_from_offset[:2, 2] = center
    reach = np.linspace(-_MOST_REACH, _MOST_REACH, 81) * pitch
    offsets = np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 2)
    on_plane, _ = sheet.project(plane_from_offset, offsets)
    mine = offsets[nearest(placed, on_plane) == reference]
    margin = _MARGIN * pitch
    return plane_from_offset, mine.min(0) - margin, mine.max(0) + margin

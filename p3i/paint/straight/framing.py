"""Which stretch of the plane a straightened view shows, and at which scale.

Convention: as in straightened.py. A rectangle is (low [2], high [2]) in upright units; its corners are the
outer corners of the outermost pixels. What the photo shows near the horizon is stretched without end in a
straight view; the bounds below say where it stops.
"""

import math

import cv2
import numpy as np
import torch

from p3i.errors import ProgramError
from p3i.interp.lens import straight_from_photo
from p3i.options.rectify import RectifyOptions
from p3i.paint.straight.straightened import Straightened
from p3i.place import outlines
from p3i.place.clip import cut_polygon
from p3i.place.placed import Placed
from p3i.place.upright import upright_from_plane
from p3i.size import Size, refuse_huge
from p3i.vision.rectangle import largest_rectangle

_FARTHEST, _FARTHEST_OBJECT = 2.5, 4.0
"""A view ends where the plane is this many times as far away as at the pattern's middle: its pixels are
stretched by that across, by the square along. Objects are shown farther out than bare ground."""

_COARSE = 192
"""Cells along the longer side in the search for the largest known rectangle."""

Rectangle = tuple[np.ndarray, np.ndarray]


def straightened(
    placed: Placed, valid: np.ndarray, options: RectifyOptions, *, k1: float | None
) -> tuple[Straightened, tuple[str, ...]]:
    """The view that `options` ask for, and notes for the user.

    `valid` [H, W] says what the photo knows. Raises ProgramError where no object lies on the photo,
    UsageError for more than `max_px` pixels at a scale that was asked for, or for a cell that is none.
    """
    linear = upright_from_plane(placed, upright=options.upright, cell=options.cell)
    middle = _middle(placed)
    finest = _finest(placed, linear, middle)
    asked = options.scale if options.px_per_mm is None else options.px_per_mm / finest
    scale = 1.0 if asked is None else asked
    ground, cut = _ground(placed, linear, middle, farthest=_FARTHEST, k1=k1)
    notes: list[str] = []
    match options.crop:
        case "same":
            half = np.array([placed.size.width, placed.size.height]) / 2 / finest
            at_middle = np.array([*placed.size.middle]) - _project(placed, middle)
            centre = linear @ middle + at_middle / finest
            rectangle = centre - half, centre + half
        case "all" | "inside":
            rectangle = ground.min(axis=0), ground.max(axis=0)
            if cut:
                notes.append(
                    f"what lies more than {_FARTHEST:g} times as far away as the pattern's middle, towards "
                    "the horizon, is left out"
                )
            if options.crop == "inside":
                rectangle = _known_rectangle(placed, linear, rectangle, valid, k1=k1)
        case _:
            rectangle = _pattern(placed, linear, middle, k1=k1)
    fit = math.sqrt(options.max_px / max(1.0, float(np.prod((rectangle[1] - rectangle[0]) * finest))))
    if asked is None and fit < 1:
        scale = fit * 0.999
        notes.append(f"scaled by {scale:.3g} to make no more than {options.max_px:,} pixels (--max-px)")
    result = _canvas(placed, linear, rectangle, scale=scale, finest=finest, k1=k1, options=options)
    while asked is None and (pixels := result.size.width * result.size.height) > options.max_px:
        # Sides are whole numbers of pixels, at least one: rounding took it over the limit.
        scale *= min(0.999, math.sqrt(options.max_px / pixels))
        result = _canvas(placed, linear, rectangle, scale=scale, finest=finest, k1=k1, options=options)
    refuse_huge(result.size, max_px=options.max_px)
    return result, tuple(notes)


def _canvas(
    placed: Placed,
    linear: np.ndarray,
    rectangle: Rectangle,
    *,
    scale: float,
    finest: float,
    k1: float | None,
    options: RectifyOptions,
) -> Straightened:
    per_unit = scale * finest
    extent = (rectangle[1] - rectangle[0]) * per_unit
    # An inside view never reaches beyond what is known; the others show all of their rectangle.
    count = np.floor(extent + 1e-6) if options.crop == "inside" else np.round(extent)
    size = Size(max(1, int(count[0])), max(1, int(count[1])))
    view_from_plane = np.eye(3)
    view_from_plane[:2, :2] = per_unit * linear
    middle = (rectangle[0] + rectangle[1]) / 2
    view_from_plane[:2, 2] = np.array(size.middle) - per_unit * middle
    mm_per_px = None if options.cell is None else 1 / per_unit
    return Straightened(placed, k1, size, view_from_plane, scale, mm_per_px)


def _middle(placed: Placed) -> np.ndarray:
    """The plane point [2] in the middle of the objects that lie on the photo, as it shows them."""
    pixels, _ = placed.centers_px()
    seen = placed.in_sight()
    if not seen.any():
        raise ProgramError(
            "none of the program's objects lie on the photo: is it the program of another photo?"
        )
    return _unproject(placed, pixels[seen].mean(axis=0)[None])[0]


def _project(placed: Placed, point: np.ndarray) -> np.ndarray:
    mapped = placed.image_from_plane @ np.array([*point, 1.0])
    return mapped[:2] / mapped[2]


def _unproject(placed: Placed, pixels: np.ndarray) -> np.ndarray:
    """Pinhole pixels [K, 2] to plane points [K, 2]."""
    mapped = np.c_[pixels, np.ones(len(pixels))] @ np.linalg.inv(placed.image_from_plane).T
    return mapped[:, :2] / mapped[:, 2:]


def _finest(placed: Placed, linear: np.ndarray, point: np.ndarray) -> float:
    """Photo pixels in one upright unit at a plane point, in the direction where there are most."""
    h = placed.image_from_plane
    mapped = h @ np.array([*point, 1.0])
    at = mapped[:2] / mapped[2]
    jacobian = (h[:2, :2] - np.outer(at, h[2, :2])) / mapped[2] @ np.linalg.inv(linear)
    return float(np.linalg.norm(jacobian, 2))


def _ground(
    placed: Placed, linear: np.ndarray, middle: np.ndarray, *, farthest: float, k1: float | None
) -> tuple[np.ndarray, bool]:
    """The outline [K, 2], in upright units, of what the photo shows up to `farthest`; whether that cut it."""
    size = placed.size
    along = np.linspace(0, 1, 33)[:-1]
    corners = np.array([(0, 0), (size.width, 0), (size.width, size.height), (0, size.height)]) - 0.5
    ends = np.roll(corners, -1, axis=0)
    border = (corners[:, None] + along[None, :, None] * (ends - corners)[:, None]).reshape(-1, 2)
    if k1:
        border = straight_from_photo(torch.from_numpy(border), k1, size=size).numpy()
    # 1 / depth is linear on the photo: positive before the horizon, 0 on it.
    nearness_row = np.linalg.inv(placed.image_from_plane)[2]
    depth = float(placed.image_from_plane[2] @ np.array([*middle, 1.0]))
    inside = np.c_[border, np.ones(len(border))] @ nearness_row * depth - 1 / farthest
    return _unproject(placed, cut_polygon(border, inside)) @ linear.T, bool((inside < 0).any())


def _pattern(placed: Placed, linear: np.ndarray, middle: np.ndarray, *, k1: float | None) -> Rectangle:
    """The box of the objects in sight with a cell around each, as far as the photo shows it."""
    chart = outlines.chart_of(placed.pattern)
    seen = placed.in_sight()
    around = outlines.surroundings(chart, placed.index[seen]).reshape(-1, 2) @ linear.T
    points = np.r_[placed.points[seen] @ linear.T, around[np.isfinite(around).all(axis=1)]]
    margin = 0.5 * outlines.pitch(chart) * math.sqrt(abs(np.linalg.det(linear)))
    ground, _ = _ground(placed, linear, middle, farthest=_FARTHEST_OBJECT, k1=k1)
    low = np.maximum(points.min(axis=0) - margin, ground.min(axis=0))
    high = np.minimum(points.max(axis=0) + margin, ground.max(axis=0))
    return low, high


def _known_rectangle(
    placed: Placed, linear: np.ndarray, within: Rectangle, valid: np.ndarray, *, k1: float | None
) -> Rectangle:
    """The largest rectangle inside `within` whose every point is known."""
    upright_from_plane = np.eye(3)
    upright_from_plane[:2, :2] = linear
    upright = Straightened(placed, k1, Size(1, 1), upright_from_plane, 1.0)
    if not valid.all():
        # Wide enough that no hole hides between the points that are asked for.
        reach = math.ceil(2 * _FARTHEST * placed.size.longer / (4 * _COARSE)) | 1
        valid = cv2.erode(valid.astype(np.uint8), np.ones((reach, reach), np.uint8)).astype(bool)

    def known(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        photo_x, photo_y, shown = upright.in_photo(x, y)
        column = np.clip(np.rint(np.where(shown, photo_x, 0)), 0, valid.shape[1] - 1).astype(int)
        row = np.clip(np.rint(np.where(shown, photo_y, 0)), 0, valid.shape[0] - 1).astype(int)
        return shown & valid[row, column]

    return largest_rectangle(known, within[0], within[1], coarse=_COARSE)

"""How far a picture grows to each side: as asked for, before the horizon, no farther than the pattern.

Convention: `sides` are pixels to the left, top, right and bottom; masks bool [H, W].
"""

import math

import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.options.extend import SIDES, Margins
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.sheet import project

Mask = NDArray[np.bool_]
Sides = tuple[int, int, int, int]

# The horizon stays this far from the new picture, as a share of the photo's longer side.
_LEAST_TO_HORIZON = 0.02
# Of the new ground of a cropped picture at most this share is not pattern.
_MOST_BARE = 0.1
# Each side is tried in so many steps.
_STEPS = 12


def margins_px(laid: Placed, by: Margins) -> Sides:
    """How many pixels each side grows by; UsageError where cells reach the horizon, or for nothing."""
    width, height = laid.size.width, laid.size.height
    if by.unit == "cells":
        found = [_cells_px(laid, side, count) if count else 0 for side, count in enumerate(by.sides)]
    else:
        share = (width / 100, height / 100) * 2 if by.unit == "%" else (1.0,) * 4
        found = [round(one * part) for one, part in zip(by.sides, share, strict=True)]
    if not any(found):
        raise UsageError("the picture would grow by less than a pixel: ask for more")
    left, top, right, bottom = found
    return left, top, right, bottom


def _cells_px(laid: Placed, side: int, count: float) -> int:
    """How far `count` cells reach beyond the middle of a side, along the lattice's likest direction."""
    width, height = laid.size.width, laid.size.height
    middle = np.array(
        [(-0.5, (height - 1) / 2), ((width - 1) / 2, -0.5), (width - 0.5, (height - 1) / 2),
         ((width - 1) / 2, height - 0.5)][side]
    )  # fmt: skip
    outwards = np.array([(-1, 0), (0, -1), (1, 0), (0, 1)][side])
    start, front = project(np.linalg.inv(laid.image_from_plane), middle[None])
    if not front[0]:
        raise UsageError(f"the {SIDES[side]} side of the photo lies beyond the horizon: no cell is there")
    near = laid.index[np.argmin(np.hypot(*(laid.points - start[0]).T))].astype(float)
    moves = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    steps = laid.at(near + moves / 2) - laid.at(near - moves / 2)
    if np.linalg.norm(steps, axis=1).min() < 1e-6:  # a single row: as far across as along
        longest = steps[np.argmax(np.linalg.norm(steps, axis=1))]
        across = np.array([-longest[1], longest[0]])
        steps = np.array([longest, -longest, across, -across])
    tiny, _ = project(laid.image_from_plane, start + 0.01 * steps)
    directions = tiny - middle
    likest = int(np.argmax(directions @ outwards / np.linalg.norm(directions, axis=1)))
    end, front = project(laid.image_from_plane, start + count * steps[likest])
    far = float((end[0] - middle) @ outwards)
    if not front[0] or far <= 0:
        raise UsageError(f"{count:g} more cells to the {SIDES[side]} reach the horizon: ask for fewer")
    return math.ceil(far)


def before_horizon(laid: Placed, sides: Sides) -> Sides:
    """The sides, less where a photo that shows the plane only would come to show its horizon."""
    line = laid.camera.horizon(laid.size)
    if line is None or _to_horizon(line, laid.size, (0, 0, 0, 0)) <= _least_px(laid.size):
        return sides  # without one, or the photo itself shows it: beyond it nothing is pattern
    found = list(sides)
    towards = {0: line[0], 1: line[1], 2: -line[0], 3: -line[1]}
    for side in sorted(towards, key=lambda one: towards[one], reverse=True)[:2]:
        fits, over = 0, found[side] + 1
        while over - fits > 1:
            found[side] = (fits + over) // 2
            far = _to_horizon(line, laid.size, (found[0], found[1], found[2], found[3]))
            fits, over = (found[side], over) if far > _least_px(laid.size) else (fits, found[side])
        found[side] = fits
    return found[0], found[1], found[2], found[3]


def refuse_horizon(laid: Placed, sides: Sides) -> None:
    """Raises UsageError where a side that shows the plane only would come to show the horizon."""
    kept = before_horizon(laid, sides)
    if kept == sides:
        return
    guilty = SIDES[next(number for number in range(4) if kept[number] < sides[number])]
    line = laid.camera.horizon(laid.size)
    nearest = 0.0 if line is None else _to_horizon(line, laid.size, (0, 0, 0, 0))
    raise UsageError(
        f"the plane's horizon lies {nearest:.0f} pixels beyond the photo, and the new picture would "
        f"reach it: let the {guilty} side grow by less"
    )


def _to_horizon(line: tuple[float, float, float], size: Size, sides: Sides) -> float:
    """How far the nearest corner of a picture that has grown lies before the horizon, in pixels."""
    a, b, c = line
    left, top, right, bottom = sides
    xs, ys = (-left - 0.5, size.width + right - 0.5), (-top - 0.5, size.height + bottom - 0.5)
    return min(a * x + b * y + c for x in xs for y in ys)


def _least_px(size: Size) -> float:
    return _LEAST_TO_HORIZON * size.longer


def kept_sides(bare: Mask, sides: Sides, size: Size) -> Sides:
    """How far each side may grow, so that most pattern comes in and hardly anything `bare` [H, W].

    Raises UsageError where that is nowhere.
    """
    sums = np.pad(bare.astype(np.int64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    steps = [np.unique(np.rint(np.linspace(0, side, _STEPS + 1))).astype(np.int64) for side in sides]
    left, top, right, bottom = (one.ravel() for one in np.meshgrid(*steps, indexing="ij"))
    x0, y0 = sides[0] - left, sides[1] - top
    x1, y1 = size.width - sides[2] + right, size.height - sides[3] + bottom
    inside = sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]
    photo_px = (size.width - sides[0] - sides[2]) * (size.height - sides[1] - sides[3])
    new_px = (x1 - x0) * (y1 - y0) - photo_px
    pattern_px = np.where(inside <= _MOST_BARE * new_px, new_px - inside, -1)
    best = int(np.argmax(pattern_px))
    if pattern_px[best] <= 0:
        raise UsageError(
            f"on no side does the pattern go on ({bare.sum() / new_px.max():.0%} of the new ground is none): "
            "--beyond transparent or --beyond continue makes the picture all the same"
        )
    return int(left[best]), int(top[best]), int(right[best]), int(bottom[best])


def grown(size: Size, sides: Sides) -> Size:
    """The size of a picture that has grown."""
    return Size(size.width + sides[0] + sides[2], size.height + sides[1] + sides[3])

"""A photo without some of its objects: the ground that lies between them, continued under them.

What the median cell has beside its object, carried on under it (cutout.py), is what is expected there. What
the photo differs from that by around an object, in light and colour, is carried in from the object's rim. Its
texture is that of ground elsewhere, over and above what is expected there, so that lines which run between
objects are not copied to where none does; where no move lays an object wholly onto ground, it is grain
(grain.py), since pieces of several would show their seams.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool or float32 [H, W].
"""

from collections.abc import Iterator
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.cutout import Cutout
from p3i.paint.fill.even import Even
from p3i.paint.fill.grain import Grain
from p3i.paint.fill.light import carried_into, rim_of
from p3i.paint.fill.pieces import padded
from p3i.place.moves import frames, nearest_px, pitch_px
from p3i.place.outlines import chart_of, polygons
from p3i.place.placed import Placed
from p3i.size import Size
from p3i.vision.fill import eroded
from p3i.vision.planes import put
from p3i.vision.sheet import project
from p3i.vision.strips import Window

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# An object covers what its cutout covers by at least this.
_LEAST_ALPHA = 0.1
# Light is smooth over this share of a cell; what is expected is brought into that by a gain in these bounds.
_BLUR = 0.12
_GAINS = (0.4, 2.5)
# Texture that differs from the ground's by more than so many of its deviations is another thing.
_MOST_DEVIATIONS = 4.0
# A rim of so many pixels tells what an object's ground differs by from what is expected.
_RIM_PX = 3.0
# Places that texture is brought from: steps in these parts of the way from object to object, up to this far.
_PARTS, _FARTHEST = 8, 1.0
_MOST_MOVES = 16
_WHOLLY = 0.98
# Texture is taken so far from objects at least, in distances: edges are blurred, and objects slip.
_AWAY = 0.02
# What differs from the ground beside an object and touches it hangs on it, so far from its outline, in
# distances: as the outline of an object that is shifted or larger does.
_HANGS_ON = 0.08
# What is told and filled at an object is told from what lies within so many cells of it, or so many pixels.
_REACH, _LEAST_REACH_PX = 2.0, 16.0
# Grain is told from no more than so many pixels a side.
_SAMPLE_PX = 1536
# Rows of the photo whose texture is looked up at once.
_STRIP = 512
# A cell's ground reaches this far beyond its border, in distances, where no other cell has it.
_BEYOND = 0.05


def windows(placed: Placed, layer: Floats, step: float, *, scale: float = 1.0) -> list[Window | None]:
    """Where a cell's `layer` [side, side(, C)] of each object may reach on the photo, rows and columns.

    Where its last channel is above 0; `step` is the grid's. None for objects out of sight.
    """
    rows, columns = np.nonzero((layer if layer.ndim == 2 else layer[:, :, -1]) > 0)
    half = (layer.shape[0] - 1) / 2
    # The grid's places that hold something, and one more all around.
    low, high = (
        (np.array([end(columns), end(rows)]) - half + one) * step * scale
        for end, one in ((np.min, -1), (np.max, 1))
    )
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), (0, 0)])
    found: list[Window | None] = []
    for frame in frames(placed):
        pixels, front = project(placed.image_from_plane, corners @ frame[:2, :2].T + frame[:2, 2])
        low = np.maximum(np.floor(pixels.min(0)), 0).astype(int)
        limit = np.array([placed.size.width, placed.size.height])
        high = np.minimum(np.ceil(pixels.max(0)) + 1, limit).astype(int)
        seen = front.all() and (high > low).all()
        found.append((slice(low[1], high[1]), slice(low[0], high[0])) if seen else None)
    return found


def local_points(placed: Placed, frame: Array, window: Window) -> Array:
    """Where the pixels of a window lie about an object, in program units: [K, 2], row by row."""
    rows, columns = np.mgrid[window]
    pixels = np.stack([columns.ravel(), rows.ravel()], 1).astype(float)
    points, _ = project(np.linalg.inv(placed.image_from_plane), pixels)
    return (points - frame[:2, 2]) @ frame[:2, :2]


def object_masks(placed: Placed, layer: Floats, step: float) -> Iterator[tuple[Window, Floats]]:
    """For each object in sight its window, and a `layer` of its cell's grid as it is seen: [h, w(, C)].

    `step` is the grid's, in program units.
    """
    plane_from_image = np.linalg.inv(placed.image_from_plane)
    grid_from_local = np.diag([1 / step, 1 / step, 1.0])
    grid_from_local[:2, 2] = (layer.shape[0] - 1) / 2
    for frame, window in zip(frames(placed), windows(placed, layer, step), strict=True):
        if window is None:
            continue
        rows, columns = window
        image_from_window = np.eye(3)
        image_from_window[:2, 2] = columns.start, rows.start
        matrix = grid_from_local @ np.linalg.inv(frame) @ plane_from_image @ image_from_window
        size = (columns.stop - columns.start, rows.stop - rows.start)
        # Beyond the grid nothing lies: the border is 0.
        how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        yield window, np.asarray(cv2.warpPerspective(layer, matrix, size, flags=how), np.float32)


def covered(placed: Placed, cut: Cutout) -> Mask:
    """The pixels that objects cover, with all that goes with them: [H, W]."""
    mask = np.zeros((placed.size.height, placed.size.width), bool)
    for window, gone in object_masks(placed, cut.gone, cut.step):
        mask[window] |= gone > _LEAST_ALPHA
    return mask


def cleared(
    pixels: Floats, valid: Mask, placed: Placed, cut: Cutout, *, objects: Mask | None = None
) -> tuple[Floats, Mask]:
    """The photo with the ground of the pattern's cells continued under `objects` [H, W], and where it was.

    float32 [H, W, 3] and bool [H, W], by default under all objects. The ground is what none of the pattern's
    objects covers. What hangs on an object beyond its outline goes with it. Nothing farther than two cells
    from the objects is looked at: a large photo takes no longer than its part around them.
    """
    every = covered(placed, cut)
    wanted = every if objects is None else objects
    result, gone = pixels.copy(), np.zeros_like(wanted)
    for window, own in _apart(wanted, placed):
        near = _cropped(placed, window)
        gone[window] |= _clear(result[window], valid[window], near, cut, every[window], own)
    return result, gone & valid


def _clear(pixels: Floats, valid: Mask, placed: Placed, cut: Cutout, every: Mask, wanted: Mask) -> Mask:
    """Do with a part of the photo what `cleared` says, in place, and say where."""
    expected, within = _expected(placed, cut)
    ground = valid & ~every & within
    if not ground.any():
        return np.zeros_like(wanted)
    pitch_here = _pitch_px(placed)
    sigma = max(1.0, _BLUR * pitch_here)
    wide, fine = Even.of(ground, sigma=4 * sigma), Even.of(ground, sigma=sigma)
    # Channel by channel, and in place: a large photo's copies are much.
    size, evens = np.zeros(ground.shape, np.float32), list[Floats]()
    for channel in range(3):
        plane = expected[:, :, channel]
        gain = wide.smooth(pixels[:, :, channel])
        gain += 0.02
        gain /= wide.smooth(plane) + 0.02
        plane *= np.clip(gain, *_GAINS, out=gain)
        off = pixels[:, :, channel] - plane
        evens.append(fine.reduced(off))
        off -= fine.enlarged(evens[-1])
        np.maximum(size, np.abs(off, out=off), out=size)
    typical = _typical(size, ground)
    del size
    beside = cv2.dilate(wanted.astype(np.uint8), _disc(_HANGS_ON * pitch_here)) > 0
    gone = wanted | hanging(ground & ~typical & beside, wanted)
    for rows, columns, inside, spacing in _holes(gone, placed):
        here, there = pixels[rows, columns], expected[rows, columns]
        # What its own rim shows, but for other things there, if there is more than them.
        for beside in (typical, ground & ~gone, valid & ~every & ~gone):
            rim = rim_of(inside, beside[rows, columns], reach_px=_RIM_PX)
            if rim.any():
                break
        read = partial(_lacking, here, there, rim)
        filled_in = there.copy()
        for window, lacking in carried_into(read, inside > 0, spacing_px=spacing):
            filled_in[window] += lacking
        put(filled_in, here, inside > 0)
    # What is expected is needed no more: what the ground has beside its smooth part takes its place.
    detail = expected
    for channel, even in enumerate(evens):
        plane = detail[:, :, channel]
        np.subtract(pixels[:, :, channel], plane, out=plane)
        plane -= fine.enlarged(even)
    inner = eroded(typical & ~gone, max(1, round(_AWAY * pitch_here)))
    inner = inner if inner.any() else typical
    moves = [_move(placed, each) for each in _steps_to_ground(placed, cut)]
    noise: Grain | None = None
    # In strips: what is looked up for each pixel takes more memory than the photo.
    for start in range(0, len(gone), _STRIP):
        rows = slice(start, start + _STRIP)
        if gone[rows].any():
            texture, bare = _texture(detail, inner, moves, gone[rows], top=start)
            if bare.any():
                if noise is None:
                    some = _fullest(inner)
                    noise = Grain.of(detail[some], inner[some], most_px=sigma)
                texture[bare] = noise.drawn(bare, seed=start)[bare]
            texture[~gone[rows]] = 0
            pixels[rows] += texture
    for channel in range(3):
        plane = pixels[:, :, channel]
        np.copyto(plane, np.clip(plane, 0, 1), where=gone)
    return gone


def _apart(wanted: Mask, placed: Placed) -> list[tuple[Window, Mask]]:
    """What of a mask [H, W] can be told and filled apart: rows and columns, and the part in these.

    About each part lie two cells, from which it is told and filled.
    """
    cells, front = project(placed.image_from_plane, polygons(chart_of(placed.pattern), placed.index))
    low, high, front = cells.min(1), cells.max(1), front.all(1)
    stats = cv2.connectedComponentsWithStats(wanted.astype(np.uint8), connectivity=8)[2]
    around = np.zeros(wanted.shape, np.uint8)
    for x, y, width, height, _ in stats[1:].tolist():
        near = front & (high >= (x, y)).all(1) & (low <= (x + width, y + height)).all(1)
        reach = int(np.ceil(_REACH * (high - low)[near].max(initial=_LEAST_REACH_PX)))
        around[max(0, y - reach) : y + height + reach, max(0, x - reach) : x + width + reach] = 1
    labels, boxes = cv2.connectedComponentsWithStats(around, connectivity=4)[1:3]
    found = []
    for label, (x, y, width, height, _) in enumerate(boxes[1:].tolist(), start=1):
        window = (slice(y, y + height), slice(x, x + width))
        found.append((window, wanted[window] & (labels[window] == label)))
    return found


def _cropped(placed: Placed, window: Window) -> Placed:
    """The program on a part of its photo."""
    rows, columns = window
    size = Size(columns.stop - columns.start, rows.stop - rows.start)
    return placed.on_canvas((-columns.start, -rows.start), size)


def hanging(other: Mask, wanted: Mask) -> Mask:
    """The parts of a mask [H, W] that touch what is wanted [H, W]: a rim or shadow beyond its outline."""
    count, parts = cv2.connectedComponents((other | wanted).astype(np.uint8), connectivity=8)
    labels, touching = np.asarray(parts, np.int32), np.zeros(count, bool)
    touching[labels[wanted]] = True
    return other & touching[labels]


def _disc(radius: float) -> NDArray[np.uint8]:
    size = 2 * max(1, round(radius)) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


def _fullest(inner: Mask) -> Window:
    """The part of a mask, no larger than the grain of a texture needs, that holds most of it."""
    rows, columns = (range(0, side, _SAMPLE_PX) for side in inner.shape)
    parts = [(slice(y, y + _SAMPLE_PX), slice(x, x + _SAMPLE_PX)) for y in rows for x in columns]
    return max(parts, key=lambda part: int(inner[part].sum()))


def _expected(placed: Placed, cut: Cutout) -> tuple[Floats, Mask]:
    """The median cell's ground at each pixel of the pattern's cells [H, W, 3], and which pixels those are."""
    height, width = placed.size.height, placed.size.width
    shown, deepest = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
    # How far inside its cell a place lies, from 0 a little beyond its border: the deepest cell has the pixel.
    inside = np.clip(cut.own + _BEYOND, 0, None).astype(np.float32)
    layers = np.concatenate([cut.ground, inside[:, :, None]], 2)
    for window, layer in object_masks(placed, layers, cut.step):
        deeper = layer[:, :, 3] > deepest[window]
        np.copyto(shown[window], layer[:, :, :3], where=deeper[:, :, None])
        np.copyto(deepest[window], layer[:, :, 3], where=deeper)
    return shown, deepest > 0


def _holes(wanted: Mask, placed: Placed) -> Iterator[tuple[slice, slice, NDArray[np.uint8], float]]:
    """What hangs together of the mask: window, mask in it, and how far the next object lies, in pixels."""
    labels, stats, middles = cv2.connectedComponentsWithStats(wanted.astype(np.uint8), connectivity=4)[1:]
    for label in range(1, len(stats)):
        left, top, right, bottom = padded(stats[label], wanted.shape, by_px=int(np.ceil(_RIM_PX)) + 1)
        rows, columns = slice(top, bottom), slice(left, right)
        spacing = pitch_px(placed, nearest_px(placed, middles[label]))
        yield rows, columns, (labels[rows, columns] == label).astype(np.uint8), spacing


def _lacking(here: Floats, there: Floats, rim: Mask, window: Window) -> tuple[Floats, Mask]:
    """What a photo `here` [h, w, 3] differs by from what is expected `there` at a rim [h, w], in a window."""
    return (here[window] - there[window]) * rim[window][:, :, None], rim[window]


def _typical(size: Floats, ground: Mask) -> Mask:
    """Where detail of a `size` [H, W] is texture of the ground, not another thing that lies on it: [H, W]."""
    # The median of the absolute deviation, as one of a normal distribution.
    middle = float(np.median(size[ground], overwrite_input=True))
    limit = _MOST_DEVIATIONS * 1.4826 * middle + 1 / 255
    other = cv2.dilate(((size > limit) & ground).astype(np.uint8), np.ones((3, 3), np.uint8))
    return ground & (other == 0)


def _move(placed: Placed, step: Array) -> Array:
    """A step on the plane as the homography [3, 3] of the photo; its third coordinate is > 0 in front."""
    moved = np.eye(3)
    moved[:2, 2] = step
    return placed.image_from_plane @ moved @ np.linalg.inv(placed.image_from_plane)


def _texture(
    detail: Floats, inner: Mask, moves: list[Array], wanted: Mask, *, top: int
) -> tuple[Floats, Mask]:
    """What the ground that the moves lead to has beside its smooth part: [h, W, 3]; where none does [h, W].

    `wanted` [h, W] is a strip of the photo from row `top` on; `detail` [H, W, 3] is read where `inner`.
    """
    shown_there = inner.astype(np.uint8)
    found = np.zeros((*wanted.shape, 3), np.float32)
    left = wanted.copy()
    photo_from_strip = np.array([[1, 0, 0], [0, 1, top], [0, 0, 1.0]])
    how = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    for move in moves:
        rows, columns = (np.flatnonzero(left.any(axis)) for axis in (1, 0))
        if not len(rows):
            break
        # Only where something is left.
        part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        corner = np.array([[1, 0, part[1].start], [0, 1, part[0].start], [0, 0, 1.0]])
        matrix = move @ photo_from_strip @ corner
        size = (part[1].stop - part[1].start, part[0].stop - part[0].start)
        depth = (
            matrix[2, 0] * np.arange(size[0]) + (matrix[2, 1] * np.arange(size[1]) + matrix[2, 2])[:, None]
        )
        shown = (cv2.warpPerspective(shown_there, matrix, size, flags=how) > 0) & (depth > 1e-9) & left[part]
        if shown.any():
            found[part][shown] = cv2.warpPerspective(detail, matrix, size, flags=how)[shown]
            left[part] &= ~shown
    return found, left


def _steps_to_ground(placed: Placed, cut: Cutout) -> Array:
    """Moves on the plane that bring an object wholly onto ground, the shortest first: [K, 2]."""
    chosen = int(np.argmin(np.hypot(*(placed.points - np.median(placed.points, 0)).T)))
    frame, middle = frames(placed)[chosen], placed.index[chosen].astype(float)
    half = (cut.gone.shape[0] - 1) / 2
    rows, columns = np.nonzero(cut.gone > _LEAST_ALPHA)
    places = (np.stack([columns, rows], 1)[:: max(1, len(rows) // 300)] - half) * cut.step
    places = places @ frame[:2, :2].T + frame[:2, 2]
    line = np.linspace(-_FARTHEST, _FARTHEST, round(2 * _FARTHEST * _PARTS) + 1)
    parts = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    steps = placed.at(middle + parts) - placed.at(middle[None])
    others = placed.at(middle + np.stack(np.meshgrid(*[np.arange(-3, 4)] * 2), -1).reshape(-1, 2))
    free = np.array([1 - _on_objects(places + step, others, frame, cut).mean() for step in steps])
    order = np.argsort(np.hypot(*steps.T), kind="stable")
    return steps[order][free[order] > _WHOLLY][:_MOST_MOVES]


def _on_objects(points: Array, others: Array, frame: Array, cut: Cutout) -> Mask:
    """Which points [K, 2] of the plane lie on an object at `others` [M, 2], turned as `frame` is."""
    nearest = others[np.argmin(np.hypot(*(points[:, None] - others).transpose(2, 0, 1)), axis=1)]
    return cut.at((points - nearest) @ frame[:2, :2], cut.gone) > _LEAST_ALPHA


def _pitch_px(placed: Placed) -> float:
    """The typical width of a cell on the photo."""
    cells, front = project(placed.image_from_plane, polygons(chart_of(placed.pattern), placed.index))
    sides = (cells.max(1) - cells.min(1)).min(1)[front.all(1)]
    return float(np.median(sides)) if len(sides) else 8.0

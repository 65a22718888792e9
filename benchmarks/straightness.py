"""How straight lattices stand in straightened views: local periods, and what their unevenness comes from.

python benchmarks/straightness.py PHOTOS                            # an annotated set, as `p3i eval` takes it
python benchmarks/straightness.py PHOTOS --programs answers.jsonl   # the JSON lines of `p3i synth`, no search

Each lattice photo is straightened as `p3i rectify` does. In the view every cell is registered to the mean
of all, finer than a pixel, so each object has a measured place, in steps of the lattice. Then, per axis and
in per cent of a period:

- local: a local period is the least squares step over 3 x 3 neighbouring objects; here its standard deviation
  over the view.
- jitter: how far single objects lie from their row and column, as smooth as those may run (a quadratic).
- noise: how well a place can be read at all, from two halves of each cell that know nothing of each other.
- trend: how much the period changes from one end of the view to the other, after the quadratic; what one
  would call crooked. Behind it the standard error that jitter gives it.
- bow: how far the middle of a row of u stands off its ends' line, and of a column of v, in the same unit.
- refit: local and trend once more, after the homography that fits the measured places best (the program's
  own freedom: camera and lattice), how far that turns the camera, and after a lens coefficient besides.
"""

import argparse
import dataclasses
import json
import os
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

import p3i
from p3i.evaluation.score_set import read_results
from p3i.evaluation.truth import read_truth
from p3i.interp.lens import straight_from_photo
from p3i.paint.straight.rectify import Rectified, rectify
from p3i.place.placed import Placed
from p3i.search.look.cells import mean_of_others
from p3i.search.look.correlate import correlate
from p3i.vision.cells import sheet_features
from p3i.vision.image import Image
from p3i.vision.sheet import Box, cell_sides_px, cells_from_basis, project, straighten

Array = NDArray[np.float64]

_SIDES = (12, 40)
"""Samples along the side of a cell in which it is registered: at least, at most."""
_REACH = 0.25
"""How far an object is looked for, in steps."""
_ROUNDS = 6
_LEAST_AGREEMENT = 0.3
"""Cells that agree less with the mean cell are no objects: something stands before them."""
_NOISE_PX, _NOISE_STEPS = 0.25, 0.02
_ROBUST = 3.0
_WINDOW, _LEAST_IN_WINDOW = 3, 6
_FEWEST = 9
"""Fewer objects than this say nothing of local periods."""
_K1 = np.linspace(-0.3, 0.3, 61)


@dataclasses.dataclass(frozen=True, slots=True)
class Spread:
    """Of one set of places, along u and along v, in per cent of a period."""

    local: tuple[float, float]
    jitter: tuple[float, float]
    trend: tuple[float, float]
    error: tuple[float, float]
    bow: tuple[float, float]


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """What one photo gives; `objects` of `drawn` could be measured, in `windows` neighbourhoods."""

    photo: str
    drawn: int
    objects: int
    windows: int
    noise: tuple[float, float]
    seen: Spread
    refit: Spread
    turn_deg: float
    k1: float
    lens: Spread


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Objects `index` [N, 2], where each was measured `at` [N, 2], both in lattice steps.

    `weights` [N] from how large a cell is on the photo; `noise` [2] is the measure's own, in steps.
    """

    index: Array
    at: Array
    weights: Array
    noise: Array


def _plane_from_cells(laid: Placed) -> Array:
    """The affine map [3, 3] from lattice steps (i, j) to the plane."""
    assert laid.basis is not None
    return cells_from_basis(np.eye(3), laid.basis, laid.origin)


def places(found: Rectified) -> Places | None:
    """The objects of a lattice's view where they really are; None where too few can be told."""
    laid, view = found.view.placed, found.view
    if laid.basis is None:
        return None
    plane_from_cells = _plane_from_cells(laid)
    index = laid.index[laid.in_sight()].astype(float)
    image_from_cells = laid.image_from_plane @ plane_from_cells
    side_px = cell_sides_px(image_from_cells, index)[1]
    side = int(np.clip(np.median(side_px) // 2 * 2, *_SIDES))
    low, high = (index.min(0) - 1).astype(int), (index.max(0) + 2).astype(int)
    box = Box(int(low[0]), int(high[0]), int(low[1]), int(high[1]))
    painted = found.paint()
    top = 2**painted.bits - 1
    pixels = np.asarray(painted.values / top, np.float32)
    known = np.ones(painted.values.shape[:2], bool) if painted.alpha is None else painted.alpha > top / 2
    sheet = straighten(pixels, known, view.view_from_plane @ plane_from_cells, box=box, side=side)
    features, seen = sheet_features(sheet)
    return _registered(features, seen, index, low=low, side=side, side_px=side_px)


def _registered(
    features: NDArray, seen: NDArray, index: Array, *, low: NDArray, side: int, side_px: Array
) -> Places | None:
    """Each object's place by its features [C, H, W] against the mean of the others: coarse, then fine."""
    channels = np.ascontiguousarray(features.transpose(1, 2, 0), np.float32)
    reach = max(2, round(_REACH * side))

    def cut(at: Array, size: int) -> tuple[torch.Tensor, torch.Tensor]:
        steps = np.arange(size) - (size - 1) / 2
        middle = (at - low + 0.5) * side - 0.5
        x = (middle[:, 0, None, None] + steps).repeat(size, 1).astype(np.float32)
        y = (middle[:, 1, None, None] + steps[:, None]).repeat(size, 2).astype(np.float32)
        flat = (x.reshape(-1, size), y.reshape(-1, size))
        # OpenCV takes four channels at most.
        parts = [
            cv2.remap(np.ascontiguousarray(channels[:, :, chosen]), *flat, cv2.INTER_CUBIC)
            for chosen in (slice(0, 3), slice(3, 6))
        ]
        values = np.concatenate(parts, axis=-1).reshape(len(at), size, size, -1)
        known = cv2.remap(seen.astype(np.float32), *flat, cv2.INTER_LINEAR).reshape(len(at), 1, size, size)
        shown = torch.from_numpy((known > 0.99).astype(np.float32))
        return torch.from_numpy(values.transpose(0, 3, 1, 2).copy()) * shown, shown

    at = index.copy()
    _, shown = cut(at, side)
    kept = shown.mean((1, 2, 3)).numpy() > 0.95
    if kept.sum() < _FEWEST:
        return None
    index, at, side_px = index[kept], at[kept], side_px[kept]
    weights = torch.ones(len(at))
    for number in range(_ROUNDS):
        own, shown = cut(at, side)
        templates = mean_of_others(own, shown, weights)
        if number < 2:
            wide, seen_wide = cut(index, side + 2 * reach)
            offsets, peak, lead = correlate(wide, seen_wide, templates)
            moved = offsets.numpy()[:, ::-1] / side
            weights = peak.clamp(min=0) * (lead > 0)
            at = index + np.where((lead > 0).numpy()[:, None], moved, 0)
        else:
            at = at + _nudge(own, templates, _window(side)) / side
            # All together have no place: the template may not wander.
            off = (at - index)[weights.numpy() > 0]
            at = at - np.median(off, axis=0)
        at = index + np.clip(at - index, -_REACH, _REACH)
    own, shown = cut(at, side)
    templates = mean_of_others(own, shown, weights)
    agreed = (2 * (own * templates).sum((1, 2, 3)) / (own**2 + templates**2).sum((1, 2, 3))).numpy()
    inside = np.abs(at - index).max(1) < 0.9 * _REACH
    good = inside & (weights.numpy() > 0) & (agreed > _LEAST_AGREEMENT)
    if good.sum() < _FEWEST:
        return None
    quarters = np.kron([[1, 0], [0, 1]], np.ones((side // 2, side // 2)))
    one, other = (
        _nudge(own, templates, _window(side) * torch.from_numpy(half.astype(np.float32))) / side
        for half in (quarters, 1 - quarters)
    )
    # Half the difference of two halves errs as their mean does.
    noise = 1.4826 * np.median(np.abs(one - other)[good], axis=0) / 2
    certain = 1 / (_NOISE_STEPS**2 + (_NOISE_PX / np.maximum(side_px, 1)) ** 2)
    return Places(index[good], at[good], certain[good] / certain[good].max(), noise)


def _window(side: int) -> torch.Tensor:
    """The weight of a cell's samples [side, side]: neighbours reach into its border."""
    line = torch.hann_window(side + 2, periodic=False)[1:-1].sqrt()
    return line[:, None] * line


def _nudge(own: torch.Tensor, templates: torch.Tensor, window: torch.Tensor) -> Array:
    """The step (x, y) in samples [N, 2] that takes cells [N, C, s, s] nearer to templates (Lucas and Kanade).

    Each cell's strength is free.
    """
    gy, gx = torch.gradient(templates, dim=(2, 3))
    gain = (own * templates).sum((1, 2, 3)) / (templates**2).sum((1, 2, 3)).clamp(min=1e-9)
    off = (own - gain.clamp(0.3, 3)[:, None, None, None] * templates) * window
    gx, gy = (gain.clamp(0.3, 3)[:, None, None, None] * part for part in (gx, gy))
    xx, xy, yy = ((a * b * window).sum((1, 2, 3)) for a, b in ((gx, gx), (gx, gy), (gy, gy)))
    bx, by = ((part * off).sum((1, 2, 3)) for part in (gx, gy))
    ridge = 1e-3 * (xx + yy) + 1e-9
    xx, yy = xx + ridge, yy + ridge
    determinant = xx * yy - xy * xy
    # The content sits where the cell was cut plus this: reading farther along moves it back.
    steps = torch.stack([yy * bx - xy * by, xx * by - xy * bx], 1) / determinant[:, None]
    return -steps.clamp(-1, 1).double().numpy()


def _robust_lsq(rows: Array, values: Array, weights: Array) -> tuple[Array, Array]:
    """Coefficients [P, D] and their variance for unit noise [P]: strays count less (Cauchy)."""
    weight, found = weights.copy(), np.zeros((rows.shape[1], values.shape[1]))
    for _ in range(12):
        root = np.sqrt(weight)[:, None]
        found = np.asarray(np.linalg.lstsq(rows * root, values * root, rcond=None)[0], float)
        apart = np.linalg.norm(values - rows @ found, axis=1)
        scale = 1.4826 * np.median(apart) + 1e-9
        weight = weights / (1 + (apart / (_ROBUST * scale)) ** 2)
    return found, np.asarray(np.diag(np.linalg.pinv((rows * weight[:, None]).T @ rows)), float)


def spread(index: Array, at: Array, weights: Array) -> tuple[Spread, int]:
    """How even the places `at` [N, 2] of `index` [N, 2] are, and in how many neighbourhoods that is told."""
    middle = index.mean(0)
    x, y = (index - middle).T
    rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1)
    found, variance = _robust_lsq(rows, at, weights)
    off = at - rows @ found
    jitter = 1.4826 * np.median(np.abs(off), axis=0)
    # The period along u is d(place along u)/di = found[1] + 2 found[3] x + found[4] y; along v likewise.
    trend: list[float] = []
    error: list[float] = []
    for axis, (square, own, other) in enumerate(((3, x, y), (5, y, x))):
        change = 2 * found[square, axis] * own + found[4, axis] * other
        trend.append(float(np.ptp(change)))
        spans = 2 * np.ptp(own), np.ptp(other)
        error.append(
            float(jitter[axis] * np.sqrt(variance[square] * spans[0] ** 2 + variance[4] * spans[1] ** 2))
        )
    bow = [found[3, 1] * np.ptp(x) ** 2 / 4, found[5, 0] * np.ptp(y) ** 2 / 4]
    steps = _local_steps(index, at)
    local = list(np.std(steps, axis=0)) if len(steps) > 1 else [float("nan")] * 2

    def percent(pair: list[float] | Array) -> tuple[float, float]:
        return float(100 * pair[0]), float(100 * pair[1])

    told = Spread(percent(local), percent(jitter), percent(trend), percent(error), percent(np.abs(bow)))
    return told, len(steps)


def _local_steps(index: Array, at: Array) -> Array:
    """The least squares steps along u and v [W, 2] over each 3 x 3 objects, of which six are known."""
    number = {tuple(one): place for place, one in enumerate(index.astype(int).tolist())}
    found = []
    reach = _WINDOW // 2
    for i, j in number:
        near = [
            number[beside]
            for a in range(-reach, reach + 1)
            for b in range(-reach, reach + 1)
            if (beside := (i + a, j + b)) in number
        ]
        away = index[near] - index[near].mean(0)
        if len(near) < _LEAST_IN_WINDOW or np.linalg.eigvalsh(away.T @ away)[0] < 2:
            continue
        step = np.linalg.lstsq(np.c_[np.ones(len(near)), away], at[near], rcond=None)[0][1:]
        found.append((step[0, 0], step[1, 1]))
    return np.array(found).reshape(-1, 2)


def refitted(index: Array, at: Array, weights: Array) -> Array:
    """The homography [3, 3] that takes lattice steps `index` to the places `at`, robustly."""
    weight, found = weights.copy(), np.eye(3)
    for _ in range(12):
        depth = np.c_[index, np.ones(len(index))] @ found[2]
        rows, values = [], []
        for axis in (0, 1):
            part = np.zeros((len(index), 8))
            part[:, 3 * axis : 3 * axis + 3] = np.c_[index, np.ones(len(index))]
            part[:, 6:] = -index * at[:, axis : axis + 1]
            rows.append(part)
            values.append(at[:, axis])
        root = np.sqrt(weight) / depth
        flat = np.concatenate([part * root[:, None] for part in rows])
        numbers = np.linalg.lstsq(flat, np.concatenate([value * root for value in values]), rcond=None)[0]
        found = np.append(numbers, 1.0).reshape(3, 3)
        apart = np.linalg.norm(project(found, index)[0] - at, axis=1)
        weight = weights / (1 + (apart / (_ROBUST * (1.4826 * np.median(apart) + 1e-9))) ** 2)
    return found


def turned_deg(found: Rectified, cells_from_old: Array) -> float:
    """By how many degrees the plane's normal turns under the camera's focal, given the refitted lattice."""
    laid = found.view.placed
    old = laid.image_from_plane @ _plane_from_cells(laid)
    focal = laid.camera.focal_mm / 36 * laid.size.longer
    x, y = laid.size.middle
    calibration = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
    normals = [
        calibration.T @ np.linalg.inv(matrix).T @ np.array([0, 0, 1.0])
        for matrix in (old, old @ cells_from_old)
    ]
    first, second = (normal / np.linalg.norm(normal) for normal in normals)
    return float(np.degrees(np.arccos(np.clip(abs(first @ second), -1, 1))))


def with_lens(found: Rectified, seen: Places) -> tuple[float, Array]:
    """The radial coefficient under which the refitted lattice leaves least, and the places then [N, 2]."""
    laid = found.view.placed
    matrix = laid.image_from_plane @ _plane_from_cells(laid)
    photo = project(matrix, seen.at)[0]
    tried: list[tuple[float, float, Array]] = []
    for k1 in _K1:
        straight = straight_from_photo(torch.from_numpy(photo), float(k1), size=laid.size).numpy()
        at = project(np.linalg.inv(matrix), straight)[0]
        lattice = refitted(seen.index, at, seen.weights)
        even = project(np.linalg.inv(lattice), at)[0]
        tried.append((float(np.mean(np.linalg.norm(even - seen.index, axis=1))), float(k1), even))
    return min(tried, key=lambda one: one[0])[1:]


def measured(name: str, photo: Image, program: p3i.Program) -> Row | None:
    """All numbers of one photo; None where it has no measurable lattice."""
    found = rectify(photo, program)
    seen = places(found)
    if seen is None:
        return None
    before, windows = spread(seen.index, seen.at, seen.weights)
    lattice = refitted(seen.index, seen.at, seen.weights)
    even = project(np.linalg.inv(lattice), seen.at)[0]
    after, _ = spread(seen.index, even, seen.weights)
    k1, unbent = with_lens(found, seen)
    lens, _ = spread(seen.index, unbent, seen.weights)
    noise = (float(100 * seen.noise[0]), float(100 * seen.noise[1]))
    drawn, turn = int(found.view.placed.in_sight().sum()), turned_deg(found, lattice)
    return Row(name, drawn, len(seen.index), windows, noise, before, after, turn, k1, lens)


def _pair(values: tuple[float, float]) -> str:
    return f"{values[0]:5.2f} {values[1]:5.2f}"


def main() -> None:
    """Measure, print a line a photo and how many are straight."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", type=Path)
    parser.add_argument("--programs", type=Path, help="the JSON lines of `p3i synth`, instead of a search")
    parser.add_argument("--only", nargs="+", help="only photos whose name holds one of these words")
    parser.add_argument("--out", type=Path, help="write a JSON line for each photo")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    known: dict[str, p3i.Program] = {}
    if asked.programs:
        told = read_results(asked.programs)
        known = {name: p3i.loads(line["program"]) for name, line in told.items() if line["program"]}
    rows: list[Row] = []
    heads = ["local", "jitter", "noise", "trend", "error", "bow", "| refit: local", "trend"]
    print(f"{'% of a period, u v':36s}", *(f"{head:>11s}" for head in heads), "  turn |   k1       trend")
    with open(asked.out or os.devnull, "w", encoding="utf-8") as out:
        for truth in read_truth(asked.photos):
            name = Path(truth.file).name
            if asked.only and not any(word in name for word in asked.only):
                continue
            photo = p3i.read_image(asked.photos / truth.file)
            program = known.get(name) or p3i.synth(photo).program
            row = None if program is None else measured(name, photo, program)
            if row is None:
                print(f"{name:28s} -")
                continue
            rows.append(row)
            pairs = [row.seen.local, row.seen.jitter, row.noise, row.seen.trend, row.seen.error, row.seen.bow]
            after = [*map(_pair, (row.refit.local, row.refit.trend)), f"{row.turn_deg:6.2f}"]
            head = f"{name[:28]:28s} {row.objects:3d}/{row.drawn:3d}"
            print(
                head, *map(_pair, pairs), "|", *after, f"| {row.k1:5.2f}", _pair(row.lens.trend), flush=True
            )
            out.write(json.dumps(dataclasses.asdict(row)) + "\n")
    print(f"\nof {len(rows)} measured, below 1 % along both axes:")
    for name, pick in (("as found", "seen"), ("refitted", "refit"), ("refitted with a lens", "lens")):
        spreads = [getattr(row, pick) for row in rows]
        local = sum(max(one.local) < 1 for one in spreads)
        trend = sum(max(one.trend) < 1 for one in spreads)
        sure = sum(any(t > 1 + 2 * e for t, e in zip(one.trend, one.error, strict=True)) for one in spreads)
        smooth = sum(max(one.trend) / 12**0.5 < 1 for one in spreads)
        print(
            f"{name:22s} local {local:3d}  trend, end to end {trend:3d} (surely above: {sure})  "
            f"trend, standard deviation {smooth:3d}"
        )


if __name__ == "__main__":
    main()

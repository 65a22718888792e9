"""From one ring to more of it: other rings around its centre, and the same ring along a line.

The ring gives the pose, the centre, the step of the angle and the look of an object. What else looks so is
read off the straightened plane. Rings around the centre have their objects at the same angles, so a table of
radii by angles says where there are some; a ring that comes again is found by shifting all of it at once.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.interp.camera import project
from p3i.search.fit.fitted import Fit
from p3i.search.look.cells import agreement, mean_cell
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import Cells, Frames, frames, read, sample_px
from p3i.search.propose.views import depth_of_view, view_canvas
from p3i.search.propose.votes import gradient_tensor

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

# Patches are smaller than the ring's own, so that rings close by do not get in: these shares are tried, with
# so many samples a side.
_PATCHES = (0.7, 0.4)
_SAMPLES = 8
# Radii are tried in steps of this share of a patch, up to so many program units, on at most so many angles.
_RADIUS_STEP = 0.15
_MOST_RADIUS = 75.0
_MOST_SLOTS = 48
# An object is there where its agreement reaches this share of the ring's own objects'.
_PRESENT = 0.55
_LACKING = 0.7
_MOST_RINGS = 6
_MOST_FAN_COUNT = 16
# An object where none should be counts this much of one.
_STRAY = 0.5
# Each ring holds at least this share of its objects, weighed by how plain they are.
_RING_SHARE = 0.35
# The straightened plane has this many pixels a side; at most so many times further away than the nearest.
_CANVAS = 256
_DEPTH_RANGE = 4.0
# Shifted rings agree with the first at least so much, absolutely and relative to the best of them.
_LEAST_ALIKE = 0.25
_ALIKE_SHARE = 0.6
_MOST_PEAKS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class HybridProposal:
    """Rings worth fitting, i from `first` to `last` inclusive; units and degrees.

    Ring i has the radius `radius + i*growth`, its centre at `center + i*along`, and objects at the angles
    `phase_deg + j*step_deg` for j below `count`, or below `count*i` where `counted_by_ring`. `objects` is the
    evidence: about how many objects there are.
    """

    first: int
    last: int
    radius: float
    growth: float
    center: tuple[float, float]
    along: tuple[float, float]
    step_deg: float
    phase_deg: float
    count: int
    counted_by_ring: bool
    objects: float


@dataclass(frozen=True, slots=True, eq=False)
class BaseRing:
    """The ring to start from, by itself or among others: its numbers in program units and degrees.

    `fit` says what its objects look like, and the pose; `count` is how many objects it has itself.
    """

    fit: Fit
    center: Array
    radius: float
    phase_deg: float
    step_deg: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """How much objects speak for being there: `evidence` [R, S] by radius [R] and slot, about 1 for one.

    Slot k lies at the base ring's phase + k steps. Negative where none is seen, 0 out of sight.
    """

    evidence: Array
    radii: Array


def rings_around(evidence: Evidence, base: BaseRing) -> list[HybridProposal]:
    """Readings as rings of equal counts and as rings whose counts grow, the best of each size of patches."""
    found: list[HybridProposal] = []
    for share in _PATCHES:
        around = _around(evidence, base, share * base.fit.side)
        if around is not None:
            found += [got for got in (_concentric(base, around), _fan(base, around)) if got is not None]
    return found


def ring_repeated(evidence: Evidence, base: BaseRing) -> list[HybridProposal]:
    """The ring along a line, if it comes again at equal distances."""
    found = _alike_when_shifted(evidence, base)
    return [] if found is None else _along_lines(base, *found)


def _around(evidence: Evidence, base: BaseRing, side: float) -> Around | None:
    """What patches of `side` program units about the centre look like."""
    slots = round(360 / abs(base.step_deg))
    if slots > _MOST_SLOTS:
        return None
    fit, pattern = base.fit, base.fit.filling.pattern
    own = frames(pattern, fit.theta, fit.index, side=side)
    radii = np.arange(0.5 * side, _MOST_RADIUS * evidence.part.share, _RADIUS_STEP * side)
    angles = np.radians(base.phase_deg + np.arange(2 * slots) * base.step_deg / 2)
    r, angle = np.meshgrid(radii, angles, indexing="ij")
    out = np.stack([np.cos(angle), np.sin(angle)], -1).reshape(-1, 2)
    origin = torch.from_numpy(base.center + r.reshape(-1, 1) * out)
    along = torch.from_numpy(side * np.sign(base.step_deg) * np.stack([-out[:, 1], out[:, 0]], 1))
    across = torch.stack([-along[:, 1], along[:, 0]], 1)
    size = evidence.image.size
    matrix = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm)
    at, in_front = project(matrix, origin)
    seen = in_front & evidence.part.shows(at)
    every = Frames(
        torch.cat([own.origin, origin[seen]]),
        torch.cat([own.along, along[seen]]),
        torch.cat([own.across, across[seen]]),
    )
    colours = evidence.colours_for(sample_px(matrix, own, side=_SAMPLES))
    cells = read(colours, matrix, every, count=_SAMPLES, side=_SAMPLES).cells()
    ours = Cells(cells.values[: len(fit.index)], cells.known[: len(fit.index)])
    mean, _ = mean_cell(ours, fit.contrast.clamp(min=0))
    alike = agreement(cells.values, mean, cells.known).clamp(min=0).numpy().astype(float)
    known = (cells.known.float().mean(1) > 0.7).numpy()
    plain = float(np.quantile(alike[: len(fit.index)], 0.6))
    if plain <= 0.1:
        return None
    table = np.full(len(origin), np.nan)
    table[seen.numpy()] = np.where(known, alike, np.nan)[len(fit.index) :]
    table = table.reshape(len(radii), 2 * slots)
    objects, gaps = table[:, 0::2], table[:, 1::2]
    between = np.fmax(np.roll(gaps, 1, 1), gaps)
    # Near the centre half a step is less than an object, and tells nothing.
    tells = radii * math.radians(abs(base.step_deg)) / 2 > 0.6 * side
    contrast = objects - np.where(tells[:, None], np.nan_to_num(between), 0.0) * 0.5
    # One that lacks is forgiven: it may be covered.
    worth = np.clip((contrast / plain - _PRESENT) / (1 - _PRESENT), -_LACKING, 1)
    return Around(np.nan_to_num(worth), radii)


def _widened(around: Around) -> Array:
    """The best evidence within a step of each radius, per slot."""
    padded = np.pad(around.evidence, ((1, 1), (0, 0)), mode="edge")
    return np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])


def _growths(base: BaseRing, around: Around) -> Array:
    return np.arange(0.45 * base.fit.side, 0.5 * around.radii[-1], (around.radii[1] - around.radii[0]) / 2)


def _row_of(around: Around, radius: float) -> int | None:
    row = round((radius - around.radii[0]) / (around.radii[1] - around.radii[0]))
    return row if 0 <= row < len(around.radii) else None


def _concentric(base: BaseRing, around: Around) -> HybridProposal | None:
    """Rings of the same count whose radii grow evenly."""
    table = _widened(around)
    count = table.shape[1]
    if base.count < 0.75 * count:
        return None
    totals = table.mean(1)
    best: tuple[float, HybridProposal] | None = None
    for growth in _growths(base, around):
        ends = []
        worth = float(count)
        for sign in (-1, 1):
            reach = 0
            while reach < _MOST_RINGS:
                row = _row_of(around, base.radius + sign * (reach + 1) * growth)
                if row is None or totals[row] < _RING_SHARE:
                    break
                worth += count * float(totals[row])
                reach += 1
            ends.append(reach)
        rings = sum(ends)
        if rings and (best is None or worth > best[0]):
            proposal = HybridProposal(
                first=0,
                last=rings,
                radius=base.radius - ends[0] * growth,
                growth=float(growth),
                center=(float(base.center[0]), float(base.center[1])),
                along=(0.0, 0.0),
                step_deg=360 / count,
                phase_deg=base.phase_deg,
                count=count,
                counted_by_ring=False,
                objects=worth,
            )
            best = worth, proposal
    return None if best is None else best[1]


def _fan(base: BaseRing, around: Around) -> HybridProposal | None:
    """Arcs at one step whose counts are a multiple of i."""
    table = _widened(around)
    slots = table.shape[1]
    # runs[r, a, n]: the evidence for n objects from slot a on, and none in the other slots.
    twice = np.concatenate([table, table], 1)
    sums = np.concatenate([np.zeros_like(table[:, :1]), twice.cumsum(1)], 1)
    strays = np.concatenate([np.zeros_like(table[:, :1]), twice.clip(0).cumsum(1)], 1)
    start = np.arange(slots)[:, None]
    stop = start + np.arange(slots + 1)
    inside = sums[:, stop] - sums[:, start]
    runs = inside - _STRAY * (strays[:, -1, None, None] / 2 - (strays[:, stop] - strays[:, start]))
    lengths = np.arange(slots + 1).clip(1)
    runs = np.where(inside / lengths < _RING_SHARE, -np.inf, runs)
    best: tuple[float, HybridProposal] | None = None
    for growth in _growths(base, around):
        for own in range(1, _MOST_RINGS + 1):
            radius = base.radius - own * growth
            if radius < -0.25 * growth:
                break
            rows = [_row_of(around, radius + i * growth) for i in range(1, _MOST_RINGS + 1)]
            for count in range(2, min(_MOST_FAN_COUNT, slots // own) + 1):
                most = min(_MOST_RINGS, slots // count)
                worth = np.array(
                    [runs[row, :, count * i] if row is not None else np.full(slots, -np.inf)
                     for i, row in enumerate(rows[:most], start=1)]
                )  # fmt: skip
                for first in (1, 2, 3):
                    if first > own:
                        break
                    totals = worth[first - 1 :].cumsum(0)[1:]
                    if len(totals) == 0 or not np.isfinite(totals).any():
                        continue
                    last, turn = divmod(int(totals.argmax()), slots)
                    value = float(totals[last, turn])
                    if first + 1 + last < own or (best is not None and value <= best[0]):
                        continue
                    proposal = HybridProposal(
                        first=first,
                        last=first + 1 + last,
                        radius=float(radius),
                        growth=float(growth),
                        center=(float(base.center[0]), float(base.center[1])),
                        along=(0.0, 0.0),
                        step_deg=base.step_deg,
                        phase_deg=base.phase_deg + turn * base.step_deg,
                        count=count,
                        counted_by_ring=True,
                        objects=value,
                    )
                    best = value, proposal
    return None if best is None else best[1]


def _alike_when_shifted(evidence: Evidence, base: BaseRing) -> tuple[Floats, float] | None:
    """How alike the ring is to what lies at each shift [S, S], the middle being none; units in a pixel."""
    fit, pattern = base.fit, base.fit.filling.pattern
    size = evidence.image.size
    seen = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm).numpy()
    part = evidence.part
    part_from_plane = part.from_photo.numpy() @ seen
    canvas = view_canvas(part_from_plane, part.size, side=_CANVAS, depth_range=_DEPTH_RANGE)
    if canvas is None:
        return None
    unit = canvas.unit
    colours = evidence.colours_for(unit * size.unit_px)
    matrix = colours.map_from_photo.numpy() @ seen @ canvas.plane_from_view
    depth = depth_of_view(matrix, _CANVAS)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP

    def warped(planes: NDArray) -> Floats:
        planes = np.ascontiguousarray(planes, np.float32)
        return cv2.warpPerspective(planes, matrix, (_CANVAS, _CANVAS), flags=flags)  # pyright: ignore

    valid = warped(colours.valid.numpy())
    known = cv2.erode(((depth > 0) & (valid > 0.99)).astype(np.uint8), np.ones((5, 5))).astype(np.float32)
    lab = cv2.GaussianBlur(warped(colours.lab), (0, 0), 0.8)
    tensor = gradient_tensor(np.asarray(lab, np.float32)) * known
    energy = cv2.GaussianBlur(np.abs(tensor) ** 2, (0, 0), 0.04 * _CANVAS)
    tensor = tensor / np.sqrt(energy + energy.mean() + 1e-9)
    corner = canvas.plane_from_view[:2, 2]
    centers = (pattern.points_at(fit.index, fit.theta).numpy() - corner) / unit
    mask = np.zeros((_CANVAS, _CANVAS), np.float32)
    reach = max(2, round(0.4 * fit.side / unit))
    for (cx, cy), sure in zip(centers, fit.contrast.tolist(), strict=True):
        if sure > 0:
            cv2.circle(mask, (round(cx), round(cy)), reach, 1.0, -1)
    mask *= known
    shape = (2 * _CANVAS, 2 * _CANVAS)
    template = np.fft.fft2(tensor * mask, shape)
    inner = np.fft.ifft2(np.conj(template) * np.fft.fft2(tensor, shape)).real
    cut = np.conj(np.fft.fft2(mask, shape))
    there = np.fft.ifft2(cut * np.fft.fft2(np.abs(tensor) ** 2, shape)).real
    share = np.fft.ifft2(cut * np.fft.fft2(known, shape)).real / max(float(mask.sum()), 1.0)
    own = np.conj(np.fft.fft2(np.abs(tensor * mask) ** 2, shape))
    ours = np.fft.ifft2(own * np.fft.fft2(known, shape)).real
    ncc = 2 * inner / np.maximum(there + ours, 0.3 * float(ours.max()))
    return np.fft.fftshift(np.where(share > 0.4, ncc, 0.0)).astype(np.float32), unit


def _along_lines(base: BaseRing, alike: Floats, unit: float) -> list[HybridProposal]:
    """The shift whose multiples the ring agrees with best, as a proposal."""
    middle = len(alike) // 2
    apart = max(2, round(0.5 * base.fit.side / unit))
    peaks = (alike == cv2.dilate(alike, np.ones((2 * apart + 1,) * 2))) & (alike > _LEAST_ALIKE)
    rows, columns = np.nonzero(peaks)
    shifts = np.stack([columns, rows], 1) - middle
    values = alike[rows, columns]
    far = np.hypot(*shifts.T) * unit > 0.8 * base.radius
    order = np.argsort(-values[far])[:_MOST_PEAKS]
    shifts, values = shifts[far][order], values[far][order]
    if len(values) == 0:
        return []
    widened = cv2.dilate(alike, np.ones((2 * (apart // 2) + 1,) * 2))
    best: tuple[float, float, Array, list[int]] | None = None
    for shift, value in zip(shifts, values, strict=True):
        if value < _ALIKE_SHARE * values[0]:
            continue
        ends, worth = [], 1.0
        for sign in (-1, 1):
            reach = 0
            while reach < _MOST_RINGS:
                x, y = middle + sign * (reach + 1) * shift
                if not (0 <= x < len(alike) and 0 <= y < len(alike)):
                    break
                if widened[y, x] < _ALIKE_SHARE * value:
                    break
                worth += float(widened[y, x])
                reach += 1
            ends.append(reach)
        if best is None or worth > best[0] + 1e-6:
            best = worth, float(value), shift * unit, ends
    if best is None:
        return []
    worth, _, along, ends = best
    first = base.center - ends[0] * along
    return [
        HybridProposal(
            first=0,
            last=sum(ends),
            radius=base.radius,
            growth=0.0,
            center=(float(first[0]), float(first[1])),
            along=(float(along[0]), float(along[1])),
            step_deg=base.step_deg,
            phase_deg=base.phase_deg,
            count=base.count,
            counted_by_ring=False,
            objects=worth * base.count,
        )
    ]

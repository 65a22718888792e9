"""From one ring to more of it: other rings around its centre, and the same ring along a line.

The ring gives the pose, the centre, the step of the angle and the look of an object. What else looks so is
read off the straightened plane. Rings around the centre have their objects at the same angles, so a table of
radii by angles says where there are some; a ring that comes again is found by shifting all of it at once.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from p3i.interp.camera import project
from p3i.search.config import FEWEST_OBJECTS
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.places import numbers_of, values_of
from p3i.search.forms.filling import standing
from p3i.search.forms.guess import Base, Guess
from p3i.search.forms.spelled import rings_filling
from p3i.search.look.cells import Cells, agreement, mean_cell
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import Frames, frames, read, sample_px
from p3i.search.look.recurrence import MOST_HIDDEN
from p3i.search.look.session import Session
from p3i.search.look.unrolled import COUNTS, RADII
from p3i.search.propose.views import gradient_view

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

# Patches are smaller than the ring's own, so that rings close by do not get in: these shares are tried, with
# so many samples a side.
_PATCHES = (0.7, 0.4)
_SAMPLES = 8
# Radii are tried in steps of this share of a patch.
_RADIUS_STEP = 0.15
# An object is there where its agreement reaches this share of the ring's own objects'.
_PRESENT = 0.55
_LACKING = 0.7
_MOST_RINGS = 6
# An object where none should be counts this much of one.
_STRAY = 0.5
# Each ring holds at least this share of its objects, weighed by how plain they are.
_RING_SHARE = 0.35
# The straightened plane has this many pixels a side.
_CANVAS = 256
# Shifted rings agree with the first at least so much, absolutely and relative to the best of them.
_LEAST_ALIKE = 0.25
_ALIKE_SHARE = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class _Ring:
    """A ring that was `found`, by its numbers: program units and degrees, `count` objects of its own."""

    found: Drawn
    center: Array
    radius: float
    phase_deg: float
    step_deg: float
    count: int

    @classmethod
    def of(cls, found: Drawn) -> "_Ring":
        """The numbers of a ring's fit."""
        values, count = values_of(found.fit), len(found.fit.pattern.index)
        center = np.array([values["draw.x.offset.1"], values["draw.y.offset.1"]])
        step_deg = values.get("draw.x.angle.j", 360 / count)
        return cls(found, center, values["draw.x.radius.1"], values["draw.x.angle.1"], step_deg, count)

    @property
    def slots(self) -> int:
        """How many objects would close it."""
        return round(360 / abs(self.step_deg))

    @property
    def fit(self) -> Fit:
        """What its objects look like, and the pose."""
        return self.found.fit

    def about_as(self, other: "_Ring") -> bool:
        """Whether two rings lie about one centre and turn by the same step."""
        apart = float(np.hypot(*(self.center - other.center)))
        turned = abs(self.step_deg - other.step_deg)
        return apart < 0.1 * self.radius and turned < 0.05 * abs(self.step_deg)


def guesses_around(look: Session, rings: Sequence[Drawn]) -> Iterator[Guess]:
    """More rings around each of some, or a ring again along a line: the most objects of each ring first."""
    done: list[_Ring] = []
    for found in rings:
        ring = _Ring.of(found)
        if len(found.fit.contrast) < FEWEST_OBJECTS or any(ring.about_as(other) for other in done):
            continue
        look.tell("more rings", 0.95)
        done.append(ring)
        yield from sorted(_rings_around(look.evidence, ring), key=lambda guess: -guess.promise)
        if ring.count >= (1 - MOST_HIDDEN) * ring.slots:
            yield from _along_lines(look.evidence, ring)


def _guess(
    ring: _Ring,
    rings: tuple[int, int],
    count: int,
    *,
    fan: bool = False,
    promise: float,
    center: Array,
    radius: float,
    growth: float = 0.0,
    along: Array | None = None,
    phase_deg: float,
) -> Guess:
    """The first to the last of `rings`, inclusive, of `count` objects each, or `count*i` on ring i (`fan`).

    Ring i has the radius `radius + i*growth` and its centre at `center + i*along`. `promise` is the evidence:
    about how many objects there are. Pose, focal and step are those of the ring that they begin with.
    """
    fit, (first, last) = ring.fit, rings
    filling = rings_filling(first, last + 1, count, fan=fan, grows=growth != 0, moves=along is not None)
    filling = standing(filling, upright=fit.pattern.upright)
    values = values_of(fit) | {
        "draw.x.radius.1": radius,
        "draw.x.radius.i": growth,
        "draw.x.angle.1": phase_deg,
        "draw.x.angle.j": ring.step_deg,
        "draw.x.offset.1": center[0],
        "draw.y.offset.1": center[1],
    }
    if along is not None:
        values |= {"draw.x.offset.i": along[0], "draw.y.offset.i": along[1]}
    base = Base(len(fit.contrast), fit.mean, fit.quality, fit.side, ring.found.sure)
    return Guess(filling, numbers_of(filling, values), promise, fit.focal_mm, base=base)


def _rings_around(evidence: Evidence, ring: _Ring) -> Iterator[Guess]:
    """Readings as rings of equal counts and as rings whose counts grow, the best of each size of patches."""
    for share in _PATCHES:
        around = _around(evidence, ring, share * ring.fit.side)
        if around is not None:
            for guess in (_concentric(ring, *around), _fan(ring, *around)):
                if guess is not None:
                    yield guess


def _around(evidence: Evidence, ring: _Ring, side: float) -> tuple[Array, Array] | None:
    """How much patches of `side` units about the centre speak for objects: a table [R, S] and its radii [R].

    By radius and slot, about 1 for an object, negative where none is seen, 0 out of sight; slot k lies at the
    ring's phase + k steps. Each radius has the best of itself and its neighbours.
    """
    slots = ring.slots
    if slots > COUNTS[1]:
        return None
    fit, pattern = ring.fit, ring.fit.pattern
    own = frames(pattern, fit.theta, fit.index, side=side)
    # Rings about a tiny one are no further apart than it is wide; the photo has room for hundreds of them.
    most = min(RADII[1] * evidence.part.share, (1 + _MOST_RINGS) * ring.radius)
    radii = np.arange(0.5 * side, most, _RADIUS_STEP * side)
    angles = np.radians(ring.phase_deg + np.arange(2 * slots) * ring.step_deg / 2)
    r, angle = np.meshgrid(radii, angles, indexing="ij")
    out = np.stack([np.cos(angle), np.sin(angle)], -1).reshape(-1, 2)
    origin = torch.from_numpy(ring.center + r.reshape(-1, 1) * out)
    along = torch.from_numpy(side * np.sign(ring.step_deg) * np.stack([-out[:, 1], out[:, 0]], 1))
    if pattern.upright:
        along = along.new_tensor([side, 0.0]).expand_as(along)
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
    cells = read(colours, matrix, every, count=_SAMPLES, side=_SAMPLES, by_row=pattern.turns).cells()
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
    tells = radii * math.radians(abs(ring.step_deg)) / 2 > 0.6 * side
    contrast = objects - np.where(tells[:, None], np.nan_to_num(between), 0.0) * 0.5
    # One that lacks is forgiven: it may be covered.
    worth = np.clip((contrast / plain - _PRESENT) / (1 - _PRESENT), -_LACKING, 1)
    padded = np.pad(np.nan_to_num(worth), ((1, 1), (0, 0)), mode="edge")
    return np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:]), radii


def _growths(ring: _Ring, radii: Array) -> Array:
    return np.arange(0.45 * ring.fit.side, 0.5 * radii[-1], (radii[1] - radii[0]) / 2)


def _row_of(radii: Array, radius: float) -> int | None:
    row = round((radius - radii[0]) / (radii[1] - radii[0]))
    return row if 0 <= row < len(radii) else None


def _both_ways(worth_at: Callable[[int], float], *, least: float) -> tuple[int, int, float]:
    """How many rings in a row, down and up from the first, are worth `least`, and what they are worth.

    At most _MOST_RINGS each way.
    """
    ends, total = [], 0.0
    for sign in (-1, 1):
        reach = 0
        while reach < _MOST_RINGS and (worth := worth_at(sign * (reach + 1))) >= least:
            total += worth
            reach += 1
        ends.append(reach)
    return ends[0], ends[1], total


def _concentric(ring: _Ring, table: Array, radii: Array) -> Guess | None:
    """Rings of the same count whose radii grow evenly."""
    count = table.shape[1]
    if ring.count < 0.75 * count:
        return None
    totals = table.mean(1)

    def worth_at(step: int) -> float:
        row = _row_of(radii, ring.radius + step * growth)
        return -math.inf if row is None else float(totals[row])

    best: Guess | None = None
    for growth in _growths(ring, radii).tolist():
        down, up, worth = _both_ways(worth_at, least=_RING_SHARE)
        promise = count * (1 + worth)
        if down + up and (best is None or promise > best.promise):
            best = _guess(
                ring,
                (0, down + up),
                count,
                promise=promise,
                center=ring.center,
                radius=ring.radius - down * growth,
                growth=growth,
                phase_deg=ring.phase_deg,
            )
    return best


def _fan(ring: _Ring, table: Array, radii: Array) -> Guess | None:
    """Arcs at one step whose counts are a multiple of i."""
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
    best: Guess | None = None
    for growth in _growths(ring, radii).tolist():
        for own in range(1, _MOST_RINGS + 1):
            radius = ring.radius - own * growth
            if radius < -0.25 * growth:
                break
            rows = [_row_of(radii, radius + i * growth) for i in range(1, _MOST_RINGS + 1)]
            for count in range(2, slots // own + 1):
                most = min(_MOST_RINGS, slots // count)
                worth = np.array(
                    [runs[row, :, count * i] if row is not None else np.full(slots, -np.inf)
                     for i, row in enumerate(rows[:most], start=1)]
                )  # fmt: skip
                for first in range(1, min(3, own, most - 1) + 1):
                    totals = worth[first - 1 :].cumsum(0)[1:]
                    more, turn = divmod(int(totals.argmax()), slots)
                    last, promise = first + 1 + more, float(totals[more, turn])
                    if last >= own and promise > (0.0 if best is None else best.promise):
                        best = _guess(
                            ring,
                            (first, last),
                            count,
                            fan=True,
                            promise=promise,
                            center=ring.center,
                            radius=radius,
                            growth=growth,
                            phase_deg=ring.phase_deg + turn * ring.step_deg,
                        )
    return best


def _alike_when_shifted(evidence: Evidence, ring: _Ring) -> tuple[Floats, float] | None:
    """How alike the ring is to what lies at each shift [S, S], the middle being none; units in a pixel."""
    fit, pattern = ring.fit, ring.fit.pattern
    size = evidence.image.size
    seen = pattern.image_from_plane(fit.theta, size=size, focal_mm=fit.focal_mm).numpy()
    colours = evidence.colours_for(evidence.part.size.longer / _CANVAS)
    view = gradient_view(colours, colours.map_from_photo.numpy() @ seen, side=_CANVAS)
    if view is None:
        return None
    tensor, known, unit = view.tensor, view.known.astype(np.float32), view.canvas.unit
    corner = view.canvas.plane_from_view[:2, 2]
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


def _along_lines(evidence: Evidence, ring: _Ring) -> Iterator[Guess]:
    """The ring along a line, if it comes again at equal distances: at the shift it agrees with most often."""
    shifted = _alike_when_shifted(evidence, ring)
    if shifted is None:
        return
    alike, unit = shifted
    middle = len(alike) // 2
    apart = max(2, round(0.5 * ring.fit.side / unit))
    peaks = (alike == cv2.dilate(alike, np.ones((2 * apart + 1,) * 2))) & (alike > _LEAST_ALIKE)
    rows, columns = np.nonzero(peaks)
    shifts = np.stack([columns, rows], 1) - middle
    values = alike[rows, columns]
    far = np.hypot(*shifts.T) * unit > 0.8 * ring.radius
    order = np.argsort(-values[far])
    shifts, values = shifts[far][order], values[far][order]
    widened = cv2.dilate(alike, np.ones((2 * (apart // 2) + 1,) * 2))

    def alike_at(step: int) -> float:
        x, y = middle + step * shift
        return float(widened[y, x]) if 0 <= x < len(alike) and 0 <= y < len(alike) else -math.inf

    best: Guess | None = None
    for shift, value in zip(shifts, values.tolist(), strict=True):
        if value < _ALIKE_SHARE * values[0]:
            break
        down, up, worth = _both_ways(alike_at, least=_ALIKE_SHARE * value)
        promise = (1 + worth) * ring.slots
        if best is None or promise > best.promise + 1e-6:
            along = shift * unit
            best = _guess(
                ring,
                (0, down + up),
                ring.slots,
                promise=promise,
                center=ring.center - down * along,
                radius=ring.radius,
                along=along,
                phase_deg=ring.phase_deg,
            )
    if best is not None:
        yield best

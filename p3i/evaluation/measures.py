"""How far a program for a photo lies from what people annotated there: the measures of the paper, and ours.

Convention: pixels are those of the photo as annotated; the true plane is measured in plane pixels, under the
annotation's focal (docs/evaluation.md). Measures of places take the best over all readings of "the object"
that the annotation allows.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import torch

from p3i.evaluation.truth import Ring, Truth
from p3i.grammar.ast import Polar, Program
from p3i.interp.camera import Camera, rotation
from p3i.interp.lens import photo_from_straight
from p3i.interp.unroll import distinct, nest, points
from p3i.size import Size

Array = np.ndarray

HIT = 0.25
"""An object is found where one is drawn within this share of the spacing, on the true plane."""
REFERENCE_MM = 35.0
"""Poses found with any lens are compared as this lens would see the same vanishing line."""

_TURNS = 24
_MOST_SHIFTS = 60
_NEIGHBOURS = 29
# How far steps may be from whole steps of the true lattice, and a cell's area from the whole number.
_WHOLE, _AREA = 0.15, 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """One program on one photo.

    `pose_deg`: between the found and the true normal, through a 35 mm lens. `pose_l1`: the paper's, the L1
    norm of the difference of the rotation vectors, degrees. `det_gt`, `gt_det`: the paper's, the mean
    distance from each drawn object to the nearest true one and back, in shares of width and height; their
    sum is `chamfer`.
    `f1`: hits against misses and objects too many; `f1_free` after the best shift or turn. `index`: the area
    of the drawn cell in true cells, None where there is no lattice. `lattice_ok`: it is the true lattice.
    """

    pose_deg: float = 90.0
    pose_l1: float = 90.0
    det_gt: float = 1.0
    gt_det: float = 1.0
    chamfer: float = 2.0
    f1: float = 0.0
    f1_free: float = 0.0
    structure_ok: bool = False
    index: float | None = None
    lattice_ok: bool | None = None


def measure(program: Program, truth: Truth) -> Measures:
    """The measures of a program; its header says the focal, 35 mm stands in.

    Raises ParseError for a program that draws too much to be unrolled.
    """
    size = truth.size
    found, true = Camera.of(program), truth.camera
    seen, right = (
        np.asarray(rotation(one.rx_deg, one.ry_deg))
        for one in (found.refocused(REFERENCE_MM), true.refocused(REFERENCE_MM))
    )
    cosine = float(np.clip(seen[:, 2] @ right[:, 2], -1, 1))
    turn = cv2.Rodrigues(seen)[0] - cv2.Rodrigues(right)[0]
    drawn = _seen_points(program, found, size)
    plane_from_image = np.linalg.inv(true.image_from_plane(size).numpy())
    unit = size.unit_px
    on_plane = _through(plane_from_image, drawn) * unit
    on_plane = on_plane[np.isfinite(on_plane).all(1)]
    places = _Places()
    for objects in truth.readings if len(drawn) else ():
        places = places.better(_places(drawn, objects, size))
        true_plane = _through(plane_from_image, objects) * unit
        hit_within = HIT * _spacing(true_plane)
        as_it_is = f1(on_plane, true_plane, within=hit_within)
        moved = _best_moved(on_plane, true_plane, truth, within=hit_within)
        places = places.with_hits(as_it_is, max(as_it_is, moved))
    index, same = None, None
    if truth.structure == "lattice":
        index, same = _lattice_index(on_plane, truth) if len(drawn) else (None, False)
    return Measures(
        pose_deg=math.degrees(math.acos(cosine)),
        pose_l1=float(np.degrees(np.abs(turn).sum())),
        det_gt=places.det_gt,
        gt_det=places.gt_det,
        chamfer=places.det_gt + places.gt_det,
        f1=places.f1,
        f1_free=places.f1_free,
        structure_ok=structure_of(program) in truth.accept_structure,
        index=index,
        lattice_ok=same,
    )


def structure_of(program: Program) -> str | None:
    """What a program lays out: a lattice, one ring (circular), several (hybrid); None without a loop."""
    parts = nest(program)
    loops = sum(loop is not None for loop in (parts.for_i, parts.for_j))
    if not loops:
        return None
    if not (isinstance(parts.draw.x, Polar) or isinstance(parts.draw.y, Polar)):
        return "lattice"
    return "circular" if loops == 1 else "hybrid"


def f1(found: Array, true: Array, *, within: float) -> float:
    """2PR / (P + R) of points [N, 2] against [M, 2], one to one, the nearest first; 0 for no points."""
    if len(found) == 0:
        return 0.0
    distance, partner = nearest(found, true)
    order = np.argsort(distance)
    close = order[distance[order] <= within]
    hits = len(set(partner[close].tolist()))
    return 2 * hits / (len(found) + len(true))


def nearest(points: Array, others: Array) -> tuple[Array, Array]:
    """For each of `points` [N, 2] the distance to the nearest of `others` [M, 2], and which that is."""
    distances, partners = [], []
    for start in range(0, len(points), 1000):  # a thousand rows of the table at a time
        apart = np.linalg.norm(points[start : start + 1000, None] - others[None], axis=2)
        distances.append(apart.min(1))
        partners.append(apart.argmin(1))
    return np.concatenate(distances), np.concatenate(partners)


@dataclass(frozen=True, slots=True)
class _Places:
    """The best so far over the readings of an annotation."""

    det_gt: float = 1.0
    gt_det: float = 1.0
    f1: float = 0.0
    f1_free: float = 0.0

    def better(self, distances: tuple[float, float]) -> "_Places":
        if sum(distances) >= self.det_gt + self.gt_det:
            return self
        return _Places(*distances, self.f1, self.f1_free)

    def with_hits(self, f1: float, f1_free: float) -> "_Places":
        best = max(self.f1, f1)
        return _Places(self.det_gt, self.gt_det, best, max(self.f1_free, f1_free, best))


def _places(drawn: Array, objects: Array, size: Size) -> tuple[float, float]:
    scale = np.array([size.width, size.height], float)
    return tuple(  # pyright: ignore[reportReturnType]
        float(nearest(a / scale, b / scale)[0].mean()) for a, b in ((drawn, objects), (objects, drawn))
    )


def _seen_points(program: Program, camera: Camera, size: Size) -> Array:
    """The objects of a program on the canvas, each once, [N, 2]."""
    drawn = points(program)
    plane = np.array([drawn[place][:2] for place in distinct(drawn)], float).reshape(-1, 2)
    pixels = _through(camera.image_from_plane(size).numpy(), plane)
    lens = program.header.lens_k1 if program.header is not None else None
    if lens:  # the photo as it is, bent
        bent, shown = photo_from_straight(torch.from_numpy(pixels), lens, size=size)
        pixels = np.where(shown.numpy()[:, None], bent.numpy(), np.nan)
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels <= (size.width - 1, size.height - 1))).all(1)
    return pixels[inside]


def _through(matrix: Array, points: Array) -> Array:
    """Points [N, 2] through a homography; nan where they lie behind."""
    moved = points @ matrix[:, :2].T + matrix[:, 2]
    ahead = moved[:, 2] > 1e-9
    return np.where(ahead[:, None], moved[:, :2] / np.where(ahead, moved[:, 2], 1)[:, None], np.nan)


def _spacing(true: Array) -> float:
    """The median distance to the nearest neighbour."""
    apart = np.linalg.norm(true[:, None] - true[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(1)))


def _best_moved(found: Array, true: Array, truth: Truth, *, within: float) -> float:
    """The best F1 after one shift (a lattice has no first object) or one turn round the true middle."""
    if len(found) == 0:
        return 0.0
    if truth.structure == "lattice":
        distance, partner = nearest(found, true)
        every = max(1, len(found) // _MOST_SHIFTS)
        some = np.argsort(distance)[::every][:_MOST_SHIFTS]
        return max(f1(found + (true[partner[k]] - found[k]), true, within=within) for k in some)
    return max((_best_turned(found, true, ring, within=within) for ring in truth.rings[:1]), default=0.0)


def _best_turned(found: Array, true: Array, ring: Ring, *, within: float) -> float:
    best = 0.0
    back = np.linalg.inv(ring.plane_from_circle)
    for turn in np.linspace(0, 2 * math.pi / ring.count, _TURNS, endpoint=False):
        spin = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        turned = (found - ring.center) @ (ring.plane_from_circle @ spin @ back).T + ring.center
        best = max(best, f1(turned, true, within=within))
    return best


def _lattice_index(found: Array, truth: Truth) -> tuple[float | None, bool]:
    """The area of the found cell in true cells, and whether it is a lattice that the annotation accepts.

    Steps are read off the points around the middle one: the shortest, and the next that is not along it.
    """
    if truth.lattice is None:
        return None, False
    base, basis = truth.lattice
    steps = (found - base) @ np.linalg.inv(basis)
    if len(steps) < 4:
        return None, False
    middle = steps[np.linalg.norm(steps - np.median(steps, 0), axis=1).argmin()]
    around = steps - middle
    length = np.linalg.norm(around, axis=1)
    around = around[np.argsort(length)[1 : 1 + _NEIGHBOURS]]
    u = around[0]
    across = np.abs(u[0] * around[:, 1] - u[1] * around[:, 0])
    apart = across > 0.3 * np.linalg.norm(u) * np.linalg.norm(around, axis=1).clip(1e-9)
    v = around[int(apart.argmax())]
    area = abs(float(u[0] * v[1] - u[1] * v[0]))
    whole = max(float(np.abs(step - np.round(step)).max()) for step in (u, v))
    same = whole < _WHOLE and any(abs(area - index) < _AREA * index for index in truth.accept_index)
    return round(area, 2), same

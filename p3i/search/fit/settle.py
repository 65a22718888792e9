"""The last fit of a program: to the places where the photo shows its objects, and what these say of a camera.

Each object is looked for around where the program draws it, and all numbers are fitted to the places: those
of the program, and with them such as a camera may have besides, a focal, a lens, or a plane that is bent.
What the latter are worth is told in bits of the places' code length, under one model of their noise:

    length = sum over the objects of ln s^2 + 3 ln(1 + r^2 / 4 s^2)

with r a residual in units of `look/patches.whitening`, and s the scale that the residuals themselves show: a
Student t of 4 degrees of freedom in the picture's two directions (Lange, Little and Taylor 1989), under which
what stands off its plane has little to say. Neighbours that stray alike are no independent witnesses: a
lens, or a page that is not flat, makes many objects say no more than a few.

Convention: N objects, V numbers: the free ones of the program (`forms/whole.py`), then those of the camera.
Places are pixels of the photo as it was taken, which `Evidence.on_photo` knows.
"""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.camera import FILM_MM, project, rotation
from p3i.interp.lens import photo_from_straight
from p3i.search.fit.features import step_limits
from p3i.search.fit.places import FOCAL_SPREAD, MOST_ZOOM
from p3i.search.fit.slopes import with_slopes
from p3i.search.forms.filling import Filling
from p3i.search.forms.whole import whole_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import find_objects, frames, half_steps, spacing, whitening
from p3i.search.look.straight import Straightened, shifted
from p3i.search.look.thinned import thinned
from p3i.size import Size

Free = Literal["focal", "lens", "bend"]

# Of more objects so many are looked for; the others are taken to be as these.
_MOST_FOUND = 150
_FEWEST = 4
# Degrees of freedom of the noise.
_TAIL = 4.0
# The scale of residuals, in units of `whitening`: where to begin, and the least that is believed.
_VARIANCE, _LEAST_VARIANCE = 0.25, 1e-4
_MOST_STEPS, _SCALINGS = 20, 5
_SETTLED = 1e-3
_MOST_ALIKE = 0.95
# A camera's numbers: how many they are, the most of one step, and their spread before anything is seen. A
# bend is the height of the plane as a quadratic, in units of the pattern's reach.
_NUMBERS: dict[Free, int] = {"focal": 1, "lens": 1, "bend": 3}
_LIMITS: dict[Free, float] = {"focal": MOST_ZOOM, "lens": 0.05, "bend": 0.05}
_SPREADS: dict[Free, float] = {"focal": FOCAL_SPREAD, "lens": 0.1, "bend": 0.03}


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """The objects of a program, and where the photo shows them.

    `numbers` are the program's free ones in `filling`, `index` [N, 2] the objects found, at `places` [N, 2].
    `whiten` [N, 2, 2] takes differences of places to units of their noise, `weights` [N] have the mean 1.
    Each object stands for `each`, of a pattern that runs in so many `directions`. The program was written
    under `focal_mm`, on a `canvas` straightened of a lens `k1` of a photo of `size`; `expected_mm` is what
    the focal would be taken for if the objects did not tell.
    """

    filling: Filling
    numbers: Tensor
    index: Tensor
    places: Tensor
    whiten: Tensor
    weights: Tensor
    each: float
    directions: int
    focal_mm: float
    expected_mm: float
    canvas: Size
    size: Size
    k1: float

    def seen(self, moving: Tensor, free: tuple[Free, ...] = ()) -> Tensor:
        """Where numbers [..., V] put the objects on the photo: [..., N, 2]."""
        theta = self.filling.theta(moving[..., : len(self.numbers)])
        parts = moving[..., len(self.numbers) :].split([_NUMBERS[one] for one in free], -1)
        more = dict(zip(free, parts, strict=True))
        pattern = self.filling.pattern
        points = pattern.points_at(self.index, theta)
        focal_mm = more["focal"].exp()[..., 0] if "focal" in more else self.focal_mm
        if "bend" in more:
            straight = self._lifted(theta, points, more["bend"], focal_mm)
        else:
            matrix = pattern.image_from_plane(theta, size=self.canvas, focal_mm=focal_mm)
            straight = project(matrix, points)[0]
        k1 = more["lens"][..., None] if "lens" in more else self.k1
        return photo_from_straight(shifted(straight, self.canvas, self.size), k1, size=self.size)[0]

    def _lifted(self, theta: Tensor, points: Tensor, bend: Tensor, focal_mm: Tensor | float) -> Tensor:
        """The points of a plane [..., N, 2] that is bent by `bend` [..., 3], on the straight canvas."""
        flat = self.filling.pattern.points_at(self.index, self.filling.theta(self.numbers))
        away = flat - flat.mean(0)
        reach = away.norm(dim=1).max()
        x, y = (away / reach).T
        height = reach * (bend @ torch.stack([x * x, x * y, y * y]))
        paths = self.filling.pattern.paths
        turn = rotation(*(theta[..., paths.index(path)] for path in ("camera.rx", "camera.ry")))
        at = points @ turn[..., :2].mT + height[..., None] * turn[..., None, :, 2]
        focal = torch.as_tensor(focal_mm, dtype=at.dtype)[..., None, None] * (100 / FILM_MM)
        scale = self.canvas.unit_px / (1 + at[..., 2:] / focal)
        return at[..., :2] * scale + at.new_tensor(self.canvas.middle)


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """Numbers [V] fitted to the places of objects.

    `length` is the code length of the places in nats, but for what all fits share; `alike` how much of a
    residual is its neighbour's; `covariance` [V, V] the numbers' own, of places that are independent.
    """

    objects: Objects
    free: tuple[Free, ...]
    numbers: Tensor
    length: float
    alike: float
    covariance: Tensor

    def number(self, name: Free) -> float:
        """A number of the camera that was free, the first where it is several."""
        before = self.free[: self.free.index(name)]
        return float(self.numbers[len(self.objects.numbers) + sum(_NUMBERS[one] for one in before)])

    @property
    def share(self) -> float:
        """How many independent witnesses each object found is."""
        # As in a chain of which each link remembers a share of the one before.
        each, directions = self.objects.each, self.objects.directions
        alike = self.alike ** (each ** (-1 / directions))
        return each * ((1 - alike) / (1 + alike)) ** directions

    def sigma(self, name: Free) -> float:
        """The standard deviation of that number."""
        before = self.free[: self.free.index(name)]
        place = len(self.objects.numbers) + sum(_NUMBERS[one] for one in before)
        return math.sqrt(max(float(self.covariance[place, place]), 0.0) / self.share)

    def program(self) -> Program:
        """The program with these numbers."""
        return self.objects.filling.program(self.numbers[: len(self.objects.numbers)], ())


def objects_of(
    evidence: Evidence, program: Program, *, focal_mm: float | None = None, seen: Straightened | None = None
) -> Objects | None:
    """The objects of a program on a photo; None where fewer than four show.

    `focal_mm` is the program's own, None for the one that `evidence` assumes. `seen`: the straightened photo
    that `evidence` is of, None where it is of the photo as it was taken.
    """
    whole = whole_filling(program)
    if whole is None:
        return None
    filling, numbers = whole
    focal_mm = focal_mm or evidence.focal_mm
    pattern, theta, canvas = filling.pattern, filling.theta(numbers), evidence.image.size
    index = pattern.index[evidence.in_sight(pattern, theta, focal_mm=focal_mm)].double()
    shown, index = len(index), index[thinned(index, _MOST_FOUND)]
    if shown < _FEWEST:
        return None
    side = spacing(pattern, theta)
    found = find_objects(
        evidence, pattern, theta, index, torch.ones(len(index)), side=side, focal_mm=focal_mm
    )
    there = found.certainty > 0
    if int(there.sum()) < _FEWEST:
        return None
    where = frames(pattern, theta, index[there], side=side)
    matrix = pattern.image_from_plane(theta, size=canvas, focal_mm=focal_mm)
    places, _ = project(matrix, where.points(found.offsets[there][:, None])[:, 0])
    certainty = found.certainty[there].double()
    return Objects(
        filling,
        numbers,
        index[there],
        evidence.on_photo(places),
        whitening(matrix, where),
        certainty / certainty.mean(),
        shown / len(index),
        len(half_steps(pattern)),
        focal_mm,
        evidence.focal_mm,
        canvas,
        canvas if seen is None else seen.photo_size,
        0.0 if seen is None else seen.k1,
    )


def settled(objects: Objects, *free: Free) -> Settled:
    """The program's numbers, and those of the camera that are `free`, fitted to the objects' places.

    Gauss-Newton; the scale of the noise, and with it how much strays count, is fitted along.
    """
    starts: dict[Free, float] = {"focal": math.log(objects.focal_mm), "lens": objects.k1, "bend": 0.0}
    known: dict[Free, float] = {"focal": math.log(objects.expected_mm), "lens": 0.0, "bend": 0.0}
    theta = objects.filling.theta(objects.numbers)
    count = len(objects.numbers)
    more: list[Free] = [one for one in free for _ in range(_NUMBERS[one])]
    numbers = torch.cat([objects.numbers, torch.tensor([starts[one] for one in more]).double()])
    limits = torch.tensor([*step_limits(objects.filling, theta), *(_LIMITS[one] for one in more)]).double()
    mean = torch.cat([objects.numbers, torch.tensor([known[one] for one in more]).double()])
    certain = torch.tensor([0.0] * count + [_SPREADS[one] ** -2 for one in more]).double()
    variance = _VARIANCE
    inverse = torch.zeros(len(numbers), len(numbers))
    for _ in range(_MOST_STEPS):
        points, slopes = with_slopes(lambda moving: objects.seen(moving, free), numbers, limits)
        residual = torch.einsum("nij,nj->ni", objects.whiten, points - objects.places)
        rows = torch.einsum("nij,njp->nip", objects.whiten, slopes)
        weights, variance = _weighed(residual, objects.weights, variance)
        weights = weights / variance
        normal = torch.einsum("nip,n,niq->pq", rows, weights, rows) + torch.diag(certain * limits**2)
        slope = torch.einsum("nip,n,ni->p", rows, weights, residual) + certain * (numbers - mean) * limits
        inverse = torch.linalg.inv(normal + 1e-9 * torch.diag(normal.diagonal() + 1e-9))
        step = -inverse @ slope
        worst = float(step.abs().max())
        if not math.isfinite(worst) or worst < _SETTLED:
            break
        numbers = numbers + step * limits / max(1.0, worst)
    residual = torch.einsum("nij,nj->ni", objects.whiten, objects.seen(numbers, free) - objects.places)
    weights, variance = _weighed(residual, objects.weights, variance)
    squared = residual.square().sum(1)
    each = math.log(variance) + (_TAIL + 2) / 2 * (1 + squared / (_TAIL * variance)).log()
    alike = _alike(objects.places, residual * weights.sqrt()[:, None])
    return Settled(
        objects,
        free,
        numbers,
        float((objects.weights * each).sum()),
        alike,
        inverse * limits[:, None] * limits,
    )


def saved_bits(less: Settled, more: Settled, *, share: float) -> float:
    """How much shorter the places are told with the numbers that `more` has beside those of `less`.

    Before these numbers are paid for. `share`: how many independent witnesses each object found is, by the
    fullest fit (`Settled.share`), since what a lens moves alike is no noise once there is a lens. As many
    residuals as there are numbers are fitted by any.
    """
    spare = max(1 - len(more.numbers) / (2 * len(more.objects.index)), 0.0)
    return spare * share * (less.length - more.length) / math.log(2)


def _weighed(residual: Tensor, certainty: Tensor, variance: float) -> tuple[Tensor, float]:
    """What objects [N] count whose residuals are [N, 2], and the variance of these: a few steps of EM."""
    squared = residual.square().sum(1)
    weights = certainty
    for _ in range(_SCALINGS):
        weights = certainty * (_TAIL + 2) / (_TAIL + squared / variance)
        variance = max(float((weights * squared).sum()) / (2 * len(squared)), _LEAST_VARIANCE)
    return weights, variance


def _alike(places: Tensor, left: Tensor) -> float:
    """How much residuals `left` [N, 2] are those of their neighbours, 0 to _MOST_ALIKE."""
    apart = torch.cdist(places, places).fill_diagonal_(torch.inf)
    shared = float((left * left[apart.argmin(1)]).sum() / left.square().sum().clamp(min=1e-12))
    # By chance they share 0, give or take the root of 1 / N; less than that is nothing.
    chance = 1 / math.sqrt(len(places))
    return 0.0 if shared <= chance else min(shared * (1 - (chance / shared) ** 2), _MOST_ALIKE)

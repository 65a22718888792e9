"""The last fit of a program: to the places where the photo shows its objects, and what these say of a camera.

Each object is looked for around where the program draws it, and all numbers are fitted to the places: those
of the program, and with them such as a camera may have besides, a focal, a lens, or a plane that is bent.
What the latter are worth is told in bits of the places' code length, under the noise of `fit/robust.py`.

Convention: N objects, V numbers: the free ones of the program (`forms/whole.py`), then those of the camera.
Places are pixels of the photo as it was taken.
"""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.interp.camera import FILM_MM, project, rotation
from p3i.interp.lens import photo_from_straight
from p3i.search.fit.places import FOCAL_SPREAD, MOST_ZOOM, objects_about
from p3i.search.fit.robust import Fitted, fitted, moving_limits
from p3i.search.forms.filling import Filling
from p3i.search.forms.whole import whole_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import find_about, half_steps, spacing
from p3i.search.look.straight import Straightened, shifted
from p3i.search.look.thinned import thinned
from p3i.search.look.upright import as_it_stands
from p3i.size import Size

Free = Literal["focal", "lens", "bend"]

# Of more objects so many are looked for; the others are taken to be as these.
_MOST_FOUND = 150
_FEWEST = 2
# Each is looked for twice, the second time in so many samples along a side.
_CLOSER_SIDE = 24
# A camera's numbers: how many they are, the most of one step, and their spread before anything is seen. A
# bend is the height of the plane as a quadratic, in units of the pattern's reach.
_NUMBERS: dict[Free, int] = {"focal": 1, "lens": 1, "bend": 3}
_LIMITS: dict[Free, float] = {"focal": MOST_ZOOM, "lens": 0.05, "bend": 0.05}
_SPREADS: dict[Free, float] = {"focal": FOCAL_SPREAD, "lens": 0.1, "bend": 0.03}


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """The objects of a program, and where the photo shows them.

    `numbers` are the program's free ones in `filling`, `index` [N, 2] the objects found, at `places` [N, 2].
    `whiten` [N, 2, 2] takes differences of places to units of their noise, `weights` [N] say how sure each
    is. Each object stands for `each`, of a pattern that runs in so many `directions`. The program was written
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
        """The points of a plane [..., N, 2] that is bent by `bend` [..., 3], on the straight canvas.

        Curved by a matrix M the plane rises by x'Mx / 2. A page keeps its lengths: rolled to a cylinder,
        where M has one direction only, a point comes nearer by M x (x'Mx) / 6, and less high. Written so to
        the fourth order.
        """
        flat = self.filling.pattern.points_at(self.index, self.filling.theta(self.numbers))
        away = flat - flat.mean(0)
        a, b, c = (2 * bend / away.norm(dim=1).max()).unbind(-1)
        curved = away @ torch.stack([torch.stack([a, b / 2], -1), torch.stack([b / 2, c], -1)], -2)
        rise = (curved * away).sum(-1, keepdim=True)
        height = rise / 2 - rise * curved.square().sum(-1, keepdim=True) / 24
        paths = self.filling.pattern.paths
        turn = rotation(*(theta[..., paths.index(path)] for path in ("camera.rx", "camera.ry")))
        at = torch.cat([points - curved * rise / 6, height], -1) @ turn.mT
        focal = torch.as_tensor(focal_mm, dtype=at.dtype)[..., None, None] * (100 / FILM_MM)
        scale = self.canvas.unit_px / (1 + at[..., 2:] / focal)
        return at[..., :2] * scale + at.new_tensor(self.canvas.middle)


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """The numbers of a program and of a camera as the places of its objects tell them."""

    objects: Objects
    free: tuple[Free, ...]
    fit: Fitted

    @property
    def share(self) -> float:
        """How many independent witnesses each object found is (`Fitted.share`)."""
        return self.fit.share(each=self.objects.each, directions=self.objects.directions)

    def number(self, name: Free) -> float:
        """A number of the camera that was free, the first where it is several."""
        return float(self.fit.numbers[self._place(name)])

    def sigma(self, name: Free) -> float:
        """The standard deviation of that number."""
        covariance = self.fit.covariance(self.share, torch.zeros(len(self.fit.numbers)))
        return math.sqrt(max(float(covariance.diagonal()[self._place(name)]), 0.0))

    def program(self) -> Program:
        """The program with these numbers."""
        return self.objects.filling.program(self.fit.numbers[: len(self.objects.numbers)], ())

    def places(self) -> Tensor:
        """Where these numbers put the objects on the photo: [N, 2]."""
        return self.objects.seen(self.fit.numbers, self.free)

    def _place(self, name: Free) -> int:
        before = self.free[: self.free.index(name)]
        return len(self.objects.numbers) + sum(_NUMBERS[one] for one in before)


def objects_of(
    evidence: Evidence, program: Program, *, focal_mm: float | None = None, seen: Straightened | None = None
) -> Objects | None:
    """The objects of a program on a photo; None where fewer than two show.

    `focal_mm` is the program's own, None for the one that `evidence` assumes. `seen`: the straightened photo
    that `evidence` is of, where its lens is in question; else places are of what `evidence` is of.
    """
    filling, numbers = whole_filling(program)
    focal_mm = focal_mm or evidence.focal_mm
    pattern, theta, canvas = filling.pattern, filling.theta(numbers), evidence.image.size
    index = pattern.index[evidence.in_sight(pattern, theta, focal_mm=focal_mm)].double()
    if pattern.turning is not None:
        pattern, _ = as_it_stands(evidence, pattern, index, focal_mm=focal_mm, theta=theta)
    shown, index = len(index), index[thinned(index, _MOST_FOUND)]
    if shown < _FEWEST:
        return None
    side = spacing(pattern, theta)
    ones = torch.ones(len(index))
    found = objects_about(evidence, pattern, theta, index, ones, side=side, focal_mm=focal_mm)
    there = found.certainty > 0
    if int(there.sum()) < _FEWEST:
        return None
    matrix = pattern.image_from_plane(theta, size=canvas, focal_mm=focal_mm)
    certainty = found.certainty[there]
    # Once more where they were found, in finer samples.
    about = found.frames.chosen(there)
    closer = find_about(evidence, matrix, about, index[there], certainty.float(), side=_CLOSER_SIDE)
    offsets = torch.where((closer.lead > 0)[:, None], closer.offsets, 0.0)
    places, _ = project(matrix, about.points(offsets[:, None])[:, 0])
    return Objects(
        filling,
        numbers,
        index[there],
        places if seen is None else seen.points_on_photo(places),
        found.whiten[there],
        certainty,
        shown / len(index),
        len(half_steps(pattern)),
        focal_mm,
        evidence.focal_mm,
        canvas,
        canvas if seen is None else seen.photo_size,
        0.0 if seen is None else seen.k1,
    )


def settled(objects: Objects, *free: Free) -> Settled:
    """The program's numbers, and those of the camera that are `free`, fitted to the objects' places."""
    starts: dict[Free, float] = {"focal": math.log(objects.focal_mm), "lens": objects.k1, "bend": 0.0}
    means: dict[Free, float] = {"focal": math.log(objects.expected_mm), "lens": 0.0, "bend": 0.0}
    more: list[Free] = [one for one in free for _ in range(_NUMBERS[one])]
    fit = fitted(
        lambda moving: objects.seen(moving, free),
        torch.cat([objects.numbers, torch.tensor([starts[one] for one in more]).double()]),
        places=objects.places,
        whiten=objects.whiten,
        weights=objects.weights,
        limits=torch.cat(
            [
                moving_limits(objects.filling, objects.numbers),
                torch.tensor([_LIMITS[one] for one in more]).double(),
            ]
        ),
        mean=torch.cat([objects.numbers, torch.tensor([means[one] for one in more]).double()]),
        known=torch.tensor([0.0] * len(objects.numbers) + [_SPREADS[one] ** -2 for one in more]).double(),
    )
    return Settled(objects, free, fit)


def with_settled_numbers(evidence: Evidence, program: Program, *, focal_mm: float | None = None) -> Program:
    """The program with its numbers fitted once more, to where its own objects lie.

    As it is where fewer than two objects are left beside those that the numbers take. `focal_mm` is the
    program's own, None for the one that `evidence` assumes.
    """
    objects = objects_of(evidence, program, focal_mm=focal_mm)
    if objects is None or 2 * (len(objects.index) - 2) < len(objects.numbers):
        return program
    return settled(objects).program()


def saved_bits(less: Settled, more: Settled, *, share: float) -> float:
    """How much shorter the places are told with the numbers that `more` has beside those of `less`.

    Before these numbers are paid for. `share`: how many independent witnesses each object found is, by the
    fullest fit, since what a lens moves alike is no noise once there is a lens.
    """
    spare = max(1 - len(more.fit.numbers) / (2 * len(more.objects.index)), 0.0)
    return spare * share * (less.fit.length - more.fit.length) / math.log(2)

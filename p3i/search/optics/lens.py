"""Radial lens distortion, estimated from the pattern: k1 of p3i/interp/lens.py.

A lens bends the rows of a lattice and makes an egg of a ring, which no camera pose can. So where the objects
really lie, against where the program puts them, tells k1 together with all of the program's numbers. The
search itself knows of pinhole cameras only: it looks at the photo straightened of its lens, on a canvas wide
enough for all that the photo shows, and its programs are put back onto the photo's canvas.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import torch

from p3i.interp.camera import project
from p3i.interp.lens import photo_from_straight
from p3i.search.answer import Answer
from p3i.search.config import MOST_K1
from p3i.search.fit.features import step_limits
from p3i.search.fit.places import FOCAL_SPREAD, MOST_ZOOM
from p3i.search.fit.robust import robust_fit
from p3i.search.forms.whole import scaled, whole_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import Frames, find_objects, frames, spacing
from p3i.search.look.session import Session
from p3i.search.look.straight import Straightened, shifted, straightened
from p3i.search.look.thinned import thinned
from p3i.vision.warp import in_frame

# An object's place is known to this share of the spacing, and no better than this many photo pixels.
_SHARE_NOISE, _PIXEL_NOISE = 0.03, 0.3
# k1 before anything is known: none, give or take this.
_PRIOR_SPREAD = 0.2
# A lens is believed in where k1 is so many times its own uncertainty, and not too small to matter.
_SIGMAS, _LEAST_K1 = 4.0, 0.015
# Two estimates this close are one.
_CONVERGED = 0.01
_MOST_OBJECTS = 300
_FEWEST_OBJECTS = 12
_ROUNDS = 3
_K1_DIGITS = 4
# A fit that runs away ends within what the options take.
_MOST = 0.95 * MOST_K1

Search = Callable[[Session], list[Answer]]


@dataclass(frozen=True, slots=True)
class LensFit:
    """k1 as the objects tell it, its standard deviation, and from how many objects."""

    k1: float
    spread: float
    objects: int

    @property
    def certain(self) -> bool:
        """Whether there is a lens worth correcting."""
        return abs(self.k1) > max(_SIGMAS * self.spread, _LEAST_K1)


def estimated(evidence: Evidence, seen: Straightened, answer: Answer) -> LensFit | None:
    """k1 from the objects of an answer that was found on `seen`; None where they are too few.

    All numbers of the program, what it writes twice as one, and k1 are fitted together, to places on the
    photo as it was taken.
    """
    whole = whole_filling(answer.program)
    if whole is None:
        return None
    filling, numbers = whole
    pattern, theta = filling.pattern, filling.theta(numbers)
    focal_mm = answer.focal_mm or evidence.focal_mm
    canvas = evidence.image.size
    index = pattern.index.double()
    matrix = pattern.image_from_plane(theta, size=canvas, focal_mm=focal_mm)
    points, in_front = project(matrix, pattern.points_at(index, theta))
    index = index[in_front & in_frame(points, canvas)]
    index = index[thinned(index, _MOST_OBJECTS)]
    if len(index) < _FEWEST_OBJECTS:
        return None
    side = spacing(pattern, theta)
    found = find_objects(
        evidence, pattern, theta, index, torch.ones(len(index)), side=side, focal_mm=focal_mm
    )
    # Once more, with a mean of the objects that were seen.
    found = find_objects(evidence, pattern, theta, index, found.certainty, side=side, focal_mm=focal_mm)
    weights = found.certainty
    if int((weights > 0).sum()) < _FEWEST_OBJECTS:
        return None
    index, offsets, weights = index[weights > 0], found.offsets[weights > 0], weights[weights > 0].double()
    plane = frames(pattern, theta, index, side=side).points(offsets[:, None])[:, 0]
    straight, _ = project(matrix, plane)
    targets = seen.points_on_photo(straight)
    cell_px = _spacing_px(frames(pattern, theta, index, side=side), matrix)
    noise = (_PIXEL_NOISE**2 + (_SHARE_NOISE * cell_px) ** 2).sqrt()
    # Where the pattern was to tell the focal, an egg may have been taken for a circle under a wrong one.
    free_focal = answer.focal_mm is not None
    steps = [*step_limits(filling, theta), *([MOST_ZOOM] if free_focal else []), 0.05]

    def points_of(moving: torch.Tensor) -> torch.Tensor:
        theta = filling.theta(moving[..., : len(numbers)])
        at = pattern.image_from_plane(
            theta, size=canvas, focal_mm=moving[..., -2].exp() if free_focal else focal_mm
        )
        straight, _ = project(at, pattern.points_at(index, theta))
        return photo_from_straight(
            shifted(straight, canvas, seen.photo_size), moving[..., -1, None, None], size=seen.photo_size
        )[0]

    more = [math.log(focal_mm), seen.k1] if free_focal else [seen.k1]
    start = torch.cat([numbers, torch.tensor(more, dtype=torch.float64)])
    prior = torch.zeros(len(start), 2, dtype=torch.float64)
    if free_focal:
        prior[-2, 0], prior[-2, 1] = math.log(evidence.focal_mm), 1 / FOCAL_SPREAD**2
    prior[-1, 1] = 1 / _PRIOR_SPREAD**2
    whiten = torch.eye(2, dtype=torch.float64) / noise[:, None, None]
    moved = robust_fit(
        points_of,
        start,
        targets=targets,
        whiten=whiten,
        weights=weights,
        limits=torch.tensor(steps, dtype=torch.float64),
        prior=prior,
        iterations=15,
    )
    return LensFit(float(moved[-1]), _spread(points_of, moved, targets, noise), len(index))


def find_with_lens(session: Session, search: Search) -> list[Answer]:
    """What `search` finds on the photo freed of its lens, in units of the photo's canvas, the best first.

    A lens that the options state is taken as it is. One that is to be estimated is, from the first answer on
    the photo as it is; then the photo is straightened and searched again until k1 stays. That is kept only
    where the score has gained, and where no lens shows the answers are those on the photo as it is.
    """
    given = session.config.lens
    image = session.evidence.image
    if isinstance(given, float | int):
        seen = straightened(image, given)
        return [_on_photo(seen, answer) for answer in _searched(seen, session, search)[0]]
    plain = found = best = search(session)
    seen, evidence = straightened(image, 0.0), session.evidence
    for _ in range(_ROUNDS):
        if not found or not session.go_on():
            break
        session.tell("estimating the lens", 0.9)
        told = estimated(evidence, seen, found[0])
        if told is None or abs(told.k1 - seen.k1) < _CONVERGED or (best is plain and not told.certain):
            break
        session.record("lens", k1=told.k1, spread=told.spread, objects=told.objects)
        seen = straightened(image, round(max(-_MOST, min(_MOST, told.k1)), _K1_DIGITS))
        found, evidence = _searched(seen, session, search)
        if not found or (best and found[0].score < best[0].score):
            break
        note = f"lens: k1 = {seen.k1:.3f} +- {told.spread:.3f}, from {told.objects} objects"
        best = [dataclasses.replace(_on_photo(seen, one), notes=(*one.notes, note)) for one in found]
    return best


def _on_photo(seen: Straightened, answer: Answer) -> Answer:
    """An answer found on the straightened photo, in units of the photo's canvas, with its k1."""
    focal_mm = None if answer.focal_mm is None else answer.focal_mm * seen.scale
    program = scaled(answer.program, seen.scale)
    return dataclasses.replace(answer, program=program, focal_mm=focal_mm, lens_k1=seen.k1)


def _searched(seen: Straightened, session: Session, search: Search) -> tuple[list[Answer], Evidence]:
    """The answers on a straightened photo, in units of its own canvas, and what was looked at."""
    evidence = seen.looked_at(session.evidence)
    again = dataclasses.replace(session, evidence=evidence)
    found = search(again)
    session.stopped = again.stopped
    return found, evidence


def _spacing_px(where: Frames, matrix: torch.Tensor) -> torch.Tensor:
    """The spacing about each object in pixels [N]: the root of the area that its patch covers."""
    corners = [project(matrix, where.origin + 0.1 * axis)[0] for axis in (where.along, where.across)]
    middle, _ = project(matrix, where.origin)
    a, b = ((corner - middle) / 0.1 for corner in corners)
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).abs().sqrt()


def _spread(
    points_of: Callable[[torch.Tensor], torch.Tensor],
    numbers: torch.Tensor,
    targets: torch.Tensor,
    noise: torch.Tensor,
) -> float:
    """The standard deviation of the last of the fitted numbers, by what is left of the residuals."""
    jacobian = torch.func.jacfwd(points_of)(numbers) / noise[:, None, None]
    left = ((points_of(numbers) - targets) / noise[:, None]).square().sum(1)
    rows = jacobian.reshape(-1, len(numbers))
    scale = rows.norm(dim=0).clamp(min=1e-9)
    normal = (rows / scale).T @ (rows / scale)
    inverse = torch.linalg.pinv(normal + 1e-9 * torch.eye(len(numbers), dtype=rows.dtype))
    # Half the median of a chi-square of two degrees is ln 2: strays do not widen the spread.
    variance = float(left.median()) / (2 * math.log(2))
    return math.sqrt(max(float(inverse[-1, -1]), 0.0) * variance) / float(scale[-1])

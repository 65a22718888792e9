"""The focal that a lattice tells, if its cell is taken as a square, a rectangle, a hexagon or a rhombus.

A photo of one plane fixes the camera up to the focal (section 3.4 of the paper): under each focal the same
vanishing line gives another tilt and an affinely changed plane. What is assumed of the cell picks one of
them. Let d be a step of the lattice in camera coordinates under the assumed focal f0, split into its part
along the picture, d_p, and its depth, z. Under a focal f the step is (s d_p, z) with s = f0 / f, so right
angles and equal lengths are equations a*s^2 + b = 0, with

    right angle     a = d1_p . d2_p           b = z1 z2
    equal lengths   a = |d1_p|^2 - |d2_p|^2   b = z1^2 - z2^2
    60 degrees      a = 2 d1_p . d2_p - |d1_p|^2, b = 2 z1 z2 - z1^2   (where the lengths are equal)

A square and a hexagon fulfil two of them at once, which chance seldom does: that speaks for them.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor

from p3i.grammar.ast import Affine, Program
from p3i.grammar.leaves import with_leaves
from p3i.interp.camera import Camera, project, rotation
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import nest
from p3i.search.answer import Answer
from p3i.search.fit.judged import MOST_JUDGED
from p3i.search.fit.robust import inverse
from p3i.search.forms.filling import ANGLE_DIGITS, LENGTH_DIGITS
from p3i.search.forms.lattice import in_shortest_steps
from p3i.search.look.patches import frames, spacing, whitening
from p3i.search.look.thinned import thinned
from p3i.search.result import FOCAL_REASONS, FocalSource
from p3i.size import Size
from p3i.vision.warp import in_frame

Side = tuple[int, int]
Equation = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]
Shape = Literal["square", "hexagon", "rectangle", "rhombus"]

LEAST_MM, MOST_MM = 15.0, 200.0
"""Focals beyond these are not believed."""
LEAST_SURE = 0.15
"""An estimate less sure than this (its standard deviation, as a share of the focal) is none."""

# How true people build: cells' angles to half a degree, equal sides to a hundredth.
_ANGLE_SLACK = math.radians(0.5)
_LENGTH_SLACK = 0.01
# Two equations agree where they differ by at most so many standard deviations.
_AGREE = 2.0
# ... and that says something only where they could differ: each sure to this (in log s^2), together.
_TELLING = 1.0
# What speaks against a reading of the cell, as -log of its probability: its kind; that the program's own
# steps are not its sides; and focals far from the assumed one, so many e-folds.
_AGAINST: dict[Shape, float] = {"square": 0.0, "hexagon": 0.7, "rectangle": 0.7, "rhombus": 2.5}
_AGAINST_OTHER_STEPS = 0.7
_FOCAL_SPREAD = 0.45
_NOTHING_SEEN = 10.0
# A reading must lead others, that give another focal, by this much.
_LEAD = 1.0
# Sides of cells that a wrong focal may hide: whole combinations of the program's own steps, that first.
_SIDES: tuple[tuple[Side, Side], ...] = (
    ((1, 0), (0, 1)),
    ((1, 0), (1, 1)),
    ((1, 0), (-1, 1)),
    ((1, 1), (0, 1)),
    ((1, -1), (0, 1)),
)
_LEAST_RHOMBUS_DEG = 55.0
# One digit more than an answer has, so that no point moves by a hundredth of a pixel.
_ANGLE_DIGITS, _LENGTH_DIGITS = ANGLE_DIGITS + 1, LENGTH_DIGITS + 1

_TOO_FLAT = "the pattern is seen too nearly straight on, or along one of its directions, to fix it"
_SKEWED = "no focal between 15 and 200 mm makes the cell a rectangle, a hexagon or a rhombus"


@dataclass(frozen=True, slots=True)
class FocalEstimate:
    """The focal (mm) that a pattern tells, how sure it is (a share of it), and what the cell was taken as.

    `focal_mm` is None where the pattern does not fix it. `reason` completes "focal 35 mm, ...".
    """

    focal_mm: float | None
    reason: str
    spread: float = math.inf
    shape: Shape | None = None


@dataclass(frozen=True, slots=True)
class _Reading:
    """One reading of the cell: log f, its standard deviation, and what speaks against it."""

    shape: Shape
    log_focal: float
    spread: float
    against: float


def estimate_focal(program: Program, *, size: Size, focal_mm: float) -> FocalEstimate:
    """The focal that a lattice program on a canvas fixes, where `focal_mm` was assumed when it was fitted."""
    parts = nest(program)
    if parts.for_i is None or parts.for_j is None or not isinstance(parts.draw.x, Affine):
        return FocalEstimate(None, "only a lattice of two directions can fix it so")
    pattern = in_shortest_steps(compile(program))
    covariance = _covariance(pattern, size=size, focal_mm=focal_mm)
    if covariance is None:
        return FocalEstimate(None, _TOO_FLAT)
    readings = list(_readings(pattern, covariance, focal_mm))
    low, high = math.log(LEAST_MM), math.log(MOST_MM)
    within = sorted(
        (one for one in readings if one.spread > LEAST_SURE or low <= one.log_focal <= high),
        key=lambda one: one.against,
    )
    if not within:
        return FocalEstimate(None, _SKEWED)
    best = within[0]
    if best.spread > LEAST_SURE:
        return FocalEstimate(None, _TOO_FLAT)
    for other in within[1:]:
        if other.spread > LEAST_SURE:
            continue
        apart = abs(other.log_focal - best.log_focal)
        if other.against < best.against + _LEAD and apart > max(LEAST_SURE, 3 * best.spread):
            which = " or ".join(f"a {one.shape} ({math.exp(one.log_focal):.0f} mm)" for one in (best, other))
            return FocalEstimate(None, f"the cell may be {which}")
    shares = f"give or take {max(1, round(100 * best.spread))} %"
    reason = f"estimated from the pattern, its cell taken as a {best.shape} ({shares})"
    return FocalEstimate(math.exp(best.log_focal), reason, best.spread, best.shape)


def with_own_focal(answer: Answer, *, size: Size, assumed: tuple[float, FocalSource]) -> Answer:
    """The answer told with the focal that its lattice fixes, or with the reason why it fixes none.

    Answers that have a focal of their own, or a reason for none, and those that are no lattice stay.
    """
    focal_mm, source = assumed
    if answer.structure != "lattice" or answer.focal_mm is not None or answer.focal_reason:
        return answer
    found = estimate_focal(answer.program, size=size, focal_mm=focal_mm)
    if found.focal_mm is None:
        return replace(answer, focal_reason=f"{FOCAL_REASONS[source]}: {found.reason}")
    mm = round(found.focal_mm, 2)
    program = refocused(answer.program, from_mm=focal_mm, to_mm=mm)
    return replace(answer, program=program, focal_mm=mm, focal_reason=found.reason)


def refocused(program: Program, *, from_mm: float, to_mm: float) -> Program:
    """A lattice program fitted under one focal, as another focal tells it: its points in the photo stay.

    Camera and plane change together (`Camera.refocused`, and the affine map of the plane that goes with it;
    the origin, on the optical axis, stays). Raises ValueError for a program that is no lattice: an affine
    map makes ellipses of circles.
    """
    draw = nest(program).draw
    if not (isinstance(draw.x, Affine) and isinstance(draw.y, Affine)):
        raise ValueError("only a lattice can be told with another focal")
    camera = Camera.of(program, focal_mm=from_mm).refocused(to_mm)
    rx_deg, ry_deg = round(camera.rx_deg, _ANGLE_DIGITS), round(camera.ry_deg, _ANGLE_DIGITS)
    # Seen at (R p)_xy / (1 + (R p)_z / f), a point stays where it is if (R p)_xy and (R p)_z / f do; the
    # first fix the change of the plane, the second hold because the vanishing line is the same.
    then = rotation(program.camera.rx_deg, program.camera.ry_deg)[:2, :2]
    change = torch.linalg.solve(rotation(rx_deg, ry_deg)[:2, :2], then).tolist()
    values = {"camera.rx": rx_deg, "camera.ry": ry_deg}
    for name, (a, b) in zip("xy", change, strict=True):
        values |= {
            f"draw.{name}.i": round(a * draw.x.i + b * draw.y.i, _LENGTH_DIGITS),
            f"draw.{name}.j": round(a * draw.x.j + b * draw.y.j, _LENGTH_DIGITS),
            f"draw.{name}.1": round(a * draw.x.constant + b * draw.y.constant, _LENGTH_DIGITS),
        }
    return with_leaves(program, values)


def _readings(pattern: Pattern, covariance: Tensor, focal_mm: float) -> Iterator[_Reading]:
    """Every way to read the cell that some focal makes true."""
    log_assumed = math.log(focal_mm)
    for first, second in _SIDES:
        other_steps = 0.0 if (first, second) == _SIDES[0] else _AGAINST_OTHER_STEPS

        def reading(
            shape: Shape, value: float, spread: float, gain: float = 0.0, extra: float = other_steps
        ) -> _Reading:
            # Where the focal is not seen, it may be the assumed one.
            away = value / 2 / _FOCAL_SPREAD if spread / 2 <= LEAST_SURE else 0.0
            against = _AGAINST[shape] + extra + away * away / 2 - gain
            return _Reading(shape, log_assumed - value / 2, spread / 2, against)

        def solve(equation: Equation, slack: float, sides: tuple[Side, Side]) -> tuple[float, float]:
            return _solved(pattern, covariance, sides=sides, equation=equation, slack=slack)

        sides = first, second
        right = solve(_right_angle, _ANGLE_SLACK, sides)
        equal = solve(_equal_lengths, 2 * _LENGTH_SLACK, sides)
        sixty = solve(_sixty_degrees, _ANGLE_SLACK, sides)
        if math.isfinite(right[1]):
            yield reading("rectangle", *right)
        if math.isfinite(equal[1]) and _angle_deg(pattern, sides, equal[0]) >= _LEAST_RHOMBUS_DEG:
            yield reading("rhombus", *equal)
        square, hexagon = _together(equal, right), _together(equal, sixty)
        if square is not None:
            yield reading("square", *square)
        if hexagon is not None:
            yield reading("hexagon", *hexagon)


def _together(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float, float] | None:
    """Two estimates (value, spread) as one, and how much it says that they agree; None where they do not."""
    if not (math.isfinite(a[1]) and math.isfinite(b[1])):
        return None
    apart, expected = abs(a[0] - b[0]), math.hypot(a[1], b[1])
    if expected > _TELLING or apart > _AGREE * expected:
        return None
    weights = a[1] ** -2, b[1] ** -2
    value = (weights[0] * a[0] + weights[1] * b[0]) / sum(weights)
    # By chance they would differ by about 1: an e-fold of s^2.
    return value, sum(weights) ** -0.5, min(max(-math.log(expected), 0.0), 3.0)


def _solved(
    pattern: Pattern, covariance: Tensor, *, sides: tuple[Side, Side], equation: Equation, slack: float
) -> tuple[float, float]:
    """log s^2 of a*s^2 + b = 0 for two sides of the cell, and its standard deviation; infinite for no root.

    `slack` is how far the true cell may be from what is assumed of it, in the equation's own terms.
    """

    def parts(theta: Tensor) -> Tensor:
        return torch.stack(equation(*(_direction(pattern, theta, side) for side in sides)))

    a, b = parts(pattern.theta).tolist()
    gradient = torch.func.jacfwd(parts)(pattern.theta)

    def noise(squared: float) -> float:
        slope = gradient[0] * squared + gradient[1]  # of a*s^2 + b over theta
        ends = (_direction(pattern, pattern.theta, side) for side in sides)
        lengths = [float(squared * d[:2] @ d[:2] + d[2] ** 2) for d in ends]
        built = slack * math.sqrt(lengths[0] * lengths[1])
        return math.hypot(math.sqrt(max(float(slope @ covariance @ slope), 0.0)), built)

    if a * b < 0:
        squared = -b / a
        return math.log(squared), noise(squared) / abs(b)
    # Without a root it may still be true, where nothing of it is seen.
    return (0.0, _NOTHING_SEEN) if abs(a + b) < _AGREE * noise(1.0) else (0.0, math.inf)


def _direction(pattern: Pattern, theta: Tensor, side: Side) -> Tensor:
    """A side of the cell, i steps of i and j of j, in camera coordinates [3], in program units."""
    ends = torch.tensor([[0, 0], side])
    start, end = pattern.points_at(ends, theta)
    rx_deg, ry_deg = (theta[pattern.paths.index(path)] for path in ("camera.rx", "camera.ry"))
    return rotation(rx_deg, ry_deg)[:, :2] @ (end - start)


def _right_angle(d: Tensor, e: Tensor) -> tuple[Tensor, Tensor]:
    return d[:2] @ e[:2], d[2] * e[2]


def _equal_lengths(d: Tensor, e: Tensor) -> tuple[Tensor, Tensor]:
    return d[:2] @ d[:2] - e[:2] @ e[:2], d[2] ** 2 - e[2] ** 2


def _sixty_degrees(d: Tensor, e: Tensor) -> tuple[Tensor, Tensor]:
    # Either side may point the other way; 120 degrees are 60 to the next side.
    turn = 1.0 if float(d @ e) >= 0 else -1.0
    return 2 * turn * (d[:2] @ e[:2]) - d[:2] @ d[:2], 2 * turn * d[2] * e[2] - d[2] ** 2


def _angle_deg(pattern: Pattern, sides: tuple[Side, Side], log_squared: float) -> float:
    """The angle between two sides under the focal with this log s^2, at most 90."""
    scale = torch.tensor([1.0, 1.0, math.exp(-log_squared / 2)], dtype=torch.float64)
    d, e = (scale * _direction(pattern, pattern.theta, side) for side in sides)
    return math.degrees(math.acos(min(1.0, abs(float(d @ e)) / float(d.norm() * e.norm()))))


def _covariance(pattern: Pattern, *, size: Size, focal_mm: float) -> Tensor | None:
    """How surely the photo fixes the numbers theta of a fit: [P, P]; None where it does not.

    From the objects in sight, each taken to lie where it was found to within the noise of places.
    """
    points, in_front = pattern.centers_px(size=size, focal_mm=focal_mm)
    seen = in_front & in_frame(points, size)
    index = pattern.index[seen]
    if len(index) < 4:
        return None
    index, theta = index[thinned(index, MOST_JUDGED)].double(), pattern.theta

    def pixels(theta: Tensor) -> Tensor:
        matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
        return project(matrix, pattern.points_at(index, theta))[0]

    matrix = pattern.image_from_plane(theta, size=size, focal_mm=focal_mm)
    whiten = whitening(matrix, frames(pattern, theta, index, side=spacing(pattern, theta)))
    rows = (whiten @ torch.func.jacfwd(pixels)(theta)).reshape(-1, len(theta))
    return inverse(rows.T @ rows)

"""What a hole may be where nobody says: a range, and how finely it is looked through, by its place.

Lengths are program units, angles degrees. docs/search.md lists the ranges.
"""

from dataclasses import dataclass

CELL_UNITS = 2.0
"""The coarse grid's cell for lengths, in program units: the paper's grid size."""
CELL_CAMERA_DEG = 10.0
"""The coarse grid's cell for the camera's angles."""

_MOST_TILT_DEG = 60.0
_LEAST_TURN_DEG = 4.0
_MOST_STEP = 40.0
_LEAST_COUNT, _MOST_COUNT = 2, 24
_DIVISORS = (3, 36)
# How far from its start `~x` may go in the coarse search: degrees, and a share of itself.
_AROUND_DEG, _AROUND_SHARE = 8.0, 0.08


@dataclass(frozen=True, slots=True)
class Range:
    """From `lower` to `upper`, looked through in steps of `cell`.

    `relative`: evenly in the logarithm, so that the cell is a share. `turns`: an angle that comes round.
    """

    lower: float
    upper: float
    cell: float
    relative: bool = False
    turns: bool = False


def default_range(
    path: str,
    *,
    whole: bool,
    divides: bool,
    start: float | None,
    canvas: tuple[float, float],
) -> Range:
    """The range of a hole at `path` (grammar/leaves.py) on a canvas of (width, height) program units."""
    kind, _, variable = path.rpartition(".")
    if whole:
        return _whole(kind, variable, divides=divides, start=start)
    found = _real(kind, path, variable, canvas)
    if start is None:
        return found
    if path.startswith("camera.") or found.turns:
        reach = _AROUND_DEG
    else:
        reach = max(CELL_UNITS if variable == "1" else 0.02, _AROUND_SHARE * abs(start))
    return Range(start - reach, start + reach, min(found.cell, reach), turns=found.turns)


def _whole(kind: str, variable: str, *, divides: bool, start: float | None) -> Range:
    if start is not None:
        least = 1 if divides else -float("inf")
        return Range(max(least, start - 1), start + 1, 1)
    if divides:
        return Range(*_DIVISORS, 1)
    if kind.startswith("if_"):
        return Range(-1, 1, 1) if variable != "1" else Range(-8, 8, 1)
    if kind.endswith(".start"):
        return Range(-8, 0, 1) if variable == "1" else Range(-2, 2, 1)
    return Range(_LEAST_COUNT, _MOST_COUNT, 1) if variable == "1" else Range(1, 8, 1)


def _real(kind: str, path: str, variable: str, canvas: tuple[float, float]) -> Range:
    if path.startswith("camera."):
        return Range(-_MOST_TILT_DEG, _MOST_TILT_DEG, CELL_CAMERA_DEG)
    if kind.endswith(".angle"):
        if variable == "1":
            return Range(0, 360, 15, turns=True)
        return Range(_LEAST_TURN_DEG, 120, 2, relative=True)
    half = canvas[0] / 2 if path.startswith("draw.x") else canvas[1] / 2
    if kind.endswith(".radius"):
        if variable == "1":
            return Range(CELL_UNITS, max(canvas) * 0.6, CELL_UNITS, relative=True)
        return Range(-_MOST_STEP / 4, _MOST_STEP / 2, CELL_UNITS / 2)
    if variable == "1":
        return Range(-half, half, CELL_UNITS)
    return Range(-_MOST_STEP, _MOST_STEP, CELL_UNITS)

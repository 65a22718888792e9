"""Whether two lattices are the same, or one a multiple of the other."""

import numpy as np

from p3i.search.fit.fitted import Fit
from p3i.search.fit.fitting import certain
from p3i.search.forms.guess import Guess
from p3i.search.forms.lattice import Lattice, map_from_index
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.evidence import Evidence

# Guesses of several rings are one where their radii differ by less than this share of the growth.
_SAME_GROWTH = 0.1


def says_already(evidence: Evidence, own: Guess, fit: Fit, guess: Guess) -> bool:
    """Whether a fit, which began with its `own` guess, says what another guess is about to.

    A lattice is said where it is the fit's, or a part or a multiple of it; of other forms, guesses are alike
    but for small differences that a fit takes away.
    """
    if guess.base is not None:
        return _alike(own, guess)
    if guess.filling is not fit.filling or not certain(fit):
        return False  # another start may do better
    level, pattern = evidence.frame, fit.pattern
    wide = guess.theta
    ours, theirs = (map_from_index(level, pattern, theta) for theta in (fit.theta, wide))
    if not guess.local:
        at = level.map_from_plane(pattern, fit.theta).numpy() @ [*Lattice.of(pattern, fit.theta).origin, 1.0]
    else:
        at = level.map_from_plane(pattern, wide).numpy() @ [*guess.lattice.origin, 1.0]
        cell = np.linalg.inv(ours) @ (at / at[2])
        away = (fit.index[fit.support].numpy() - cell[:2] / cell[2]).astype(float)
        if len(away) == 0 or np.abs(away).max(1).min() > 1.0:
            return False
    point = at[:2] / at[2]
    return _one_divides_the_other(ours, theirs, point)


def same_lattice(evidence: Evidence, fit: Fit, other: Fit) -> bool:
    """Whether two fits mean one lattice, neither of them a multiple of the other."""
    if fit.filling is not lattice_filling() or other.filling is not fit.filling:
        return False
    ours, theirs = (map_from_index(evidence.frame, one.pattern, one.theta) for one in (fit, other))
    at = ours @ [*fit.index[fit.support].median(0).values.tolist(), 1.0]
    first, second = (_steps_at(one, at[:2] / at[2]) for one in (ours, theirs))
    return _whole_multiple(first, second) and _whole_multiple(second, first)


def _one_divides_the_other(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> bool:
    """Whether, at a map point, one lattice (index -> map) is a part of the other, or the same."""
    a, b = _steps_at(a, point), _steps_at(b, point)
    return _whole_multiple(a, b) or _whole_multiple(b, a)


def _steps_at(matrix: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The steps of i and j in map pixels (as columns) at a map point, under index -> map `matrix`."""
    back = np.linalg.inv(matrix) @ [*point, 1.0]
    depth = matrix[2] @ (back / back[2])
    return (matrix[:2, :2] - np.outer(point, matrix[2, :2])) / depth


def _whole_multiple(steps: np.ndarray, of: np.ndarray) -> bool:
    """Whether the steps (columns) are whole combinations of others, to within a seventh of a step."""
    ratio = np.linalg.solve(of, steps)
    whole = np.round(ratio)
    return bool(np.abs(ratio - whole).max() < 0.15 and abs(np.linalg.det(whole)) >= 0.5)


def _alike(first: Guess, second: Guess) -> bool:
    """Whether two guesses write the same sketch, with radii that differ by little of their growth."""
    if first.filling.sketch != second.filling.sketch:
        return False
    ours, theirs = (one.filling.named(one.z) for one in (first, second))
    names = ("draw.x.radius.i", "draw.x.radius.1")
    apart = sum(abs(ours[name] - theirs[name]) for name in names if name in ours)
    return apart < _SAME_GROWTH * theirs.get("draw.x.radius.i", 0.0)

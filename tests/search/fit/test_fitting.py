"""The fit of a guess: what its cells save tells right ones from wrong ones, and multiples from the cell."""

from functools import cache

import numpy as np
import pytest
from truth import evidence_of, lattice_of, small_scene, turned

from p3i.search.config import SearchConfig
from p3i.search.fit.fitted import Fit
from p3i.search.fit.fitting import certain, fit_places, holds, worth
from p3i.search.fit.same import same_lattice
from p3i.search.forms.guess import lattice_guess
from p3i.search.forms.lattice import Lattice
from p3i.search.look.session import Session

CELL, DOUBLE, SHEARED = ((1.0, 0.0), (0.0, 1.0)), ((2.0, 0.0), (0.0, 1.0)), ((1.0, 1.0), (0.0, 1.0))
WRONG = ((1.37, 0.0), (0.0, 1.37))


@cache
def fit_of(seed: int, rows: tuple[tuple[float, float], ...]) -> Fit | None:
    """The fit that begins near the true pose of a scene, its basis these `rows` of the true one."""
    scene = small_scene(seed)
    truth = lattice_of(scene.program).moved_to(np.round(np.median(scene.index, axis=0)))
    start = Lattice(truth.rx_deg, truth.ry_deg, np.array(rows) @ truth.basis, truth.origin)
    look = Session(evidence_of(scene), SearchConfig())
    return fit_places(look, lattice_guess(turned(start, rx_deg=2), 1.0, local=False))


@pytest.mark.parametrize("seed", [14, 18])
def test_a_right_fit_saves_bits_and_is_certain_and_a_wrong_one_is_not_worth_drawing(seed: int) -> None:
    right, wrong = fit_of(seed, CELL), fit_of(seed, WRONG)
    assert right is not None
    guess = lattice_guess(lattice_of(small_scene(seed).program), 1.0, local=False)
    assert worth(right) == right.bits > 100
    assert certain(right) and holds(right, guess)
    assert wrong is None or (worth(wrong) < 0.1 * worth(right) and not certain(wrong))


@pytest.mark.parametrize("seed", [14, 18])
def test_a_multiple_is_another_lattice_and_another_basis_is_not(seed: int) -> None:
    look = evidence_of(small_scene(seed))
    cell, sheared, double = (fit_of(seed, rows) for rows in (CELL, SHEARED, DOUBLE))
    assert cell is not None and sheared is not None and double is not None
    assert same_lattice(look, cell, sheared) and same_lattice(look, sheared, cell)
    assert not same_lattice(look, cell, double) and not same_lattice(look, double, cell)

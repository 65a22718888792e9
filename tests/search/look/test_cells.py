"""Cells read off a feature map and compared: against loops, and within the bounds that a score needs."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from truth import PATTERN, blank_level, evidence_of, index_in, lattice_of, small_scene, true_theta

from p3i.search.forms.lattice import Lattice
from p3i.search.look.cells import (
    Cells,
    agreement,
    agreement_with_others,
    contrast,
    mean_cell,
    read_cells,
    sample_grid,
)

features = arrays(np.float32, (3, 5, 2), elements=st.floats(-4, 4, width=32))
masks = arrays(np.bool_, (3, 5))


def tensors(*given: np.ndarray) -> list[torch.Tensor]:
    return [torch.from_numpy(one) for one in given]


@settings(max_examples=60, deadline=None)
@given(features, features, masks)
def test_agreement_lies_between_minus_one_and_one_and_is_mutual(a, b, known) -> None:
    first, second, mask = tensors(a, b, known)
    value = agreement(first, second, mask)
    assert value.shape == (3,)
    assert bool((value.abs() <= 1 + 1e-5).all())
    torch.testing.assert_close(value, agreement(second, first, mask))


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 10))
def test_a_fainter_copy_agrees_less(factor: float) -> None:
    cell = torch.randn(1, 8, 3, generator=torch.Generator().manual_seed(0))
    value = float(agreement(cell, factor * cell, torch.ones(1, 8, dtype=torch.bool)))
    assert value == pytest.approx(2 * factor / (1 + factor**2), abs=1e-5)
    assert float(agreement(cell, -cell, torch.ones(1, 8, dtype=torch.bool))) == pytest.approx(-1)


def test_unknown_samples_have_no_say_in_agreement() -> None:
    cell = torch.randn(1, 8, 3, generator=torch.Generator().manual_seed(0))
    other, known = cell.clone(), torch.ones(1, 8, dtype=torch.bool)
    other[:, 5:] = 9
    known[:, 5:] = False
    assert float(agreement(cell, other, known)) == pytest.approx(1)


def random_cells(seed: int = 0) -> Cells:
    generator = torch.Generator().manual_seed(seed)
    values, known = torch.randn(6, 9, 2, generator=generator), torch.rand(6, 9, generator=generator) > 0.2
    return Cells(values * known[..., None], known)


def test_each_cell_is_compared_with_the_mean_of_all_the_others() -> None:
    cells, weights = random_cells(), torch.tensor([1.0, 0.5, 2.0, 0.0, 1.0, 0.3])
    found = agreement_with_others(cells, weights)
    for own in range(6):
        above = below = 0.0
        for sample in range(9):
            if not cells.known[own, sample]:
                continue
            total = sum(float(weights[n]) for n in range(6) if n != own and cells.known[n, sample])
            for channel in range(2):
                here = float(cells.values[own, sample, channel])
                others = [
                    float(weights[n] * cells.values[n, sample, channel])
                    for n in range(6)
                    if n != own and cells.known[n, sample]
                ]
                there = sum(others) / total
                above += 2 * here * there
                below += here**2 + there**2
        assert float(found[own]) == pytest.approx(above / below, abs=1e-4)


def test_a_cell_without_weight_has_no_say_in_the_mean() -> None:
    cells = random_cells()
    weights = torch.ones(6)
    weights[2] = 0
    mean, total = mean_cell(cells, weights)
    cells.values[2] = 100
    again, _ = mean_cell(cells, weights)
    torch.testing.assert_close(mean, again)
    rest = [n for n in range(6) if n != 2]
    torch.testing.assert_close(total, cells.known[rest].float().sum(0))


@pytest.mark.parametrize("side", [1, 4, 7])
def test_the_samples_sweep_a_cell_evenly(side: int) -> None:
    grid = sample_grid(side)
    assert grid.shape == (side * side, 2)
    assert float(grid.abs().max()) < 0.5
    torch.testing.assert_close(grid.mean(0), torch.zeros(2, dtype=torch.float64))
    assert len({tuple(row) for row in grid.tolist()}) == side * side


def test_cells_beyond_the_picture_or_behind_the_camera_are_unknown() -> None:
    level = blank_level()
    lattice = Lattice(-60.0, 0.0, np.array([[5.0, 0.0], [0.0, 5.0]]), np.zeros(2))
    index = torch.tensor([[0.0, 0.0], [-80.0, 0.0], [0.0, -80.0], [0.0, 80.0]], dtype=torch.float64)
    cells = read_cells(level, PATTERN, lattice.theta(PATTERN), index, sample_grid(3))
    assert cells.known.all(1).tolist() == [True, False, False, False]
    assert not cells.known[1:].any()


def test_the_true_cells_predict_each_other_and_those_of_a_wrong_lattice_do_not() -> None:
    scene = small_scene(14)
    level = evidence_of(scene).level_for(30.0)
    truth = lattice_of(scene.program).moved_to(np.round(np.median(scene.index, axis=0)))
    index = index_in(scene)

    def mean_contrast(lattice: Lattice) -> float:
        theta, weights, grid = lattice.theta(PATTERN), torch.ones(len(index)), sample_grid(6)
        once = contrast(level, PATTERN, theta, index, weights=weights, grid=grid, rounds=1)
        whole = agreement_with_others(read_cells(level, PATTERN, theta, index, grid), weights)
        assert bool((once <= whole + 1e-6).all())
        return float(contrast(level, PATTERN, theta, index, weights=weights, grid=grid).mean())

    assert mean_contrast(Lattice.of(PATTERN, true_theta(scene))) > 0.5
    # Twice the step: a half step of it is a whole one of the pattern, so nothing is left of the agreement.
    for factors in ([[2, 0], [0, 1]], [[1, 0], [0, 2]], [[1, 1], [1, -1]]):
        assert mean_contrast(truth.with_basis(np.array(factors) @ truth.basis)) < 0.15
    assert mean_contrast(truth.with_basis(truth.basis * 1.37)) < 0.15

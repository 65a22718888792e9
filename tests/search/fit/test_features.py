"""Gauss-Newton on all cells at once: from a few degrees off back to the truth."""

import numpy as np
import pytest
import torch
from truth import (
    PATTERN,
    evidence_of,
    index_in,
    lattice_error,
    pose_error_deg,
    small_scene,
    true_theta,
    turned,
)

from p3i.search.fit.features import refine
from p3i.search.fit.robust import step_limits
from p3i.search.forms.lattice import PHASE, Lattice, cell_px


@pytest.mark.parametrize(
    ("rx_deg", "ry_deg", "scale"), [(2.5, 0.0, 1.0), (-1.5, 2.0, 1.0), (0.0, 0.0, 1.02), (1.5, -1.5, 0.985)]
)
def test_a_few_degrees_and_percent_are_taken_back(rx_deg: float, ry_deg: float, scale: float) -> None:
    scene = small_scene(16)
    truth = Lattice.of(PATTERN, true_theta(scene))
    start = turned(truth, rx_deg=rx_deg, ry_deg=ry_deg, scale=scale)
    evidence, theta = evidence_of(scene), start.theta(PATTERN)
    level = evidence.level_for(cell_px(evidence.level(320, blur=0.5), PATTERN, theta))
    index = index_in(scene)
    index = index[index.abs().amax(1) <= 3]
    found = refine(
        level, PATTERN, theta, index=index, weights=torch.ones(len(index)), fixed=PHASE, iterations=12
    )
    lattice = Lattice.of(PATTERN, found)
    assert pose_error_deg(lattice, truth) < 0.7
    assert lattice_error(lattice.basis, truth.basis) < 0.01
    assert np.array_equal(lattice.origin, truth.origin), "the phase stays where it is fixed"


def test_what_is_fixed_stays_to_the_last_digit() -> None:
    scene = small_scene(16)
    theta = turned(Lattice.of(PATTERN, true_theta(scene)), rx_deg=2).theta(PATTERN)
    fixed = PHASE | {"camera.rx", "draw.y.j"}
    index = index_in(scene)[:20]
    found = refine(
        evidence_of(scene).level_for(30.0),
        PATTERN,
        theta,
        index=index,
        weights=torch.ones(len(index)),
        fixed=fixed,
    )
    moved = {path for path, a, b in zip(PATTERN.paths, theta, found, strict=True) if a != b}
    assert moved == set(PATTERN.paths) - fixed


def test_cells_without_weight_do_not_pull() -> None:
    scene = small_scene(16)
    theta = turned(Lattice.of(PATTERN, true_theta(scene)), rx_deg=1).theta(PATTERN)
    index = index_in(scene)
    near = index.abs().amax(1) <= 2
    level = evidence_of(scene).level_for(30.0)
    alone = refine(level, PATTERN, theta, index=index[near], weights=torch.ones(int(near.sum())), fixed=PHASE)
    beside = refine(level, PATTERN, theta, index=index, weights=near.float(), fixed=PHASE)
    torch.testing.assert_close(alone, beside, rtol=0, atol=2e-3)


def test_every_number_but_the_fixed_may_move_and_zeros_too() -> None:
    theta = Lattice(10.0, 0.0, np.array([[8.0, 0.0], [0.0, 12.0]]), np.array([90.0, 0.0])).theta(PATTERN)
    limits = dict(zip(PATTERN.paths, step_limits(PATTERN, theta, fixed=PHASE).tolist(), strict=True))
    assert {path for path, limit in limits.items() if limit > 0} == set(PATTERN.paths) - PHASE
    # A zero may move as far as the other number of its loop, and a constant as far as the longer step.
    assert limits["draw.y.i"] == limits["draw.x.i"] < limits["draw.x.j"] == limits["draw.y.j"]
    everything = step_limits(PATTERN, theta)
    assert float(everything[PATTERN.paths.index("draw.x.1")]) == limits["draw.x.j"]

"""Growth: from a rough proposal to the whole pattern, and nothing where there is nothing."""

import cv2
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

from p3i.search.config import SearchConfig
from p3i.search.fit.grow import grow, measure, sane, side_of_cell
from p3i.search.forms.guess import lattice_guess
from p3i.search.forms.lattice import Lattice
from p3i.search.look.evidence import Evidence
from p3i.vision.image import Image


def grown(lattice: Lattice, evidence: Evidence):
    guess = lattice_guess(lattice, 1.0, local=False)
    return grow(evidence, guess)


@pytest.mark.parametrize(("rx_deg", "ry_deg", "scale"), [(4.0, -3.0, 1.0), (-3.0, 4.0, 1.02)])
def test_a_proposal_some_degrees_off_grows_to_the_whole_pattern(
    rx_deg: float, ry_deg: float, scale: float
) -> None:
    scene = small_scene(16)
    truth = Lattice.of(PATTERN, true_theta(scene))
    fit = grown(turned(truth, rx_deg=rx_deg, ry_deg=ry_deg, scale=scale), evidence_of(scene))
    assert fit is not None
    found = Lattice.of(PATTERN, fit.theta)
    assert pose_error_deg(found, truth) < 1
    assert lattice_error(found.basis, truth.basis) < 0.02
    assert int(fit.support.sum()) > 0.75 * len(scene.index)
    # Its score is a share of the picture: less than what the true objects' hull takes of it.
    hull = cv2.contourArea(cv2.convexHull(scene.centers_px.astype(np.float32)))
    assert 0.1 * hull < fit.covered * scene.size.width * scene.size.height < 2 * hull


def test_growing_twice_is_the_same_to_the_last_digit() -> None:
    scene = small_scene(16)
    start = turned(Lattice.of(PATTERN, true_theta(scene)), rx_deg=2.0)
    first, again = (grown(start, evidence_of(scene)) for _ in range(2))
    assert first is not None and again is not None
    assert torch.equal(first.theta, again.theta) and first.covered == again.covered


def test_the_truth_explains_more_than_what_is_beside_it() -> None:
    scene = small_scene(16)
    evidence, truth = evidence_of(scene), Lattice.of(PATTERN, true_theta(scene))

    def score(lattice: Lattice) -> float:
        theta = lattice.theta(PATTERN)
        level = evidence.level_for(side_of_cell(evidence, PATTERN, theta))
        fit = measure(level, PATTERN, theta, start=index_in(scene))
        return 0.0 if fit is None else fit.covered

    best = score(truth)
    assert best > 0.1
    for pose in (turned(truth, rx_deg=6.0), turned(truth, ry_deg=-6.0)):
        assert score(pose) < 0.9 * best
    double = truth.with_basis(np.array([[2.0, 0.0], [0.0, 1.0]]) @ truth.basis)
    for other in (double, truth.with_basis(truth.basis / 2), turned(truth, scale=1.1)):
        assert score(other) < 0.4 * best


def test_nothing_grows_on_a_smooth_picture() -> None:
    y, x = np.mgrid[0:240, 0:320] / 320
    pixels = np.stack([0.2 + 0.5 * y, 0.7 - 0.4 * x, 0.3 + 0.2 * (x + y)], -1).astype(np.float32)
    evidence = Evidence(Image(pixels, np.ones((240, 320), bool)), SearchConfig(), 35.0)
    fit = grown(Lattice(20.0, 5.0, np.eye(2) * 9, np.zeros(2)), evidence)
    assert fit is None


def test_fewer_than_four_cells_in_view_are_not_measured() -> None:
    scene = small_scene(16)
    huge = Lattice(0.0, 0.0, np.eye(2) * 60, np.zeros(2)).theta(PATTERN)
    assert measure(evidence_of(scene).level_for(100.0), PATTERN, huge) is None


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, True),
        ({"camera.rx": 89.0}, False),
        ({"camera.ry": -86.0}, False),
        ({"draw.x.i": float("nan")}, False),
        ({"draw.y.1": float("inf")}, False),
        ({"draw.x.i": 1e-3, "draw.y.i": 0.0}, False),
    ],
)
def test_numbers_that_mean_no_lattice_are_told(change: dict[str, float], expected: bool) -> None:
    theta = Lattice(30.0, -10.0, np.diag([8.0, 0.5]), np.zeros(2)).theta(PATTERN)
    for path, value in change.items():
        theta[PATTERN.paths.index(path)] = value
    assert sane(PATTERN, theta) is expected

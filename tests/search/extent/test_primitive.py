"""The primitive cell: a multiple comes back to the true cell, a part of a chequered floor to the whole."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
from truth import PATTERN, evidence_of, index_in, lattice_error, lattice_of, small_scene, true_theta

from p3i.interp.camera import image_from_plane
from p3i.search.config import SearchConfig
from p3i.search.extent.primitive import _Ground, _likeness, _told, primitive
from p3i.search.fit.fitted import Fit
from p3i.search.fit.grow import measure, side_of_cell
from p3i.search.forms.lattice import Lattice
from p3i.search.look.evidence import Evidence
from p3i.size import Size
from p3i.vision.image import Image


def fit_of(evidence: Evidence, lattice: Lattice) -> Fit:
    """A fit whose ground is given, not measured: all cells in view."""
    theta = lattice.theta(PATTERN)
    fit = measure(evidence.level_for(side_of_cell(evidence, PATTERN, theta)), PATTERN, theta)
    assert fit is not None
    return replace(fit, contrast=torch.ones(len(fit.index)))


@pytest.mark.parametrize("seed", [1, 14, 18])
def test_the_true_cell_is_its_own(seed: int) -> None:
    scene = small_scene(seed)
    evidence = evidence_of(scene)
    lattice = lattice_of(scene.program).moved_to(np.round(np.median(scene.index, axis=0)))
    theta = lattice.reduced().theta(PATTERN)
    fit = measure(evidence.level_for(side_of_cell(evidence, PATTERN, theta)), PATTERN, theta)
    assert fit is not None and int(fit.support.sum()) > 10
    [(found, index)] = primitive(evidence, PATTERN, fit)
    assert torch.equal(found, theta) and torch.equal(index, fit.index[fit.support])


SIDE = 6.0
"""A square of the chequered floor, in program units."""


def chequered_floor(*, without_rule: bool = False) -> tuple[Evidence, Lattice]:
    """A floor of light and dark squares under a tilted camera, and the lattice of its single squares.

    `without_rule` a quarter of the squares are dark, chosen at random.
    """
    size = Size(448, 336)
    lattice = Lattice(-35.0, 10.0, np.eye(2) * SIDE, np.array([1.0, 2.0]))
    scale = 3
    x, y = np.meshgrid(np.arange(size.width * scale), np.arange(size.height * scale))
    photo = np.stack([(x.ravel() + 0.5) / scale - 0.5, (y.ravel() + 0.5) / scale - 0.5, np.ones(x.size)])
    matrix = image_from_plane(lattice.rx_deg, lattice.ry_deg, size=size, focal_mm=35.0).numpy()
    plane = np.linalg.inv(matrix) @ photo
    cell = (plane[:2] / plane[2]).T - lattice.origin
    i, j = np.round(cell / SIDE).astype(int).T
    dark = (i + j) % 2 == 0
    if without_rule:
        dark = np.random.default_rng(7).random((200, 200))[i % 200, j % 200] < 0.25
    grey = np.where(dark, 0.3, 0.75).reshape(x.shape).astype(np.float32)
    grey = cv2.resize(grey, (size.width, size.height), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0, 0.015, (size.height, size.width, 3))
    pixels = (grey[:, :, None] + noise).clip(0, 1).astype(np.float32)
    return Evidence(Image(pixels, np.ones(pixels.shape[:2], bool)), SearchConfig(), 35.0), lattice


def test_a_square_of_a_chequered_floor_is_half_a_cell() -> None:
    evidence, squares = chequered_floor()
    [(theta, index)] = primitive(evidence, PATTERN, fit_of(evidence, squares))
    full = np.array([[1, 1], [1, -1]]) @ squares.basis
    assert lattice_error(Lattice.of(PATTERN, theta).basis, full) < 1e-6
    # Every second square is left: the ones of one colour, counted in the new steps.
    points = PATTERN.points_at(index, theta).numpy() - squares.origin
    assert set((np.round(points / SIDE).sum(1) % 2).tolist()) == {0.0}


@pytest.mark.parametrize("colour", [0, 1])
def test_a_chequered_floor_of_which_one_colour_is_mostly_covered_is_one_all_the_same(colour: int) -> None:
    evidence, squares = chequered_floor()
    fit = fit_of(evidence, squares)
    kind = fit.index.sum(1) % 2 == colour
    seen = ~kind | (torch.arange(len(kind)) % 4 == 0)
    [(theta, _)] = primitive(
        evidence, PATTERN, replace(fit, index=fit.index[seen], contrast=fit.contrast[seen])
    )
    full = np.array([[1, 1], [1, -1]]) @ squares.basis
    assert lattice_error(Lattice.of(PATTERN, theta).basis, full) < 1e-6


def told_of(ground: Fit, evidence: Evidence) -> bool:
    index = ground.index[ground.support]
    coset = (index.sum(1) % 2).numpy().astype(int)
    return _told(evidence, PATTERN, _Ground(ground.theta, index), coset)


def test_squares_know_their_kind_on_a_chequered_floor_and_do_not_where_colours_have_no_rule() -> None:
    for without_rule in (False, True):
        evidence, squares = chequered_floor(without_rule=without_rule)
        assert told_of(fit_of(evidence, squares), evidence) is not without_rule


def test_of_a_few_squares_the_kind_is_not_known() -> None:
    evidence, squares = chequered_floor()
    fit = fit_of(evidence, squares)
    middle = fit.index.median(0).values
    near = ((fit.index - middle).abs() <= 1).all(1)
    few = replace(fit, index=fit.index[near], contrast=fit.contrast[near])
    assert len(few.index) == 9 and told_of(fit, evidence) and not told_of(few, evidence)
    assert len(primitive(evidence, PATTERN, few)) == 2


def test_the_full_cell_of_a_chequered_floor_stays() -> None:
    evidence, squares = chequered_floor()
    full = squares.with_basis(np.array([[1.0, 1.0], [-1.0, 1.0]]) @ squares.basis)
    [(theta, _)] = primitive(evidence, PATTERN, fit_of(evidence, full))
    assert lattice_error(Lattice.of(PATTERN, theta).basis, full.basis) < 1e-6


def test_too_few_cells_say_nothing() -> None:
    scene = small_scene(16)
    fit = fit_of(evidence_of(scene), Lattice.of(PATTERN, true_theta(scene)))
    few = replace(fit, index=fit.index[:3], contrast=fit.contrast[:3])
    [(theta, index)] = primitive(evidence_of(scene), PATTERN, few)
    assert torch.equal(theta, few.theta) and len(index) == 3


def test_cells_of_a_single_coset_tell_nothing_apart() -> None:
    scene = small_scene(16)
    fit = fit_of(evidence_of(scene), Lattice.of(PATTERN, true_theta(scene)))
    ground = _Ground(fit.theta, index_in(scene))
    assert _likeness(evidence_of(scene), PATTERN, ground, np.zeros(len(ground.index), int)) == 1.0

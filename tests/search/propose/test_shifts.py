"""All shifts at once: against the sum that defines them, and the lattice that the peaks span."""

import itertools

import cv2
import numpy as np
import pytest

from p3i.search.forms.lattice import reduce_basis
from p3i.search.propose.shifts import (
    Autocorrelation,
    _divided,
    _saved_bits,
    autocorrelation,
    best_pair,
    valley_contrast,
)


def view_of(seed: int, *, height: int = 20, width: int = 24, channels: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(height, width, channels)).astype(np.float32)


def weights_of(seed: int, *, height: int = 20, width: int = 24) -> np.ndarray:
    random = np.random.default_rng(100 + seed)
    weights = random.uniform(0, 1, (height, width))
    weights[random.uniform(size=weights.shape) < 0.2] = 0
    return weights.astype(np.float32)


def naive(view: np.ndarray, weights: np.ndarray, dx: int, dy: int) -> float:
    """2 sum w w' F.F' / sum w w' (|F|^2 + |F'|^2), pixel by pixel."""
    height, width = weights.shape
    above = below = 0.0
    for y, x in itertools.product(range(height), range(width)):
        if not (0 <= y + dy < height and 0 <= x + dx < width):
            continue
        both = float(weights[y, x]) * float(weights[y + dy, x + dx])
        here, there = view[y, x].astype(float), view[y + dy, x + dx].astype(float)
        above += 2 * both * float(here @ there)
        below += both * float(here @ here + there @ there)
    return above / below


def at(found: Autocorrelation, dx: int, dy: int) -> tuple[float, bool]:
    middle = found.values.shape[0] // 2
    return float(found.values[middle + dy, middle + dx]), bool(found.judged[middle + dy, middle + dx])


@pytest.mark.parametrize("seed", range(3))
def test_every_shift_up_to_half_the_view_is_the_naive_sum(seed: int) -> None:
    view, weights = view_of(seed), weights_of(seed)
    found = autocorrelation(view, weights)
    judged = 0
    for dx, dy in itertools.product(range(-11, 12, 3), range(-9, 10, 3)):
        value, looked_at = at(found, dx, dy)
        judged += looked_at
        assert value == pytest.approx(naive(view, weights, dx, dy) if looked_at else -1, abs=2e-5)
    assert judged > 30


def test_shifts_that_leave_too_little_overlap_are_not_judged() -> None:
    weights = np.zeros((20, 24), np.float32)
    weights[:, :6] = 1
    found = autocorrelation(view_of(0), weights)
    assert at(found, 1, 0)[1]
    assert at(found, 8, 0) == (-1.0, False)


def test_what_has_no_weight_has_no_say() -> None:
    view, weights = view_of(1), weights_of(1)
    other = view.copy()
    other[weights == 0] = 50
    found, again = autocorrelation(view, weights), autocorrelation(other, weights)
    np.testing.assert_allclose(found.values, again.values, atol=1e-4)


def test_a_picture_equals_itself_and_its_mirror_image_in_the_shift() -> None:
    found = autocorrelation(view_of(2), weights_of(2))
    assert at(found, 0, 0)[0] == pytest.approx(1, abs=1e-5)
    for dx, dy in ((3, 5), (-7, 2), (0, 9)):
        assert at(found, dx, dy)[0] == pytest.approx(at(found, -dx, -dy)[0], abs=1e-5)


def dots(basis: np.ndarray, *, side: int = 128) -> np.ndarray:
    """Dots on a lattice, less the local mean: a view [S, S, 1].

    The steps grow by a twentieth across the view, as under a pose that is a little off: so the far shifts
    agree less than the near ones.
    """
    y, x = np.mgrid[0:side, 0:side] - side / 2
    cell = np.stack([x * (1 - x / (20 * side)), y], -1) @ np.linalg.inv(basis) + 0.3
    away = (cell - np.round(cell)) @ basis
    view = np.exp(-(away**2).sum(-1) / (2 * 2.0**2)).astype(np.float32)
    noise = np.random.default_rng(0).normal(0, 0.05, view.shape).astype(np.float32)
    return (view - cv2.GaussianBlur(view, (0, 0), 12) + noise)[:, :, None]


@pytest.mark.parametrize(
    "basis",
    [
        [[15.3, 0.0], [0.0, 18.6]],
        [[21.0, 6.5], [-5.0, 16.0]],
        [[14.0, 3.0], [8.0, 15.0]],
        [[30.5, -4.0], [2.0, 12.2]],
    ],
)
def test_the_pair_of_a_lattice_is_its_basis(basis: list[list[float]]) -> None:
    steps = np.array(basis)
    pair = best_pair(autocorrelation(dots(steps), np.ones((128, 128), np.float32)), least=4, most=60)
    assert pair is not None
    np.testing.assert_allclose(reduce_basis(pair.basis), reduce_basis(steps), atol=0.3)
    assert pair.bits > 20


@pytest.mark.parametrize("factors", [[[2, 0], [0, 1]], [[1, 0], [0, 2]], [[1, 1], [1, -1]], [[2, 0], [0, 2]]])
def test_a_multiple_of_the_cell_comes_back_to_the_cell(factors: list[list[int]]) -> None:
    steps = np.array([[14.0, 3.0], [8.0, 15.0]])
    found = autocorrelation(dots(steps), np.ones((128, 128), np.float32))
    basis = _divided(found, np.array(factors) @ steps, least=4)
    np.testing.assert_allclose(reduce_basis(basis), reduce_basis(steps), atol=0.3)


STEPS = np.array([[14.0, 3.0], [8.0, 15.0]])
EVERYWHERE = np.ones((128, 128), np.float32)


@pytest.mark.parametrize("words", [[[1, 1], [0, 1]], [[0, 1], [-1, 0]], [[2, 1], [1, 1]], [[-1, 0], [3, -1]]])
def test_what_a_lattice_saves_is_the_same_for_all_its_bases(words: list[list[int]]) -> None:
    found = autocorrelation(dots(STEPS), EVERYWHERE)
    bits = _saved_bits(found, STEPS)
    assert bits > 20
    assert _saved_bits(found, np.array(words) @ STEPS) == pytest.approx(bits, rel=1e-9)


@pytest.mark.parametrize(
    "rows", [[[2, 0], [0, 1]], [[3, 0], [0, 2]], [[0.5, 0], [0, 1]], [[1.3, 0], [0.2, 0.8]]]
)
def test_multiples_parts_and_other_lattices_save_less_than_the_cell(rows: list[list[float]]) -> None:
    found = autocorrelation(dots(STEPS), EVERYWHERE)
    assert _saved_bits(found, np.array(rows) @ STEPS) < 0.3 * _saved_bits(found, STEPS)


def test_a_few_cells_that_agree_by_chance_save_less_than_many_that_agree_a_little() -> None:
    random = np.random.default_rng(5)
    noise = random.normal(0, 0.12, (128, 128, 1)).astype(np.float32)
    many = best_pair(autocorrelation(dots(STEPS) + noise, EVERYWHERE), least=4, most=60)
    blobs = cv2.GaussianBlur(random.normal(0, 1, (128, 128)), (0, 0), 4).astype(np.float32)[:, :, None]
    few = best_pair(autocorrelation(blobs - blobs.mean(), EVERYWHERE), least=4, most=60)
    assert many is not None and few is not None
    assert many.bits > 10 * few.bits


def test_steps_shorter_or_longer_than_asked_for_are_not_taken() -> None:
    steps = np.array([[15.0, 0.0], [0.0, 18.0]])
    found = autocorrelation(dots(steps), np.ones((128, 128), np.float32))
    longer = best_pair(found, least=20, most=60)
    assert longer is not None and np.linalg.norm(longer.basis, axis=1).min() >= 19.5
    assert best_pair(found, least=4, most=14) is None


def test_a_view_without_features_has_no_pair() -> None:
    nothing = np.zeros((64, 64, 2), np.float32)
    assert best_pair(autocorrelation(nothing, np.ones((64, 64), np.float32)), least=4, most=30) is None


def test_a_shift_is_worth_what_it_rises_above_the_valley_before_it() -> None:
    x = np.arange(96)
    waves = np.tile(np.cos(2 * np.pi * x / 12), (96, 1)).astype(np.float32)[:, :, None]
    found = autocorrelation(waves, np.ones((96, 96), np.float32))
    shifts = np.array([[12.0, 0.0], [6.0, 0.0], [0.0, 12.0]])
    np.testing.assert_allclose(valley_contrast(found, shifts), [2, 0, 0], atol=0.1)


def ruled(step: float, turn_deg: float, *, differing: float = 0.0, side: int = 128) -> np.ndarray:
    """Lines about square fields, [S, S, 2]; they stand out by 1 + or - `differing`, in chequers."""
    y, x = np.mgrid[0:side, 0:side] - side / 2
    turn = np.radians(turn_deg)
    at = np.stack([x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)], -1) / step + 0.3
    away = (at - np.round(at)) * step
    lines = np.exp(-(away**2) / (2 * 0.7**2))
    kind = np.where(np.floor(at).sum(-1) % 2 == 0, 1 + differing, 1 - differing)
    view = (lines * kind[..., None]).astype(np.float32)
    return view - cv2.GaussianBlur(view, (0, 0), step)


@pytest.mark.parametrize("step", [6.0, 9.0, 13.0])
@pytest.mark.parametrize("turn_deg", [0.0, 4.0, 30.0])
def test_the_pair_of_a_ruled_sheet_is_its_step_and_not_its_diagonal(step: float, turn_deg: float) -> None:
    pair = best_pair(
        autocorrelation(ruled(step, turn_deg), np.ones((128, 128), np.float32)), least=4, most=60
    )
    assert pair is not None
    np.testing.assert_allclose(np.linalg.norm(reduce_basis(pair.basis), axis=1), step, atol=0.3)
    assert abs(np.linalg.det(pair.basis)) == pytest.approx(step**2, rel=0.05)


@pytest.mark.parametrize("step", [6.0, 9.0, 13.0])
@pytest.mark.parametrize("turn_deg", [0.0, 4.0, 30.0])
def test_fields_that_differ_by_turns_are_not_taken_for_one(step: float, turn_deg: float) -> None:
    view = ruled(step, turn_deg, differing=0.6)
    pair = best_pair(autocorrelation(view, np.ones((128, 128), np.float32)), least=4, most=60)
    assert pair is not None
    assert abs(np.linalg.det(pair.basis)) == pytest.approx(2 * step**2, rel=0.05)

"""Cues for the middle of an object in a repeating cell."""

import numpy as np
import pytest

from p3i.vision.motif import concentration, contrast, correlate, offsets, parts, symmetry

N = 20
CUES = {
    "contrast": lambda cell: contrast(cell[None]),
    "parts": lambda cell: parts(cell[None]),
    "texture": lambda cell: concentration(np.abs(cell - np.median(cell))),
}


def disc(x, y, radius, *, ground=0.8, paint=0.1):
    """A disc about sample (x, y) of a torus."""
    dx, dy = (np.roll(d, (y, x), (0, 1)) for d in offsets(N))
    return np.where(np.hypot(dx, dy) < radius, paint, ground).astype(np.float32)


@pytest.mark.parametrize("cue", CUES)
@pytest.mark.parametrize("at", [(10, 10), (3, 16), (0, 0)])
@pytest.mark.parametrize("paint", [0.1, 1.0])
def test_a_disc_is_met_in_its_middle_wherever_the_cell_is_cut(cue, at, paint):
    worth = CUES[cue](disc(*at, 0.22, paint=paint))
    y, x = divmod(int(worth.argmax()), N)
    away = (np.array([x, y]) - at + N // 2) % N - N // 2
    assert np.abs(away).max() <= 1


@pytest.mark.parametrize("cue", [*CUES, "symmetry"])
def test_a_cue_moves_with_the_cell(cue):
    rule = CUES.get(cue, lambda cell: symmetry(cell[None] - cell.mean()))
    cell = disc(7, 9, 0.25)
    cell[7, 9] = 0.5
    assert np.allclose(np.roll(rule(cell), (4, -6), (0, 1)), rule(np.roll(cell, (4, -6), (0, 1))), atol=1e-5)


def test_half_turn_symmetry_is_full_at_the_middle_of_a_disc_and_half_a_period_from_it():
    cell = disc(6, 8, 0.3)
    worth = symmetry(cell[None] - cell.mean())
    assert worth[8, 6] == pytest.approx(1, abs=1e-5)
    assert worth[18, 16] == pytest.approx(1, abs=1e-5)
    assert worth[8, 11] < 0.7


def test_a_stripe_that_wraps_round_is_no_part():
    stripe = np.full((N, N), 0.8, np.float32)
    stripe[:, 4:8] = 0.1
    assert parts(stripe[None]).max() == 0


def test_a_plain_cell_says_nothing():
    plain = np.full((1, N, N), 0.5, np.float32)
    for worth in (contrast(plain), parts(plain), symmetry(plain * 0), concentration(plain[0])):
        assert np.isfinite(worth).all()
        assert np.ptp(worth) < 1e-6


def test_correlation_looks_ahead_of_each_place():
    values, kernel = np.zeros((6, 6)), np.zeros((6, 6))
    values[2, 5], kernel[1, 0] = 1.0, 1.0
    assert correlate(values, kernel).round(6)[1, 5] == 1

"""Cues for the middle of an object in a repeating cell."""

import numpy as np
import pytest

from p3i.vision.motif import concentration, contrast, correlate, named_places, offsets, parts, symmetry

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


def ruled(x, y, *, ground=0.9, paint=0.2):
    """Lines two samples wide through sample (x, y) of a torus, along both sides."""
    cell = np.full((N, N), ground)
    cell[[y - 1, y]] = cell[:, [x - 1, x]] = paint
    return cell


def chequers(x, y):
    """Two dark diamonds a cell, one of them about sample (x, y): a chequered floor on its longer lattice."""
    dx, dy = (np.roll(d, (y, x), (0, 1)) for d in offsets(N))
    return np.where(np.abs(dx) + np.abs(dy) < 0.5, 0.2, 0.8)


def near(place, x, y):
    """Whether a place (row, column) is within a sample or two of (x, y) on the torus."""
    return all(abs((at - to + N // 2) % N - N // 2) <= 2 for at, to in zip(place, (y, x), strict=True))


@pytest.mark.parametrize("paint", [0.2, 1.0])
@pytest.mark.parametrize("at", [(10, 10), (4, 15)])
def test_a_ruled_cell_has_a_crossing_and_a_field_half_a_step_from_it(at, paint):
    names = named_places(ruled(*at, ground=0.6, paint=paint))
    assert set(names) == {"crossing", "field"}
    assert near(names["crossing"], *at) and near(names["field"], at[0] + N // 2, at[1] + N // 2)


@pytest.mark.parametrize(("paint", "name"), [(0.1, "dark"), (1.0, "light")])
def test_a_disc_on_a_plain_ground_is_dark_or_light_and_its_ground_has_no_name(paint, name):
    names = named_places(disc(6, 13, 0.25, paint=paint))
    assert set(names) == {name} and near(names[name], 6, 13)


def test_a_chequered_floor_has_a_dark_and_a_light_field():
    names = named_places(chequers(5, 9))
    assert set(names) == {"dark", "light"}
    assert near(names["dark"], 5, 9) and near(names["light"], 5 + N // 2, 9 + N // 2)


def test_a_plain_cell_has_no_named_places():
    assert named_places(np.full((N, N), 0.5) + 0.01 * disc(4, 4, 0.2)) == {}

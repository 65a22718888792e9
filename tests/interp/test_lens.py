"""Radial distortion: both directions undo each other, and what the signs mean."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.size import Size

SIZE = Size(640, 480)
k1s = st.floats(-0.39, 0.39)


@settings(deadline=None)
@given(st.floats(0, 639), st.floats(0, 479), k1s)
def test_a_photo_point_comes_back_from_its_straight_one(x: float, y: float, k1: float) -> None:
    photo = torch.tensor([[x, y]], dtype=torch.float64)
    straight = straight_from_photo(photo, k1, size=SIZE)
    back, shown = photo_from_straight(straight, k1, size=SIZE)
    assert bool(shown.all())
    torch.testing.assert_close(back, photo, atol=1e-6, rtol=0)


def test_without_distortion_nothing_moves() -> None:
    points = torch.tensor([[0.0, 0.0], [100.0, 400.0], [900.0, -50.0]], dtype=torch.float64)
    moved, shown = photo_from_straight(points, 0.0, size=SIZE)
    assert bool(shown.all())
    torch.testing.assert_close(moved, points)
    torch.testing.assert_close(straight_from_photo(points, 0.0, size=SIZE), points)


def test_the_corner_lies_one_half_diagonal_out_and_the_middle_stays() -> None:
    middle = torch.tensor(SIZE.middle, dtype=torch.float64)
    corner = middle + torch.tensor([320.0, 240.0], dtype=torch.float64)
    straight = straight_from_photo(torch.stack([middle, corner]), -0.2, size=SIZE)
    torch.testing.assert_close(straight[0], middle)
    # Barrel: the photo shows squeezed what a pinhole camera sees 1 / (1 - 0.2) farther out.
    torch.testing.assert_close((straight[1] - middle).norm(), torch.tensor(400 / 0.8, dtype=torch.float64))


def test_a_pincushion_never_shows_what_lies_far_out() -> None:
    middle = torch.tensor(SIZE.middle, dtype=torch.float64)
    edge = 400 / math.sqrt(4 * 0.2)
    out = middle + torch.tensor([[edge - 1, 0.0], [edge + 1, 0.0]], dtype=torch.float64)
    points, shown = photo_from_straight(out, 0.2, size=SIZE)
    assert shown.tolist() == [True, False]
    assert bool(torch.isfinite(points).all())


@pytest.mark.parametrize("k1", [-0.2, 0.0, 0.15])
def test_gradients_equal_finite_differences(k1: float) -> None:
    points = torch.tensor([[50.0, 40.0], [500.0, 300.0]], dtype=torch.float64, requires_grad=True)
    number = torch.tensor(k1, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda at, bend: photo_from_straight(at, bend, size=SIZE)[0], (points, number)
    )

"""Robust fits of numbers to places."""

import pytest
import torch
from torch import Tensor

from p3i.search.fit.robust import fitted
from p3i.search.fit.slopes import with_slopes

START = torch.tensor([0.0, 0.0, 7.0], dtype=torch.float64)
LIMITS = torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64)
TARGETS = torch.tensor([[3.0, 4.0], [13.0, 4.0], [3.0, 14.0]], dtype=torch.float64)


def shifted(numbers: Tensor) -> Tensor:
    """Three points at numbers [..., 3], the last of which says nothing; a batch differs in last bits."""
    points = TARGETS - TARGETS[0] + numbers[..., None, :2]
    return points + 1e-13 * torch.arange(len(points)).reshape(-1, 1, 1) if points.dim() == 3 else points


def test_a_number_that_is_held_has_no_slope() -> None:
    _, slopes = with_slopes(shifted, START, LIMITS)
    assert bool((slopes[..., 2] == 0).all())
    assert slopes[..., :2].abs().amax() == pytest.approx(1.0)


def test_a_number_that_is_held_stays_and_holds_no_other() -> None:
    whiten = torch.eye(2, dtype=torch.float64).expand(3, 2, 2)
    found = fitted(
        shifted, START, places=TARGETS, whiten=whiten, weights=torch.ones(3).double(), limits=LIMITS
    )
    assert found.numbers.tolist() == pytest.approx([3.0, 4.0, 7.0], abs=1e-3)

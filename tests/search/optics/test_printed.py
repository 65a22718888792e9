"""Numbers as they are printed: few digits, and no object that moves."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import evidence_of, small_scene

from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.unroll import points
from p3i.search.answer import Answer
from p3i.search.optics.printed import MOST_PX, briefly, rounded


def numbers_and_slopes(seed: int, count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Numbers z [V] and the slopes [N, 2, V] of the points that they place."""
    chance = torch.Generator().manual_seed(seed)
    slopes = torch.randn(20, 2, count, generator=chance, dtype=torch.float64) * 6
    return torch.randn(count, generator=chance, dtype=torch.float64) * 10, slopes


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 8))
def test_rounding_moves_no_point_by_more_than_is_allowed(seed: int, count: int) -> None:
    numbers, slopes = numbers_and_slopes(seed, count)
    found = rounded(numbers, slopes, digits=[4] * count)
    moved = torch.einsum("nip,p->ni", slopes, found - numbers)
    # Four decimals are the most, so what many numbers move together may move by what these leave.
    assert float(moved.norm(dim=1).max()) <= MOST_PX + 1e-9
    assert all(value == round(value, 4) for value in found.tolist())


def test_a_number_that_moves_little_has_few_digits_and_one_that_moves_much_keeps_them() -> None:
    slopes = torch.diag(torch.tensor([0.04, 400.0])).double()[None]
    found = rounded(torch.tensor([12.34567, 12.34567], dtype=torch.float64), slopes, digits=[4, 4])
    assert found.tolist() == [12.0, 12.3457]


def test_a_term_is_gone_where_the_picture_stays() -> None:
    numbers = torch.tensor([0.0021, 7.0], dtype=torch.float64)

    def found(scale: float) -> list[float]:
        slopes = torch.diag(torch.tensor([scale, 10.0])).double()[None]
        return rounded(numbers, slopes, digits=[4, 4]).tolist()

    assert found(5.0)[0] == 0
    assert found(50.0)[0] != 0  # a tenth of a pixel: it would be seen


def test_what_one_number_leaves_another_makes_up_for() -> None:
    both = torch.tensor([[1.0, 1.0], [1.0, 1.0], [0.0, 1e-6]], dtype=torch.float64)
    slopes = 50 * torch.stack([both, both], 1)
    found = rounded(torch.tensor([3.14159, 2.71828], dtype=torch.float64), slopes, digits=[4, 4])
    assert sorted(len(repr(value)) for value in found.tolist()) == [3, 6]
    assert float(found.sum()) == pytest.approx(3.14159 + 2.71828, abs=1e-3)


def test_an_answer_on_a_photo_gets_shorter_and_draws_the_same() -> None:
    scene = small_scene(14)
    evidence = evidence_of(scene)
    nudged = {path: value + 1e-4 * np.pi for path, value in leaves(scene.program).items() if "draw" in path}
    answer = Answer(with_leaves(scene.program, nudged), "lattice", 1.0, 1.0)
    found = briefly(evidence, answer)

    def characters(program) -> int:
        return sum(len(repr(value)) for value in leaves(program).values())

    assert characters(found.program) < characters(answer.program)
    size = evidence.image.size
    before, after = (np.array([place[:2] for place in points(one.program)]) for one in (answer, found))
    assert np.abs(before - after).max() * size.unit_px < 0.5
    assert briefly(evidence, found).program == found.program

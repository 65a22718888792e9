"""Numbers as they are printed: few digits, no noise, and no object that moves."""

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import evidence_of, small_scene

from p3i.grammar.leaves import leaves, with_leaves
from p3i.interp.unroll import points
from p3i.search.answer import Answer
from p3i.search.optics.printed import MOST_PX, MOST_SIGMAS, as_precise_as_fitted, rounded


def fitted(seed: int, count: int, sigma: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Numbers z [V], slopes [N, 2, V] of the points that they place, and z's covariance from their noise."""
    chance = torch.Generator().manual_seed(seed)
    slopes = torch.randn(20, 2, count, generator=chance, dtype=torch.float64) * 6
    rows = slopes.flatten(0, 1)
    covariance = torch.linalg.inv(rows.T @ rows) * sigma**2
    numbers = torch.randn(count, generator=chance, dtype=torch.float64) * 10
    return numbers, slopes, covariance


def printed(seed: int, count: int, sigma: float, *, droppable: bool):
    numbers, slopes, covariance = fitted(seed, count, sigma)

    def again(numbers: torch.Tensor) -> torch.Tensor:
        return rounded(
            numbers,
            covariance,
            digits=[4] * count,
            droppable=[droppable] * count,
            points_of=lambda z: torch.einsum("nip,...p->...ni", slopes, z),
        )

    return numbers, slopes, covariance, again


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 8), st.floats(0.02, 2.0))
def test_rounding_moves_no_point_by_more_than_a_tenth_of_its_deviation(seed, count, sigma) -> None:
    numbers, slopes, covariance, again = printed(seed, count, sigma, droppable=False)
    found = again(numbers)
    moved = torch.einsum("nip,p->ni", slopes, found - numbers)
    deviation = torch.einsum("nip,pq,niq->ni", slopes, covariance, slopes).sqrt()
    # Four decimals are the most, so what is known better than they tell moves by what they leave.
    assert bool((moved.abs() <= MOST_SIGMAS * deviation * (1 + 1e-6) + 4e-3).all())
    assert float(moved.norm(dim=1).max()) <= MOST_PX + 1e-9


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 8), st.floats(0.02, 2.0))
def test_rounded_twice_is_rounded_once(seed, count, sigma) -> None:
    numbers, _, _, again = printed(seed, count, sigma, droppable=False)
    once = again(numbers)
    assert torch.equal(again(once), once)
    assert all(value == round(value, 4) for value in once.tolist())


def test_a_badly_known_number_has_few_digits_and_a_well_known_one_keeps_them() -> None:
    numbers = torch.tensor([12.34567, 12.34567], dtype=torch.float64)
    found = rounded(
        numbers,
        torch.diag(torch.tensor([0.8, 0.002], dtype=torch.float64).square()),
        digits=[4, 4],
        droppable=[True, True],
        points_of=lambda z: 0.01 * torch.stack([z, z], -1),
    )
    assert found.tolist() == [12.3, 12.3457]


def test_a_term_that_is_noise_is_gone_where_the_picture_stays() -> None:
    numbers = torch.tensor([0.0021, 7.0], dtype=torch.float64)

    def found(scale: float) -> list[float]:
        return rounded(
            numbers,
            torch.diag(torch.tensor([0.004, 0.004], dtype=torch.float64).square()),
            digits=[4, 4],
            droppable=[True, True],
            points_of=lambda z: scale * torch.stack([z, z], -1),
        ).tolist()

    assert found(5.0)[0] == 0
    assert found(50.0)[0] != 0  # a tenth of a pixel: it would be seen


def test_an_answer_on_a_photo_gets_shorter_and_draws_the_same() -> None:
    scene = small_scene(14)
    evidence = evidence_of(scene)
    nudged = {path: value + 1e-4 * np.pi for path, value in leaves(scene.program).items() if "draw" in path}
    answer = Answer(with_leaves(scene.program, nudged), "lattice", 1.0, 1.0)
    found = as_precise_as_fitted(evidence, answer)

    def characters(program) -> int:
        return sum(len(repr(value)) for value in leaves(program).values())

    assert characters(found.program) < characters(answer.program)
    size = evidence.image.size
    before, after = (np.array([place[:2] for place in points(one.program)]) for one in (answer, found))
    assert np.abs(before - after).max() * size.unit_px < 0.5
    assert as_precise_as_fitted(evidence, found).program == found.program

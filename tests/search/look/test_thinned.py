"""The one sample of objects: the same in any order, and fair to every direction and step of the loops."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from p3i.search.look.thinned import thinned

SIDES = st.integers(1, 70)


def grid(rows: int, columns: int) -> torch.Tensor:
    return torch.cartesian_prod(torch.arange(rows), torch.arange(columns))


@given(SIDES, SIDES, st.integers(60, 600), st.integers(0, 9))
def test_no_residue_of_either_loop_is_starved(rows: int, columns: int, most: int, seed: int) -> None:
    index = grid(rows, columns)
    sample = index[thinned(index, most, seed=seed)]
    assert len(sample) == min(most, len(index))
    for step in range(2, 7):
        for loop in (0, 1):
            whole, part = (torch.bincount(one[:, loop] % step, minlength=step) for one in (index, sample))
            fair = whole * len(sample) / len(index)
            # Three standard deviations of a random sample of independent objects.
            assert bool((part >= fair - 3 * fair.sqrt() - 1e-9).all()), (step, loop, part, fair)


@given(SIDES, SIDES, st.integers(1, 600))
def test_every_part_of_the_pattern_has_its_share(rows: int, columns: int, most: int) -> None:
    index = grid(rows, columns)
    sample = index[thinned(index, most)]
    for loop, length in ((0, rows), (1, columns)):
        for first in (True, False):
            half = (index[:, loop] * 2 < length) == first
            here = (sample[:, loop] * 2 < length) == first
            fair = float(half.double().mean()) * len(sample)
            assert abs(int(here.sum()) - fair) <= 3 * max(fair, 1.0) ** 0.5


@given(SIDES, SIDES, st.randoms(use_true_random=False))
def test_the_order_of_the_loops_does_not_matter(rows: int, columns: int, chance) -> None:
    index = grid(rows, columns)
    order = list(range(len(index)))
    chance.shuffle(order)
    mixed = index[order]
    first, second = index[thinned(index, 100)], mixed[thinned(mixed, 100)]
    assert {tuple(row) for row in first.tolist()} == {tuple(row) for row in second.tolist()}


def test_few_objects_are_all_looked_at() -> None:
    index = grid(10, 30)
    assert thinned(index, 300).tolist() == list(range(300))
    assert thinned(index[:0], 300).tolist() == []

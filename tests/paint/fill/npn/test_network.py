"""The network: blind to the order and number of its sources, and a weighted mean before it has learned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from painted import batch as lesson_batch
from painted import scene

from p3i.paint.fill.npn.lessons import part_of, varied
from p3i.paint.fill.npn.network import Batch, PaintingNetwork, PatchDiscriminator, plain


@pytest.fixture(scope="module")
def batch() -> Batch:
    found = lesson_batch(scene())
    most = (found.weights > 0).sum(1).argmax()  # a stack of many sources
    return part_of(found, most[None])


def taught() -> PaintingNetwork:
    """A network whose every weight does something."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(1)
        network = PaintingNetwork()
        for weights in network.parameters():
            weights.data += 0.1 * torch.randn_like(weights)
    return network


def of_sources(batch: Batch, order: list[int]) -> Batch:
    weights = batch.weights[:, order]
    return replace(
        batch,
        sources=batch.sources[:, order],
        known=batch.known[:, order],
        weights=weights / weights.sum(1, keepdim=True),
    )


def test_the_order_of_the_sources_makes_no_difference(batch: Batch) -> None:
    count = batch.weights.shape[1]
    assert count >= 4
    network = taught()
    with torch.no_grad():
        one, other = network(batch), network(of_sources(batch, list(range(count))[::-1]))
    assert (one.fill - plain(batch).fill).abs().max() > 0.01
    torch.testing.assert_close(one.fill, other.fill, atol=2e-5, rtol=0)
    torch.testing.assert_close(one.attention, other.attention.flip(1), atol=2e-5, rtol=0)


@pytest.mark.parametrize("count", [1, 2, 3, 17])
def test_any_number_of_sources_is_painted_from(batch: Batch, count: int) -> None:
    some = of_sources(batch, [place % batch.weights.shape[1] for place in range(count)])
    with torch.no_grad():
        said = taught()(some)
    assert said.fill.shape == batch.target.shape
    assert torch.isfinite(said.fill).all()
    torch.testing.assert_close(said.attention.sum(1), torch.ones_like(batch.hole))


def test_places_without_a_source_do_not_count(batch: Batch) -> None:
    padded = of_sources(batch, [0, 1, 2])
    bare = torch.cat([batch.weights[:, :3] / batch.weights[:, :3].sum(), torch.zeros(1, 2)], 1)
    wider = replace(of_sources(batch, [0, 1, 2, 0, 0]), weights=bare)
    wider = replace(wider, known=wider.known * (bare > 0)[:, :, None, None, None])
    with torch.no_grad():
        torch.testing.assert_close(taught()(padded).fill, taught()(wider).fill, atol=2e-5, rtol=0)


def test_untrained_it_paints_the_weighted_mean_of_the_sources_and_the_membrane(batch: Batch) -> None:
    with torch.no_grad():
        said = PaintingNetwork()(batch)
    weights = batch.weights[0].numpy()[:, None, None, None] * batch.known[0].numpy()
    wanted = (weights * batch.sources[0].numpy()).sum(0) / np.maximum(weights.sum(0), 1e-9)
    wanted = wanted + batch.lift[0].numpy()
    shown = (weights.sum(0) > 1e-6)[0]
    assert shown.mean() > 0.9
    np.testing.assert_allclose(said.fill[0].numpy()[:, shown], wanted[:, shown], atol=1e-5)


def test_the_truth_in_the_hole_is_never_looked_at(batch: Batch) -> None:
    other = replace(batch, target=torch.where(batch.hole > 0, 1 - batch.target, batch.target))
    with torch.no_grad():
        torch.testing.assert_close(taught()(batch).fill, taught()(other).fill, atol=0, rtol=0)


def test_a_varied_batch_is_the_same_problem_in_other_light(batch: Batch) -> None:
    """Sources and target change alike: what the mean of all is off by changes by the gain alone."""
    for seed in range(5):
        other = varied(batch, torch.Generator().manual_seed(seed))
        assert other.hole.sum() == batch.hole.sum()
        torch.testing.assert_close(other.weights.sum(1), torch.ones(1))
        was, now = (
            (one.sources - one.target[:, None]).abs().mean((0, 2, 3, 4)).tolist() for one in (batch, other)
        )
        # Each source that is left is one of those before, off by as much, times one gain for all.
        gains = [now[0] / before for before in was]
        assert any(
            0.7 <= gain <= 1.3
            and all(min(abs(one / gain / before - 1) for before in was) < 1e-4 for one in now)
            for gain in gains
        )


def test_the_printout_in_the_documents_is_that_of_the_network() -> None:
    text = (Path(__file__).parents[4] / "docs" / "npn.md").read_text(encoding="utf-8")
    assert repr(PaintingNetwork()) in text
    assert repr(PatchDiscriminator()) in text

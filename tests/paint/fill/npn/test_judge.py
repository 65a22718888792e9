"""How much of the network's fill is taken: what copies of the hole say, and how two fills are made one."""

import dataclasses

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from painted import Scene, cells, scene

from p3i.options.npn import NetworkOptions
from p3i.paint.fill.npn import copies as copying
from p3i.paint.fill.npn.blend import blended
from p3i.paint.fill.npn.copies import copies
from p3i.paint.fill.npn.judge import PRIOR, judged, share_of
from p3i.paint.fill.npn.network import PaintingNetwork
from p3i.paint.fill.npn.paint import paint
from p3i.paint.fill.npn.stacks import pool_of
from p3i.paint.fill.npn.tasks import tasks_of
from p3i.vision.image import Image


@pytest.fixture(scope="module")
def photo() -> Scene:
    return scene()


def copied(photo: Scene, hole: np.ndarray) -> list[np.ndarray]:
    """Copies of a hole on all objects of the scene."""
    known = photo.photo.valid & ~hole
    tasks = tasks_of(cells(photo, hidden=False), photo.placed, hole)
    places = list(range(len(photo.placed.points)))
    return copies(known, hole, photo.placed, tasks, places, cell_px=400, seed=0)


def test_copies_lie_on_known_ground_apart_from_each_other(photo: Scene) -> None:
    found = copied(photo, photo.hole)
    assert len(found) == copying.MOST
    counted = np.zeros(photo.hole.shape, int)
    for copy in found:
        np.add.at(counted, (copy[:, 1], copy[:, 0]), 1)
    assert counted.max() == 1
    for copy in found:
        beside = np.zeros(photo.hole.shape, np.uint8)
        beside[copy[:, 1], copy[:, 0]] = 1
        beside = cv2.dilate(beside, np.ones((13, 13), np.uint8))
        assert all(beside[other[:, 1], other[:, 0]].mean() < 0.05 for other in found if other is not copy)
    assert not counted[photo.hole].any()
    assert counted.sum() < 0.3 * photo.hole.size


def test_a_copy_hides_of_another_cell_what_the_hole_hides_of_its_own(photo: Scene) -> None:
    """The middles of the discs and their rims, each as often."""
    radius = np.zeros(photo.hole.shape)
    points = np.stack(np.meshgrid(np.arange(160.0), np.arange(120.0)), -1)
    back = np.linalg.inv(photo.placed.image_from_plane)
    moved = points @ back[:, :2].T + back[:, 2]
    plane = moved[..., :2] / moved[..., 2:]
    radius = np.min([np.hypot(*(plane - one).transpose(2, 0, 1)) for one in photo.placed.points], 0)
    wanted = np.histogram(radius[photo.hole], [0, 3.2, 5.6, 20], density=False)[0] / photo.hole.sum()
    for copy in copied(photo, photo.hole):
        there = np.histogram(radius[copy[:, 1], copy[:, 0]], [0, 3.2, 5.6, 20])[0] / len(copy)
        np.testing.assert_allclose(there, wanted, atol=0.08)


def test_of_a_hole_too_large_to_be_copied_single_cells_are(photo: Scene) -> None:
    hole = np.zeros_like(photo.hole)
    hole[35:85, 60:115] = True
    found = copied(photo, hole)
    assert len(found) >= copying.FEWEST
    assert max(map(len, found)) < 0.25 * hole.sum()


def test_what_hangs_over_the_patterns_edge_is_copied_to_the_edge(photo: Scene) -> None:
    drawn = copying.drawn_on(photo.placed) > 0
    hole = np.zeros_like(photo.hole)
    middle = photo.placed.centers_px()[0][photo.placed.index[:, 1] == 2].mean(0).astype(int)
    hole[middle[1] + 2 : middle[1] + 22, middle[0] - 6 : middle[0] + 6] = True
    share = drawn[hole].mean()
    assert 0.1 < share < 0.9
    for copy in copied(photo, hole):
        assert abs(drawn[copy[:, 1], copy[:, 0]].mean() - share) < 0.15


def test_judges_fill_their_copies_without_seeing_them(photo: Scene) -> None:
    """What the copies hide makes no difference to either fill."""
    seen = cells(photo)
    tasks = tasks_of(seen, photo.placed, photo.hole)
    pool = pool_of(seen, torch.tensor([task.number for task in tasks]))
    jury = judged(photo.photo, photo.placed, photo.hole, seen, pool, tasks, seed=0)
    assert jury is not None and jury.hidden.sum() == sum(map(len, jury.copies))
    blank = np.where(jury.hidden[..., None], np.float32(0.5), photo.photo.pixels)
    # The same copies, since what is known is the same: only their truth differs.
    other = judged(Image(blank, photo.photo.valid), photo.placed, photo.hole, seen, pool, tasks, seed=0)
    assert other is not None
    np.testing.assert_array_equal(jury.by_stack, other.by_stack)
    np.testing.assert_array_equal(jury.ground.pixels[jury.ground.sure > 0], blank[jury.ground.sure > 0])
    jury, other = (dataclasses.replace(one, truth=photo.photo.pixels) for one in (jury, other))
    assert jury.share(PaintingNetwork()) == other.share(PaintingNetwork())


def of_copies(shares: list[float], *, noise: float = 0.0) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Changes of some copies, and lacks of which this share of each is right."""
    chance = np.random.default_rng(0)
    changes = [chance.normal(0, 0.1, (60, 3)).astype(np.float32) for _ in shares]
    lacks = [
        np.float32(share) * change + chance.normal(0, noise, change.shape).astype(np.float32)
        for share, change in zip(shares, changes, strict=True)
    ]
    return changes, lacks


@given(share=st.floats(0, 1), count=st.integers(3, 8))
def test_copies_that_agree_are_believed(share: float, count: int) -> None:
    assert share_of(*of_copies([share] * count)) == pytest.approx(share, abs=1e-3)


def test_copies_that_contradict_each_other_leave_the_prior() -> None:
    assert abs(share_of(*of_copies([-3.0, 4.0, 3.5, -1.0])) - PRIOR) < 0.1


@given(shares=st.lists(st.floats(-4, 4), min_size=3, max_size=8))
def test_a_share_is_between_none_and_all(shares: list[float]) -> None:
    assert 0 <= share_of(*of_copies(shares)) <= 1


def test_where_the_network_is_worse_on_every_copy_nothing_is_taken() -> None:
    assert share_of(*of_copies([-0.5, -0.6, -0.4, -0.5])) == 0
    same = [np.zeros((9, 3), np.float32)] * 4
    assert share_of(same, same) == 0


def textures() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two textures that agree in part, and where they differ."""
    chance = np.random.default_rng(3)
    common, one, other = (chance.normal(0, 0.05, (40, 40, 3)).astype(np.float32) for _ in range(3))
    where = np.zeros((40, 40), bool)
    where[8:32, 8:32] = True
    first = np.float32(0.5) + common + one
    return first, np.where(where[..., None], np.float32(0.5) + common + other, first), where


def steps(pixels: np.ndarray) -> float:
    inner = pixels[8:32, 8:32]
    return float((np.diff(inner, axis=0) ** 2).sum() + (np.diff(inner, axis=1) ** 2).sum())


def test_a_blend_is_as_sharp_as_the_stack_and_changes_nothing_else() -> None:
    stack, network, where = textures()
    found = blended(stack, network, where, 0.5)
    assert steps(stack + 0.5 * (network - stack)) < 0.85 * steps(stack)
    assert steps(found) == pytest.approx(steps(stack), rel=0.01)
    np.testing.assert_array_equal(found[~where], stack[~where])


def test_the_ends_of_a_blend_are_its_two_fills() -> None:
    stack, network, where = textures()
    np.testing.assert_allclose(blended(stack, network, where, 0.0), stack, atol=1e-6)
    sharper = stack + np.where(where[..., None], np.float32(2) * (network - stack), np.float32(0))
    np.testing.assert_allclose(blended(stack, sharper, where, 1.0), np.clip(sharper, 0, 1), atol=1e-6)
    nothing = np.zeros_like(where)
    np.testing.assert_array_equal(blended(stack, network, nothing, 1.0), stack)


def test_the_share_that_the_copies_give_is_what_is_painted(
    photo: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the stack's fill and the network's own, and nearer to that of which more is taken."""
    monkeypatch.setattr("p3i.paint.fill.npn.blend._MOST_STRONGER", 1.0)
    found = []
    for share in (0.0, 0.25, 1.0):
        monkeypatch.setattr("p3i.paint.fill.npn.judge.share_of", lambda *given, share=share: share)
        one = paint(photo.photo, photo.placed, photo.hole, NetworkOptions(steps=0))
        assert any(f"{share:.0%} of the say is the network's" in note for note in one.notes) == (share > 0)
        found.append(one.pixels)
    stack, part, network = found
    assert np.abs(network - stack).max() > 0.005
    np.testing.assert_allclose(part, stack + 0.25 * (network - stack), atol=1e-5)

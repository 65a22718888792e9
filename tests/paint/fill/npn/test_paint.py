"""Painting holes with the network: the same again, on from a checkpoint, nothing but the hole, and better."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from painted import Scene, batch, scene

from p3i.errors import FileError, UsageError
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.npn import judge
from p3i.paint.fill.npn.paint import paint
from p3i.paint.fill.npn.shipped import shipped
from p3i.paint.fill.npn.training import EVERY, begun, hole_error, sharpness, train
from p3i.paint.fill.stack import fill_by_stack

SHORT = NetworkOptions(steps=4)
CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def photo() -> Scene:
    return scene()


@pytest.fixture
def trusting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the copies of the hole say, the network's fill is taken."""
    monkeypatch.setattr(judge.Jury, "share", lambda *given: 1.0)


def stack_of(photo: Scene, hole: np.ndarray) -> np.ndarray:
    return fill_by_stack(photo.photo.pixels, photo.photo.valid, hole, photo.placed)[0]


@pytest.mark.usefixtures("trusting")
def test_the_hole_alone_changes_and_equal_seeds_paint_equal_pictures(photo: Scene) -> None:
    one = paint(photo.corrupted, photo.placed, photo.hole, SHORT).pixels
    other = paint(photo.photo, photo.placed, photo.hole, SHORT).pixels
    assert one.dtype == np.float32
    assert (one[~photo.hole] == photo.photo.pixels[~photo.hole]).all()
    # Nor does what the hole hides make a difference.
    np.testing.assert_array_equal(one[photo.hole], other[photo.hole])
    assert one.min() >= 0 and one.max() <= 1
    assert np.abs(one - stack_of(photo, photo.hole)).max() > 1e-3


@pytest.mark.usefixtures("trusting")
def test_a_training_that_was_cut_off_goes_on_to_the_same_picture(photo: Scene, tmp_path: Path) -> None:
    options = replace(SHORT, steps=EVERY + 4)
    whole = paint(photo.photo, photo.placed, photo.hole, options).pixels
    kept = replace(options, checkpoint=tmp_path / "npn.pt")

    def cut(step: int, steps: int, error: float) -> None:
        if step == EVERY + 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        paint(photo.photo, photo.placed, photo.hole, kept, progress=cut)
    steps: list[int] = []
    resumed = paint(
        photo.photo, photo.placed, photo.hole, kept, progress=lambda step, *_: steps.append(step)
    ).pixels
    assert steps[0] == EVERY + 1
    np.testing.assert_array_equal(resumed, whole)


@pytest.mark.usefixtures("trusting")
def test_the_network_of_one_hole_paints_the_next_without_more_training(photo: Scene, tmp_path: Path) -> None:
    kept = replace(SHORT, checkpoint=tmp_path / "npn.pt")
    paint(photo.photo, photo.placed, photo.hole, kept)
    steps: list[int] = []
    other = np.roll(photo.hole, 20, axis=1)
    found = paint(photo.photo, photo.placed, other, kept, progress=lambda step, *_: steps.append(step))
    assert not steps
    assert np.abs(found.pixels - stack_of(photo, other))[other].max() > 1e-3


def test_a_checkpoint_of_another_photo_and_what_is_none_are_refused(photo: Scene, tmp_path: Path) -> None:
    kept = replace(SHORT, steps=1, checkpoint=tmp_path / "npn.pt")
    paint(photo.photo, photo.placed, photo.hole, kept)
    darker = replace(photo.photo, pixels=photo.photo.pixels * np.float32(0.9))
    with pytest.raises(FileError, match="of another photo"):
        paint(darker, photo.placed, photo.hole, kept)
    # As p3i wrote them before it kept one network a photo.
    torch.save({"key": "0", "holes": {}}, tmp_path / "npn.pt")
    with pytest.raises(FileError, match="of an earlier p3i"):
        paint(photo.photo, photo.placed, photo.hole, kept)
    (tmp_path / "npn.pt").write_bytes(b"nothing")
    with pytest.raises(FileError, match="no checkpoint"):
        paint(photo.photo, photo.placed, photo.hole, kept)


def test_training_on_a_photo_brings_the_shipped_weights_closer_to_its_lessons(photo: Scene) -> None:
    learned = batch(photo, seed=1)
    training = begun(seed=0, device=CPU, rate=5e-4, weights=shipped())
    with torch.no_grad():
        before = float(hole_error(training.mean(learned).fill, learned).mean())
    train(training, [learned], steps=40, seed=0)
    with torch.no_grad():
        after = float(hole_error(training.mean(learned).fill, learned).mean())
    assert after < 0.99 * before


def test_where_too_few_cells_can_be_set_aside_the_stacks_fill_stands(
    photo: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judge, "FEWEST", 99)
    found = paint(photo.photo, photo.placed, photo.hole, SHORT)
    assert np.array_equal(found.pixels, stack_of(photo, photo.hole))
    assert found.fallback[photo.hole].all()
    assert "too few other cells show the like to learn from: the stack's fill stands" in found.notes[0]


def test_a_longer_training_goes_on_as_a_shorter_one(photo: Scene) -> None:
    learned = [batch(photo)]
    once, twice, again = (begun(seed=seed, device=CPU, rate=1e-3) for seed in (3, 3, 9))
    train(once, learned, steps=6, seed=3)
    train(twice, learned, steps=3, seed=3)
    again.restore(twice.state())
    train(again, learned, steps=6, seed=3)
    for one, other in zip(once.mean.parameters(), again.mean.parameters(), strict=True):
        assert torch.equal(one, other)


def test_sharpness_is_the_mean_difference_of_neighbours_within() -> None:
    stripes = torch.zeros(1, 3, 8, 8)
    stripes[..., ::2] = 0.5  # 0.5 from column to column, 0 from row to row
    within = torch.zeros(1, 1, 8, 8)
    within[..., 2:6, 2:6] = 1
    found = sharpness(stripes, within)
    torch.testing.assert_close(found, torch.tensor([0.25 + 0.004]))
    soft = torch.nn.functional.avg_pool2d(stripes, (1, 2), 1, (0, 1))[..., 1:]
    assert sharpness(soft, within) < 0.1 * found


@pytest.mark.parametrize("box", [(55, 69, 74, 88), (40, 85, 60, 105)], ids=["one cell", "many cells"])
def test_where_it_is_not_surer_the_stacks_fill_stands_and_is_said_to(
    photo: Scene, monkeypatch: pytest.MonkeyPatch, box: tuple[int, int, int, int]
) -> None:
    monkeypatch.setattr(judge, "share_of", lambda *given: 0.0)
    hole = np.zeros_like(photo.hole)
    hole[box[0] : box[1], box[2] : box[3]] = True
    found = paint(photo.photo, photo.placed, hole, SHORT)
    assert np.array_equal(found.pixels, stack_of(photo, hole))
    assert np.array_equal(found.fallback, hole) and not found.unlike.any()
    assert found.notes == (
        "for 100% of the hole the network is not surer than the stack on cells that it did not learn from: "
        "the stack's fill stands",
    )


@pytest.mark.usefixtures("trusting")
def test_a_hole_of_many_cells_is_painted_by_the_one_network(photo: Scene) -> None:
    hole = np.zeros_like(photo.hole)
    hole[30:95, 40:125] = True
    steps: list[int] = []
    found = paint(photo.photo, photo.placed, hole, SHORT, progress=lambda step, *_: steps.append(step))
    assert steps == [1, 2, 3, 4]
    changed = np.abs(found.pixels - stack_of(photo, hole)).max(2) > 1e-5
    assert changed[hole].mean() > 0.8
    assert found.fallback[hole].mean() < 0.1


def test_time_stops_the_training(photo: Scene) -> None:
    steps: list[int] = []
    options = replace(SHORT, steps=100_000, time_s=0.2)
    paint(photo.photo, photo.placed, photo.hole, options, progress=lambda step, *_: steps.append(step))
    assert len(steps) < 1000


def test_options_out_of_range_and_devices_that_are_not_there_are_refused(photo: Scene) -> None:
    for wrong in ({"steps": -1}, {"time_s": 0.0}, {"seed": -1}, {"threads": 0}):
        with pytest.raises(UsageError):
            NetworkOptions(**wrong)
    with pytest.raises(UsageError, match="no device"):
        paint(photo.photo, photo.placed, photo.hole, replace(SHORT, device="abacus"))
    with pytest.raises(ValueError, match="the hole is bool"):
        paint(photo.photo, photo.placed, photo.hole[:-1], SHORT)

"""Painting holes with the network: the same again, on from a checkpoint, nothing but the hole, and better."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from painted import Scene, scene, stacks, window

from p3i.errors import FileError, UsageError
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.npn import training
from p3i.paint.fill.npn.lessons import batch_of, lessons
from p3i.paint.fill.npn.network import plain
from p3i.paint.fill.npn.paint import paint
from p3i.paint.fill.npn.training import EVERY, begun, train
from p3i.paint.fill.stack import fill_by_stack

SHORT = NetworkOptions(steps=12, time_s=None, threads=1, examples=10, sources=5)


@pytest.fixture(scope="module")
def photo() -> Scene:
    return scene()


def test_the_hole_alone_changes_and_equal_seeds_paint_equal_pictures(photo: Scene) -> None:
    one = paint(photo.corrupted, photo.placed, photo.hole, SHORT).pixels
    other = paint(photo.photo, photo.placed, photo.hole, SHORT).pixels
    assert one.dtype == np.float32
    assert (one[~photo.hole] == photo.photo.pixels[~photo.hole]).all()
    # Nor does what the hole hides make a difference.
    np.testing.assert_array_equal(one[photo.hole], other[photo.hole])
    assert one.min() >= 0 and one.max() <= 1


def test_a_training_that_was_cut_off_goes_on_to_the_same_picture(photo: Scene, tmp_path: Path) -> None:
    options = replace(SHORT, steps=EVERY + 8, adversarial=0.01)
    whole = paint(photo.photo, photo.placed, photo.hole, options).pixels
    assert np.abs(
        whole - fill_by_stack(photo.photo.pixels, photo.photo.valid, photo.hole, photo.placed)[0]
    ).max()
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
    read_back = paint(photo.photo, photo.placed, photo.hole, kept).pixels
    np.testing.assert_array_equal(read_back, whole)


def test_a_shorter_training_goes_on_as_a_longer_one(photo: Scene) -> None:
    _, learned, judged = stacks(photo)
    once, twice = (begun(seed=3, device=torch.device("cpu")) for _ in range(2))
    again = begun(seed=9, device=torch.device("cpu"))
    train(once, learned, judged, steps=9, seed=3, adversarial=0.01)
    train(twice, learned, judged, steps=4, seed=3, adversarial=0.01)
    again.restore(twice.state())
    train(again, learned, judged, steps=9, seed=3, adversarial=0.01)
    for one, other in zip(once.mean.parameters(), again.mean.parameters(), strict=True):
        assert torch.equal(one, other)


def test_a_checkpoint_of_another_hole_is_refused(photo: Scene, tmp_path: Path) -> None:
    kept = replace(SHORT, steps=1, checkpoint=tmp_path / "npn.pt")
    paint(photo.photo, photo.placed, photo.hole, kept)
    with pytest.raises(FileError, match="of another photo"):
        paint(photo.photo, photo.placed, np.roll(photo.hole, 5, axis=0), kept)
    (tmp_path / "npn.pt").write_bytes(b"nothing")
    with pytest.raises(FileError, match="no checkpoint"):
        paint(photo.photo, photo.placed, photo.hole, kept)


def test_training_learns_and_beats_a_plain_mean_of_the_cells(photo: Scene) -> None:
    """Judged on cells that it never trained on."""
    own, learned, judged = stacks(photo, count=40)
    assert len(judged) >= 3
    training = begun(seed=0, device=torch.device("cpu"))
    train(training, learned, judged, steps=120, seed=0, adversarial=0.002)
    test = batch_of(judged, device=torch.device("cpu"))
    holes = test.hole.sum((1, 2, 3))

    def error(fill: torch.Tensor) -> float:
        apart = (fill - test.target).abs().mean(1, keepdim=True) * test.hole
        return float((apart.sum((1, 2, 3)) / holes).mean())

    weights = test.weights[:, :, None, None, None] > 0
    mean = (test.sources * weights).sum(1) / weights.sum(1)
    start = error(plain(test).fill)
    assert training.best_error < 0.95 * start
    assert training.best_error < 0.8 * error(mean)
    assert len(own.weights) >= 4


def test_targets_of_lessons_are_known_and_their_holes_hidden_in_the_sources(photo: Scene) -> None:
    learned, judged = lessons(window(photo), count=12, most=5, seed=1)
    assert learned and judged
    for stack in learned + judged:
        assert not (stack.hole & stack.context).any()
        for source, known in zip(stack.sources, stack.known, strict=True):
            # A source that showed the target's own ground in place would be the answer itself.
            shown = known & stack.hole
            assert shown.any()
            assert np.abs(source - stack.target)[shown].mean() > 1e-3


def test_a_training_that_helps_nobody_leaves_the_stacks_fill_and_says_so(
    photo: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "_SHARES", (0.0,))  # whatever is learned, the judges want none of it
    found = paint(photo.photo, photo.placed, photo.hole, SHORT)
    stack, _ = fill_by_stack(photo.photo.pixels, photo.photo.valid, photo.hole, photo.placed)
    assert np.array_equal(found.pixels, stack)
    assert np.array_equal(found.fallback, photo.hole) and not found.unlike.any()
    assert found.notes == (
        "for 100% of the hole the network learned nothing that helps: the stack's fill stands",
    )


def test_time_stops_the_training(photo: Scene) -> None:
    steps: list[int] = []
    options = replace(SHORT, steps=100_000, time_s=0.5)
    paint(photo.photo, photo.placed, photo.hole, options, progress=lambda step, *_: steps.append(step))
    assert len(steps) < 1000


def test_options_out_of_range_and_devices_that_are_not_there_are_refused(photo: Scene) -> None:
    for wrong in ({"steps": -1}, {"time_s": 0.0}, {"seed": -1}, {"threads": 0}, {"sources": 0}):
        with pytest.raises(UsageError):
            NetworkOptions(**wrong)
    with pytest.raises(UsageError, match="no device"):
        paint(photo.photo, photo.placed, photo.hole, replace(SHORT, device="abacus"))
    with pytest.raises(ValueError, match="the hole is bool"):
        paint(photo.photo, photo.placed, photo.hole[:-1], SHORT)

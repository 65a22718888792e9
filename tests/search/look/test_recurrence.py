"""Bits of what comes again: a pattern has many, a picture that no turn or shift makes better has none."""

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import likelihood_ratio, recurrence_bits, rows_bits
from p3i.search.look.sectors import whole_cells
from p3i.vision.image import Image

SIDE = 300
CHANCE = 20.0
"""Bits that one program out of many may well save of a picture without a pattern."""


def picture(grey: NDArray) -> Evidence:
    shown = np.ascontiguousarray(np.repeat(np.clip(grey, 0, 1)[..., None], 3, 2), np.float32)
    return Evidence(Image(shown, np.ones(grey.shape, bool)), SearchConfig(), 35.0)


def noise(seed: int, *, blur: float = 0.0) -> NDArray:
    drawn = np.random.default_rng(seed).normal(size=(SIDE, SIDE))
    drawn = cv2.GaussianBlur(drawn, (0, 0), blur) if blur else drawn
    return 0.5 + 0.15 * drawn / drawn.std()


def disc(radius: float, *, blur: float) -> NDArray:
    y, x = np.mgrid[0:SIDE, 0:SIDE] - (SIDE - 1) / 2
    return 0.2 + 0.6 / (1 + np.exp((np.hypot(x, y) - radius) / blur))


def spots(count: int, radius: float, *, first: int = 0, last: int | None = None) -> NDArray:
    grey = np.full((SIDE, SIDE), 0.7)
    for j in range(first, count if last is None else last):
        turn = 2 * np.pi * j / count
        at = (SIDE - 1) / 2 + radius * np.array([np.cos(turn), np.sin(turn)])
        cv2.circle(grey, (round(at[0]), round(at[1])), 7, 0.1, -1, cv2.LINE_AA)
    return grey + 0.02 * (noise(3) - 0.5)


def saved(evidence: Evidence, text: str, *, cells: bool = False) -> float:
    pattern = compile(parse(f"SetCameraPose(rx=0, ry=0)\n{text}\n"))
    index = pattern.index[evidence.in_sight(pattern)].double()
    return recurrence_bits(evidence, pattern, index, focal_mm=35.0, cells=cells)


def ring(count: int, radius_px: float = 90, *, middle: float = 0.0) -> str:
    radius, step = radius_px / SIDE * 100, 360 / count
    return (
        f"for j in range(0, {count}):\n"
        f"    Draw(x={radius:g}*Cos({step:g}*j) + {middle:g}, y={radius:g}*Sin({step:g}*j) + 0)"
    )


def rows(step: float, *, count: int = 7) -> str:
    start = -step * (count - 1) / 2
    return (
        f"for i in range(0, {count}):\n    for j in range(0, {count}):\n"
        f"        Draw(x={step:g}*i + {start:g}, y={step:g}*j + {start:g})"
    )


def test_a_ring_of_spots_saves_most_at_its_own_count() -> None:
    evidence = picture(spots(12, 90))
    true = saved(evidence, ring(12))
    assert true > 150
    for count in (6, 11, 13, 24):
        assert saved(evidence, ring(count)) < 0.6 * true


def test_an_object_under_something_else_takes_none_of_the_others_evidence() -> None:
    covered = spots(12, 90)
    x, y = (SIDE - 1) / 2 + 90, (SIDE - 1) / 2
    cv2.circle(covered, (round(x), round(y)), 20, 0.35, -1, cv2.LINE_AA)
    arc = ring(12).replace("range(0, 12)", "range(1, 12)")
    evidence = picture(covered)
    # All but what it costs to say which one is hidden: one of twelve, and that it is one.
    assert saved(evidence, ring(12)) > saved(evidence, arc) - 2 * np.log2(12) - 1


def test_a_rim_that_looks_the_same_at_every_turn_tells_no_count() -> None:
    for blur in (1.0, 4.0):
        for radius in (82.0, 90.0, 98.0):
            evidence = picture(disc(radius, blur=blur) + 0.1 * (noise(1, blur=1.0) - 0.5))
            assert all(saved(evidence, ring(count)) < CHANCE for count in (4, 8, 12, 16))


def test_a_shade_across_the_picture_tells_nothing() -> None:
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    assert saved(picture(0.2 + 0.5 * x + 0.1 * y * y), ring(12)) < CHANCE


@pytest.mark.parametrize("blur", [0.0, 1.5, 4.0, 10.0])
def test_noise_tells_nothing_however_few_of_its_samples_are_independent(blur: float) -> None:
    for seed in range(4):
        evidence = picture(noise(seed, blur=blur))
        assert max(saved(evidence, ring(count)) for count in (3, 4, 5, 8, 12, 20)) < CHANCE
        assert saved(evidence, rows(12), cells=True) < CHANCE


def test_an_arc_in_sight_is_evidence_where_its_centre_is_not() -> None:
    shifted = np.roll(spots(12, 90), 120, 1)
    shifted[:, :120] = 0.7
    assert saved(picture(shifted), ring(12, middle=40)) > 60


def test_stripes_are_no_rows_of_rows() -> None:
    x = np.arange(SIDE) / SIDE * 100
    striped = np.tile(0.5 + 0.3 * np.sign(np.sin(2 * np.pi * x / 12)), (SIDE, 1))
    striped = striped + 0.05 * (noise(2) - 0.5)
    assert saved(picture(striped), rows(12), cells=True) < CHANCE
    chequered = 0.5 + (striped - 0.5) * np.sign(np.sin(2 * np.pi * x / 12))[:, None]
    assert saved(picture(chequered), rows(12), cells=True) > 300


def test_three_hundred_that_agree_a_little_save_more_than_six_that_agree_well() -> None:
    assert 300 * 0.1 > 6 and likelihood_ratio(0.1, 300) > likelihood_ratio(0.9, 6)
    assert likelihood_ratio(1 / 12, 12) == pytest.approx(0, abs=1e-9)


def rows_saved(evidence: Evidence, step: float, index: NDArray, *, count: int = 7) -> float:
    pattern = compile(parse(f"SetCameraPose(rx=0, ry=0)\n{rows(step, count=count)}\n"))
    return rows_bits(evidence, pattern, torch.from_numpy(index).double(), pattern.theta, focal_mm=35.0)


def test_cells_that_were_picked_for_being_alike_save_little_by_rows() -> None:
    side, count = 10, 7  # pixels of a cell, and cells a side of `rows`
    grey = noise(5, blur=2.0)
    middle = (SIDE - 1) / 2
    i, j = (one.ravel() for one in np.mgrid[-11:18, -11:18])
    # Cell (i, j) of `rows(side in units)` is centred at these pixels.
    at = np.stack([i, j], 1) * side - side * (count - 1) / 2 + middle
    cells = np.stack(
        [cv2.getRectSubPix(grey.astype(np.float32), (side, side), (x, y)).ravel() for x, y in at]
    )
    cells -= cells.mean(1, keepdims=True)
    template = cells[400]
    for _ in range(4):
        alike = cells @ template / np.linalg.norm(cells, axis=1) / np.linalg.norm(template)
        best = np.argsort(-alike)[:24]
        template = cells[best].mean(0)
    picked = np.stack([i, j], 1)[best]
    evidence, step = picture(grey), side / SIDE * 100
    pattern = compile(parse(f"SetCameraPose(rx=0, ry=0)\n{rows(step)}\n"))
    as_one = recurrence_bits(evidence, pattern, torch.from_numpy(picked).double(), focal_mm=35.0, cells=True)
    assert as_one > 2 * CHANCE
    assert rows_saved(evidence, step, picked) < CHANCE


def test_rows_come_again_along_both_steps_or_not_at_all() -> None:
    generator = np.random.default_rng(2)
    lattice, bars = np.full((SIDE, SIDE), 0.7), np.full((SIDE, SIDE), 0.7)
    index = np.stack(np.meshgrid(np.arange(7), np.arange(7), indexing="ij"), -1).reshape(-1, 2)
    at = (index - 3) * 30 + (SIDE - 1) / 2
    for x, y in at:
        cv2.circle(lattice, (round(x), round(y)), 7, 0.1, -1, cv2.LINE_AA)
    for y in np.unique(at[:, 1]):  # what each row has is its own, and does not come again in it
        shown = generator.uniform(0.2, 0.9, 12)
        for k, x in enumerate(np.linspace(20, SIDE - 20, 12)):
            cv2.circle(bars, (round(x + generator.uniform(-8, 8)), round(y)), 7, shown[k], -1, cv2.LINE_AA)
    assert rows_saved(picture(lattice + 0.02 * (noise(3) - 0.5)), 10, index) > 200
    assert rows_saved(picture(bars + 0.02 * (noise(3) - 0.5)), 10, index) < CHANCE


def test_few_large_cells_that_the_frame_cuts_count_where_they_are_whole() -> None:
    step, grey = 130, np.full((SIDE, SIDE), 0.7)  # pixels: 2.3 cells a side, of which one is whole
    index = np.stack(np.meshgrid(np.arange(3), np.arange(3), indexing="ij"), -1).reshape(-1, 2)
    for x, y in (index - 1) * step + (SIDE - 1) / 2:
        cv2.ellipse(grey, (round(x), round(y)), (30, 18), 25, 0, 360, 0.1, -1, cv2.LINE_AA)
        cv2.circle(grey, (round(x + 30), round(y + 40)), 8, 0.4, -1, cv2.LINE_AA)
    evidence = picture(grey + 0.05 * (noise(3) - 0.5))
    in_units = step / SIDE * 100
    pattern = compile(parse(f"SetCameraPose(rx=0, ry=0)\n{rows(in_units, count=3)}\n"))
    draws = torch.from_numpy(index).double()
    moved = whole_cells(evidence, pattern, draws, pattern.theta, focal_mm=35.0)
    assert (moved - draws).abs().tolist() == [[0.25, 0.25]] * 9  # a quarter on there are four
    plain = picture(noise(4, blur=4))
    assert rows_saved(evidence, in_units, index, count=3) > 10 > rows_saved(plain, in_units, index, count=3)
    middle = draws[4:5]
    assert torch.equal(whole_cells(evidence, pattern, middle, pattern.theta, focal_mm=35.0), middle)

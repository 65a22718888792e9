"""Instances: known places are found to a few hundredths of a cell, and the fit goes where they lie."""

import math

import cv2
import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import PATTERN, blank_level, lattice_error, pose_error_deg, turned

from p3i.search.config import SearchConfig
from p3i.search.fit.grow import on_instances
from p3i.search.fit.robust import fitted
from p3i.search.forms.lattice import Lattice, map_from_index
from p3i.search.look.correlate import Instances, correlate, find_instances
from p3i.search.look.evidence import Evidence
from p3i.vision.image import Image

STEP_PX = 40.0
ROWS, COLUMNS = 7, 9


def board(shifts: np.ndarray, *, missing: frozenset[int] = frozenset()) -> tuple[Image, Lattice]:
    """Flowers, seen straight on, each `shifts` [N, 2] (in cells) off its place; the lattice of places."""
    side = 4  # drawn larger, then averaged: places are true to a fraction of a pixel
    canvas = np.full((320 * side, 400 * side, 3), 150, np.uint8)
    for place, (i, j) in enumerate(np.ndindex(COLUMNS, ROWS)):
        if place in missing:
            continue
        x, y = (np.array([40.0, 40.0]) + STEP_PX * (np.array([i, j]) + shifts[place]) + 0.5) * side
        for turn in np.arange(5) * 2 * np.pi / 5:
            at = (round(x + 8 * side * np.cos(turn)), round(y + 8 * side * np.sin(turn)))
            cv2.circle(canvas, at, round(4.5 * side), (40, 60, 170), -1)
        cv2.circle(canvas, (round(x), round(y)), round(4 * side), (240, 220, 90), -1)
    pixels = cv2.resize(canvas, (400, 320), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    noise = np.random.default_rng(0).normal(0, 0.01, pixels.shape)
    image = Image((pixels + noise).clip(0, 1).astype(np.float32), np.ones(pixels.shape[:2], bool))
    unit = image.size.unit_px
    origin = (np.array([40.0, 40.0]) - np.array(image.size.middle)) / unit
    return image, Lattice(0.0, 0.0, np.eye(2) * STEP_PX / unit, origin)


def every_index() -> torch.Tensor:
    return torch.tensor(list(np.ndindex(COLUMNS, ROWS)), dtype=torch.float64)


def found_on(image: Image, lattice: Lattice, weights: torch.Tensor | None = None) -> Instances:
    level = Evidence(image, SearchConfig(), 35.0).level_for(STEP_PX)
    index = every_index()
    weights = torch.ones(len(index)) if weights is None else weights
    return find_instances(level, PATTERN, lattice.theta(PATTERN), index, weights)


def test_known_shifts_are_found_to_a_few_hundredths_of_a_cell() -> None:
    shifts = np.random.default_rng(1).uniform(-0.12, 0.12, (ROWS * COLUMNS, 2))
    shifts -= shifts.mean(0)  # a shift of all is not seen: the mean cell shifts along
    found = found_on(*board(shifts))
    inner = found.certainty > 0
    assert int(inner.sum()) > 0.9 * len(shifts)
    away = (found.offsets.numpy() - shifts)[inner.numpy()]
    away -= np.median(away, axis=0)
    assert np.median(np.abs(away)) < 0.02
    assert np.abs(away).max() < 0.06


def test_a_peak_between_samples_is_found_to_a_tenth_of_one() -> None:
    """A smooth hill on a plane, and the same hill as the template: places lie between the samples."""
    rows, columns = torch.meshgrid(torch.arange(16.0), torch.arange(16.0), indexing="ij")

    def hill(row: float, column: float) -> torch.Tensor:
        return torch.exp(-((rows - row) ** 2 + (columns - column) ** 2) / (2 * 2.5**2))

    places = [(7.5, 7.5), (7.8, 7.2), (6.1, 8.85), (8.4, 7.5)]
    planes = torch.stack([hill(*place) for place in places])[:, None]
    template = hill(7.5, 7.5)[4:12, 4:12].expand(len(places), 1, 8, 8)
    offsets, _, lead = correlate(planes, torch.ones_like(planes), template)
    expected = np.array(places) - 7.5
    np.testing.assert_allclose(offsets.numpy(), expected, atol=0.1)
    assert (lead > 0.1).all()


def test_objects_in_their_places_have_no_offset_and_much_certainty() -> None:
    found = found_on(*board(np.zeros((ROWS * COLUMNS, 2))))
    assert float(found.offsets.abs().max()) < 0.02
    assert float(found.certainty.min()) > 0.7


def test_a_place_without_an_object_has_no_certainty() -> None:
    missing = frozenset({10, 31, 44})
    found = found_on(*board(np.zeros((ROWS * COLUMNS, 2)), missing=missing))
    gone = torch.zeros(ROWS * COLUMNS, dtype=torch.bool)
    gone[list(missing)] = True
    assert float(found.certainty[gone].max()) < 0.25 < 0.6 < float(found.certainty[~gone].min())


def test_one_shifted_object_stands_out_and_does_not_vouch_for_itself() -> None:
    shifts = np.zeros((ROWS * COLUMNS, 2))
    shifts[31] = (0.2, -0.15)
    only_itself = torch.zeros(len(shifts))
    only_itself[31] = 50.0  # weighs more than all the others, yet takes no part in its own mean
    only_itself[:20] = 1.0
    found = found_on(*board(shifts), weights=only_itself)
    np.testing.assert_allclose(found.offsets[31], shifts[31], atol=0.04)


TRUTH = Lattice(-32.0, 12.0, np.array([[7.0, 1.2], [-1.5, 8.0]]), np.array([2.0, -3.0]))
INDEX = torch.cartesian_prod(*[torch.arange(-4, 5, dtype=torch.float64)] * 2)


def instances_from(start: Lattice, *, strays: int = 0) -> Instances:
    """What a perfect eye would see of TRUTH from `start`; the first `strays` objects lie anywhere."""
    level = blank_level()
    there = np.c_[INDEX.numpy(), np.ones(len(INDEX))] @ map_from_index(level, PATTERN, TRUTH.theta(PATTERN)).T
    back = there @ np.linalg.inv(map_from_index(level, PATTERN, start.theta(PATTERN))).T
    offsets = back[:, :2] / back[:, 2:] - INDEX.numpy()
    offsets[:strays] += np.random.default_rng(0).uniform(-0.3, 0.3, (strays, 2))
    ones = torch.ones(len(INDEX))
    return Instances(INDEX, torch.from_numpy(offsets), ones, ones)


def moved(start: Lattice, found: Instances) -> Lattice:
    return Lattice.of(PATTERN, on_instances(blank_level(), PATTERN, start.theta(PATTERN), found))


def test_the_fit_recovers_a_camera_and_a_lattice_that_were_off() -> None:
    start = turned(TRUTH, rx_deg=3.0, ry_deg=-2.5, scale=1.03).moved_to(np.array([0.1, -0.15]))
    found = moved(start, instances_from(start))
    assert pose_error_deg(found, TRUTH) < 1e-3
    assert lattice_error(found.basis, TRUTH.basis) < 1e-4
    np.testing.assert_allclose(found.origin, TRUTH.origin, atol=1e-3)


def test_a_fifth_of_strays_hardly_moves_the_fit() -> None:
    start = turned(TRUTH, rx_deg=2.0, ry_deg=1.0)
    found = moved(start, instances_from(start, strays=len(INDEX) // 5))
    assert pose_error_deg(found, TRUTH) < 0.3
    assert lattice_error(found.basis, TRUTH.basis) < 0.01


@given(
    seed=st.integers(0, 10_000),
    shift=st.tuples(*[st.floats(-2, 2)] * 3),
    strays=st.integers(0, 8),
)
@settings(max_examples=40, deadline=None)
def test_numbers_come_back_whatever_a_quarter_of_strays_says(
    seed: int, shift: tuple[float, float, float], strays: int
) -> None:
    """A circle's centre and radius, from 32 points on it, some of them anywhere."""
    random = np.random.default_rng(seed)
    turn = torch.arange(32, dtype=torch.float64) * 2 * math.pi / 32
    around = torch.stack([turn.cos(), turn.sin()], 1)

    def points_of(numbers: torch.Tensor) -> torch.Tensor:
        return numbers[..., None, :2] + numbers[..., None, 2:] * around

    truth = torch.tensor([3.0, -5.0, 20.0], dtype=torch.float64)
    targets = points_of(truth) + torch.from_numpy(random.normal(0, 0.02, (32, 2)))
    lost = random.choice(32, strays, replace=False)
    targets[lost] += torch.from_numpy(random.uniform(-30, 30, (strays, 2)))
    found = fitted(
        points_of,
        truth + torch.tensor(shift, dtype=torch.float64),
        places=targets,
        whiten=(torch.eye(2, dtype=torch.float64) / 0.5).expand(32, 2, 2),
        weights=torch.ones(32, dtype=torch.float64),
        limits=torch.ones(3, dtype=torch.float64),
    )
    assert float((found.numbers - truth).abs().max()) < 0.3


def test_a_prior_holds_what_the_points_do_not_tell() -> None:
    def points_of(numbers: torch.Tensor) -> torch.Tensor:
        return numbers[..., None, :1].expand(*numbers.shape[:-1], 5, 2)  # the second number moves nothing

    two = torch.ones(2, dtype=torch.float64)
    found = fitted(
        points_of,
        torch.zeros(2, dtype=torch.float64),
        places=torch.full((5, 2), 4.0, dtype=torch.float64),
        whiten=torch.eye(2, dtype=torch.float64).expand(5, 2, 2),
        weights=torch.ones(5, dtype=torch.float64),
        limits=two,
        mean=torch.tensor([0.0, 7.0], dtype=torch.float64),
        known=torch.tensor([0.0, 1.0], dtype=torch.float64),
    )
    np.testing.assert_allclose(found.numbers, [4.0, 7.0], atol=0.02)

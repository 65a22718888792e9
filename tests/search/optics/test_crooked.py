"""Boards seen through a lens, and pages that are not flat: each is told for what it is."""

import dataclasses
import re

import cv2
import numpy as np
import pytest
import torch

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.interp.camera import rotation
from p3i.interp.lens import photo_from_straight
from p3i.search.config import SearchConfig
from p3i.search.fit.settle import Objects, objects_of, settled
from p3i.search.look.evidence import Evidence
from p3i.search.optics.lens import LensTold, lens_told
from p3i.size import Size
from p3i.vision.image import Image

SIZE = Size(448, 336)
RX_DEG, RY_DEG, STEP, DISC = -28.0, 17.0, 7.0, 2.3
FOCAL_UNITS = 35 / 36 * 100
INDEX = [(i, j) for i in range(-5, 6) for j in range(-4, 5)]
FINER = 4


def program(rx_deg: float = RX_DEG, ry_deg: float = RY_DEG) -> Program:
    """The board, flat, under a camera."""
    found = parse(
        f"SetCameraPose(rx={rx_deg:g}, ry={ry_deg:g})\nfor i in range(0, 11):\n    for j in range(0, 9):\n"
        f"        Draw(x={STEP:g}*i - {5 * STEP:g}, y={STEP:g}*j - {4 * STEP:g})\n"
    )
    assert isinstance(found, Program)
    return found


def seen(sheet: np.ndarray, *, k1: float = 0.0, curl: float = 0.0) -> np.ndarray:
    """Points [N, 2] of a sheet, in units, on the photo: [N, 2] pixels.

    The sheet is rolled about its middle column to a cylinder of the curvature `curl`, in 1 / units.
    """
    x, y = sheet.T
    bent = np.stack([np.sin(curl * x) / curl, y, (1 - np.cos(curl * x)) / curl], 1) if curl else None
    space = np.stack([x, y, np.zeros(len(x))], 1) if bent is None else bent
    at = space @ np.asarray(rotation(RX_DEG, RY_DEG)).T
    straight = at[:, :2] / (1 + at[:, 2:] / FOCAL_UNITS) * SIZE.unit_px + SIZE.middle
    return photo_from_straight(torch.from_numpy(straight), k1, size=SIZE)[0].numpy()


def photo(*, k1: float = 0.0, curl: float = 0.0) -> Image:
    """The board as discs on a sheet."""
    canvas = np.full((SIZE.height * FINER, SIZE.width * FINER, 3), (214, 210, 200), np.uint8)
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rim = DISC * np.stack([np.cos(turn), np.sin(turn)], 1)
    for i, j in INDEX:
        corners = (seen(rim + STEP * np.array([i, j]), k1=k1, curl=curl) + 0.5) * FINER - 0.5
        cv2.fillPoly(canvas, [np.round(corners * 16).astype(np.int32)], (40, 60, 120), cv2.LINE_AA, 4)
    pixels = cv2.resize(canvas, (SIZE.width, SIZE.height), interpolation=cv2.INTER_AREA).astype(np.float32)
    pixels = pixels / 255 + np.random.default_rng(0).normal(0, 0.01, pixels.shape).astype(np.float32)
    return Image(pixels.clip(0, 1), np.ones((SIZE.height, SIZE.width), bool))


def objects(*, k1: float = 0.0, curl: float = 0.0) -> Objects:
    """The objects of the flat program on a photo, after as many fits as a search makes."""
    evidence, found = Evidence(photo(k1=k1, curl=curl), SearchConfig(), 35.0), program()
    for _ in range(2):
        there = objects_of(evidence, found)
        assert there is not None
        found = settled(there).program()
    there = objects_of(evidence, found)
    assert there is not None
    return there


def told(**crooked: float) -> LensTold:
    return lens_told(objects(**crooked))


@pytest.mark.parametrize("k1", [-0.1, -0.04, 0.04, 0.15])
def test_a_board_tells_the_lens_that_it_is_seen_through(k1: float) -> None:
    found = told(k1=k1)
    assert found.worth > 0 and found.crooked is None
    assert found.k1 == pytest.approx(k1, abs=0.02)
    camera = found.fit.program().camera
    assert (camera.rx_deg, camera.ry_deg) == pytest.approx((RX_DEG, RY_DEG), abs=0.3)


def test_a_flat_board_seen_straight_tells_of_nothing() -> None:
    found = told()
    assert found.worth < 0 and found.crooked is None


@pytest.mark.parametrize("curl", [0.003, -0.006])
def test_a_page_that_is_rolled_is_not_flat_and_seen_through_no_lens(curl: float) -> None:
    found = told(curl=curl)
    assert found.worth < 0 and found.crooked is not None
    assert found.crooked.startswith("not flat: objects lie up to")
    off_px = float(re.findall(r"[\d.]+", found.crooked)[0])
    # By how much the homography that is best in least squares misses.
    at = np.array(INDEX, float) * STEP
    rolled = seen(at, curl=curl).astype(np.float64)
    flat = cv2.perspectiveTransform(at[None], cv2.findHomography(at, rolled)[0])[0]
    assert off_px == pytest.approx(np.linalg.norm(flat - rolled, axis=1).max(), rel=0.6)


def test_a_bend_rolls_the_page_to_a_cylinder_that_keeps_its_lengths() -> None:
    there = objects()
    theta = there.filling.theta(there.numbers)
    at = there.filling.pattern.points_at(there.index, theta).numpy()
    middle = at.mean(0)
    curl, along = 0.006, np.array([0.6, -0.8])
    u = (at - middle) @ along
    rolled = at + np.outer(np.sin(curl * u) / curl - u, along)
    space = np.c_[rolled, (1 - np.cos(curl * u)) / curl] @ np.asarray(rotation(theta[0], theta[1])).T
    expected = space[:, :2] / (1 + space[:, 2:] / FOCAL_UNITS) * SIZE.unit_px + SIZE.middle
    x, y = along
    bend = curl / 2 * np.linalg.norm(at - middle, axis=1).max() * np.array([x * x, 2 * x * y, y * y])
    found = there.seen(torch.cat([there.numbers, torch.from_numpy(bend)]), ("bend",)).numpy()
    flat = there.seen(there.numbers).numpy()
    assert np.abs(expected - flat).max() > 5
    np.testing.assert_allclose(found, expected, atol=0.02)


def test_k1_is_to_first_order_that_of_the_polynomial_that_opencv_knows() -> None:
    there = objects()
    theta = there.filling.theta(there.numbers)
    at = there.filling.pattern.points_at(there.index, theta).numpy()
    focal_px, k = 35 / 36 * SIZE.longer, -0.08
    lens = np.array([[focal_px, 0, SIZE.middle[0]], [0, focal_px, SIZE.middle[1]], [0, 0, 1]])
    turn = np.asarray(rotation(float(theta[0]), float(theta[1])))
    space = np.c_[at, np.zeros(len(at))]
    bent = cv2.projectPoints(
        space, cv2.Rodrigues(turn)[0], np.array([0, 0, FOCAL_UNITS]), lens, np.array([k, 0, 0, 0.0])
    )[0][:, 0]
    moved = dataclasses.replace(there, places=torch.from_numpy(bent))
    half_diagonal = 0.5 * np.hypot(SIZE.width, SIZE.height)
    expected = k * (half_diagonal / focal_px) ** 2
    assert settled(moved, "lens").number("lens") == pytest.approx(expected, rel=0.05)

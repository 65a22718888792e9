"""Patterns whose rows a person sees at once, from the photo to the program."""

import cv2
import numpy as np
import pytest

from p3i.grammar.ast import Affine
from p3i.interp.unroll import nest
from p3i.search.config import SearchConfig
from p3i.search.synthesize import synthesize
from p3i.vision.image import Image

CONFIG = SearchConfig(structure="lattice")
FINER = 3


def image_of(pixels: np.ndarray) -> Image:
    noise = np.random.default_rng(1).normal(0, 0.015, pixels.shape)
    values = np.clip(pixels.astype(np.float32) / 255 + noise, 0, 1).astype(np.float32)
    return Image(values, np.ones(values.shape[:2], bool))


def steps_of(program) -> np.ndarray:
    draw = nest(program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    return np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]])


def asymmetric_circles() -> Image:
    """A sheet of 6 rows of 3 circles, every other one shifted by half, that leans back and to one side."""
    board = np.full((900, 700), 255, np.uint8)
    for row in range(6):
        for column in range(3):
            at = (120 + 200 * column + 100 * (row % 2), 110 + 130 * row)
            cv2.circle(board, at, 38, 0, -1, cv2.LINE_AA)
    sheet = np.array([[0, 0], [700, 0], [700, 900], [0, 900]], np.float32)
    seen = np.array([[195, 60], [380, 90], [360, 320], [75, 280]], np.float32)
    matrix = cv2.getPerspectiveTransform(sheet, seen)
    wide = np.diag([FINER, FINER, 1.0]) @ matrix
    fine = cv2.warpPerspective(board, wide, (500 * FINER, 375 * FINER), borderValue=(140,))
    seen = cv2.GaussianBlur(cv2.resize(fine, (500, 375), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    return image_of(np.repeat(seen[..., None], 3, axis=2))


def bricks(turn_deg: float) -> Image:
    """A wall of bricks that fills the picture, turned in it."""
    wall = np.full((900, 900, 3), (190, 185, 175), np.uint8)
    for row in range(25):
        for column in range(-1, 9):
            x, y = 120 * column + 60 * (row % 2), 40 * row
            shade = (165, 75, 55)
            cv2.rectangle(wall, (x + 4, y + 4), (x + 115, y + 35), shade, -1)
            cv2.line(wall, (x + 20, y + 12), (x + 50, y + 12), (140, 60, 45), 3)
    turn = cv2.getRotationMatrix2D((450.0, 450.0), turn_deg, 0.75)
    turn[:, 2] += np.array([210 - 450, 160 - 450])
    return image_of(cv2.warpAffine(wall, turn, (420, 320), flags=cv2.INTER_AREA))


def test_a_sheet_of_asymmetric_circles_is_its_circles_and_none_besides() -> None:
    found = synthesize(asymmetric_circles(), CONFIG)
    assert found.program is not None
    assert len(found.centers) == 18


@pytest.mark.parametrize("turn_deg", [0.0, 12.0])
def test_a_wall_is_told_by_its_rows_of_bricks(turn_deg: float) -> None:
    found = synthesize(bricks(turn_deg), CONFIG)
    assert found.program is not None
    row = max(steps_of(found.program), key=lambda step: float(step @ step))
    assert abs(np.degrees(np.arctan2(row[1], row[0])) + turn_deg) < 3
    assert np.linalg.norm(row) * 4.2 == pytest.approx(90, rel=0.05)

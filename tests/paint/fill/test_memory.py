"""Filling takes a bounded part of memory beside the picture, however much of it is hidden."""

import tracemalloc

import numpy as np
import pytest

from p3i import loads
from p3i.paint.fill.stack import fill_in_place
from p3i.place.placed import placed
from p3i.vision.image import Image

WIDTH, HEIGHT, PITCH_PX = 1200, 900, 100
UNIT = 100 / WIDTH
WAVES = f"""# /// p3p
# version = 1
# canvas = [{WIDTH}, {HEIGHT}]
# focal = 35.0
# ///
SetCameraPose(rx=0, ry=0)
for i in range(0, {WIDTH // PITCH_PX}):
    for j in range(0, {HEIGHT // PITCH_PX}):
        Draw(x={PITCH_PX * UNIT}*i - {(WIDTH - PITCH_PX) / 2 * UNIT},
             y={PITCH_PX * UNIT}*j - {(HEIGHT - PITCH_PX) / 2 * UNIT})
"""


def waves() -> Image:
    """A large picture at no cost: waves that come again with every cell."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32) * np.float32(2 * np.pi / PITCH_PX)
    wave = 0.5 + 0.25 * np.cos(x) * np.cos(y)
    pixels = np.stack([wave, 0.8 * wave, 1 - wave], -1).astype(np.float32)
    return Image(pixels, np.ones((HEIGHT, WIDTH), bool))


@pytest.fixture(scope="module")
def peaks() -> list[float]:
    """The most memory that a fill of a fifth and of three fifths of a picture takes, in pictures."""
    photo = waves()
    found: list[float] = []
    for share in (0.2, 0.6):
        hole = np.zeros(photo.valid.shape, bool)
        hole[:, round(WIDTH * (1 - share)) :] = True
        pixels = photo.pixels.copy()
        tracemalloc.start()
        try:
            fill_in_place(pixels, photo.valid, hole, placed(loads(WAVES), photo), most_tried=6)
            found.append(tracemalloc.get_traced_memory()[1] / pixels.nbytes)
        finally:
            tracemalloc.stop()
        assert np.abs(pixels - photo.pixels).mean() < 1 / 255
    return found


def test_a_fill_takes_few_pictures_of_memory(peaks: list[float]) -> None:
    assert max(peaks) < 3


def test_a_larger_hole_takes_hardly_more_memory(peaks: list[float]) -> None:
    """What is summed and carried is held by strips: three times the hole was 1.4 pictures more before."""
    assert peaks[1] < peaks[0] + 0.5

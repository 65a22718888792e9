import cv2
import numpy as np

from p3i.vision.lab import lab_of


def test_known_colours_have_their_known_places():
    srgb = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [0, 0, 0], [0.5, 0.5, 0.5]]], np.float32)
    expected = [
        [53.24, 80.09, 67.20],
        [87.73, -86.18, 83.18],
        [32.30, 79.19, -107.86],
        [100, 0, 0],
        [0, 0, 0],
        [53.39, 0, 0],
    ]
    np.testing.assert_allclose(lab_of(srgb)[0], expected, atol=0.05)


def test_lab_equals_opencv_within_its_table():
    pixels = np.random.default_rng(0).random((64, 64, 3), np.float32)
    difference = np.abs(lab_of(pixels) - cv2.cvtColor(pixels, cv2.COLOR_RGB2LAB))
    assert difference.max() < 1
    assert difference.mean() < 0.1

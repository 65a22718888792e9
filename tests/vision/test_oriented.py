import time

import numpy as np
import pytest
import torch

from p3i.vision.image import Image
from p3i.vision.oriented import oriented


def picture(pixels: np.ndarray, valid: np.ndarray | None = None) -> Image:
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    known = np.ones(pixels.shape[:2], bool) if valid is None else valid
    return Image(np.ascontiguousarray(pixels, dtype=np.float32), known)


def wave(angle_deg: float, size: int = 81) -> np.ndarray:
    """A soft grey edge through the middle whose gradient points along `angle_deg` (x right, y down)."""
    y, x = np.mgrid[0:size, 0:size] - (size - 1) / 2
    along = x * np.cos(np.radians(angle_deg)) + y * np.sin(np.radians(angle_deg))
    return 0.5 + 0.3 * np.tanh(along / 3)


@pytest.mark.parametrize("angle", [0, 30, 45, 90, 120, 170])
def test_the_channels_are_the_strength_and_twice_the_direction_of_the_gradient(angle):
    values = oriented(picture(wave(angle))).values[:, 40, 40]
    root, cosine, sine = values[:3].tolist()
    assert root > 1
    assert cosine / root == pytest.approx(np.cos(2 * np.radians(angle)), abs=0.02)
    assert sine / root == pytest.approx(np.sin(2 * np.radians(angle)), abs=0.02)


def test_the_strength_is_the_root_of_the_lab_gradient_at_sigma_1():
    # A grey ramp whose lightness rises by 0.5 a pixel: L is linear in f(Y), so build Y from L.
    lightness = 20 + 0.5 * np.arange(100)
    y = ((lightness + 16) / 116) ** 3
    srgb = np.where(y <= 0.0031308, 12.92 * y, 1.055 * y ** (1 / 2.4) - 0.055)
    found = oriented(picture(np.tile(srgb, (30, 1))))
    torch.testing.assert_close(found.values[0, 15, 10:90], torch.full((80,), 0.5**0.5), atol=2e-3, rtol=0)
    # Grey has no colour: a and b carry nothing to speak of.
    assert found.values[3:, :, 10:90].abs().max() < 0.05


def test_black_on_white_and_white_on_black_are_the_same():
    # Symmetric in lightness only nearly: compare the directions.
    one, other = oriented(picture(wave(30))).values, oriented(picture(1 - wave(30))).values
    middle = (slice(0, 3), 40, 40)
    torch.testing.assert_close(one[middle], other[middle], rtol=0.05, atol=0.02)


def test_a_flat_picture_has_no_features():
    assert oriented(picture(np.full((20, 30), 0.4))).values.abs().max() < 0.01


def test_features_are_unknown_within_four_pixels_of_the_frame():
    valid = oriented(picture(wave(0))).valid
    assert valid[4:-4, 4:-4].all()
    assert int(valid.sum()) == 73 * 73


def test_unknown_pixels_never_leak():
    generator = np.random.default_rng(0)
    pixels = generator.random((60, 80, 3)).astype(np.float32)
    valid = np.ones((60, 80), bool)
    valid[20:33, 30:50] = False
    other = pixels.copy()
    other[~valid] = 1 - other[~valid]
    one, two = oriented(picture(pixels, valid)), oriented(picture(other, valid))
    assert torch.equal(one.values, two.values)
    assert torch.equal(one.valid, two.valid)
    assert not one.valid[16:37, 26:54].any()
    whole = oriented(picture(pixels))
    torch.testing.assert_close(one.values[:, one.valid], whole.values[:, one.valid])


def test_a_picture_of_one_pixel_has_no_known_feature():
    found = oriented(picture(np.zeros((1, 1))))
    assert found.values.shape == (9, 1, 1)
    assert not found.valid.any()


def test_it_costs_less_than_a_quarter_second():
    image = picture(np.random.default_rng(0).random((480, 640, 3)))
    torch.set_num_threads(1)
    oriented(image)
    start = time.process_time()
    oriented(image)
    assert time.process_time() - start < 0.25

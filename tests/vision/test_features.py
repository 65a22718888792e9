import importlib.util

import numpy as np
import pytest
import torch

from p3i.errors import UsageError
from p3i.vision import features, lite0
from p3i.vision.features import DEFAULT, EXTRACTORS, extract
from p3i.vision.image import Image
from p3i.vision.raw import RawFeatures
from p3i.vision.warp import sample

has_lite0 = importlib.util.find_spec(lite0.PACKAGE) is not None


def photo(height: int = 90, width: int = 120) -> Image:
    """Soft random blotches in colour, with a hole."""
    generator = np.random.default_rng(0)
    coarse = torch.from_numpy(generator.random((1, 3, 12, 16)))
    pixels = torch.nn.functional.interpolate(coarse, (height, width), mode="bicubic")[0].clamp(0, 1)
    valid = np.ones((height, width), bool)
    valid[40:50, 60:75] = False
    return Image(pixels.permute(1, 2, 0).contiguous().float().numpy(), valid)


def available() -> list[str]:
    return [name for name in EXTRACTORS if name != "alexnet" and (name != "lite0" or has_lite0)]


@pytest.mark.parametrize("name", available())
@pytest.mark.parametrize("longer", [None, 60])
def test_every_extractor_gives_a_map_of_unit_energy_with_unknown_pixels_zero(name, longer):
    found = extract(photo(240, 320), name=name, longer=longer, channels=4)
    channels, height, width = found.values.shape
    assert found.values.dtype == torch.float32
    assert 1 <= channels <= 4
    assert found.valid.shape == (height, width)
    assert found.valid.any() and not found.valid.all()
    assert (found.values[:, ~found.valid] == 0).all()
    assert found.values.square().sum(0)[found.valid].mean() == pytest.approx(1, rel=1e-4)
    assert max(height, width) * found.stride == pytest.approx(320, abs=found.stride)


def test_the_default_needs_no_weights_and_is_known():
    assert DEFAULT in EXTRACTORS
    assert extract(photo()).stride == 1


def test_the_stride_counts_pixels_of_the_photo():
    found = extract(photo(240, 320), longer=80)
    assert found.stride == pytest.approx(4)
    assert (found.size.width, found.size.height) == (80, 60)


def test_points_of_the_photo_are_found_in_the_map():
    found = extract(photo(240, 320), longer=80)
    matrix = found.map_from_photo
    for u in (0.0, 13.25, 79.0):
        point = matrix @ torch.tensor([(u + 0.5) * 4 - 0.5, 1.5, 1.0], dtype=torch.float64)
        torch.testing.assert_close(point, torch.tensor([u, 0.0, 1.0], dtype=torch.float64))


def test_a_working_image_knows_the_photo_it_came_from():
    from p3i.vision.image import resized

    assert extract(resized(photo(240, 320), 160), longer=80).stride == pytest.approx(4)


@pytest.mark.skipif(not has_lite0, reason="the extra p3i[lite0] is missing")
def test_two_features_come_together_at_the_finer_stride_with_equal_shares():
    image = photo(240, 320)
    both = extract(image, name="oriented+lite0", channels=4)
    fine, coarse = extract(image, name="oriented", channels=4), extract(image, name="lite0", channels=4)
    first, second = fine.values.shape[0], coarse.values.shape[0]
    assert both.stride == 1
    assert both.values.shape == (first + second, 240, 320)
    assert not (both.valid & ~fine.valid).any()
    share = both.values[:first].square().sum() / both.values.square().sum()
    assert 0.4 < share < 0.6
    # A map pixel of lite0 lies at (u + 0.5) * 4 - 0.5: between whole pixels, where the two maps must agree.
    points = torch.tensor([[30.0, 20.0], [50.0, 40.0]])
    at = sample(both.values[first:], (points + 0.5) * 4 - 0.5)
    expected = sample(coarse.values, points)
    cosine = torch.nn.functional.cosine_similarity(at, expected, dim=-1)
    assert (cosine > 0.99).all()


def test_a_newcomer_adds_a_feature_with_a_function_and_one_line(monkeypatch):
    def brightness(image, weights):
        grey = torch.from_numpy(image.pixels).mean(2)[None]
        return RawFeatures(grey, torch.from_numpy(image.valid), 1.0)

    monkeypatch.setitem(features.EXTRACTORS, "brightness", brightness)
    assert extract(photo(), name="brightness").values.shape == (1, 90, 120)
    assert extract(photo(), name="rgb + brightness").values.shape == (4, 90, 120)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "sift"}, "no feature 'sift'; p3i knows oriented, rgb, lite0, alexnet"),
        ({"name": "oriented+"}, "no feature ''"),
        ({"channels": 0}, "at least one channel"),
        ({"name": "rgb", "weights": "w.pth"}, "rgb needs no weight file"),
        ({"name": "alexnet"}, "--weights FILE"),
    ],
)
def test_what_cannot_be_extracted_is_refused(options, message):
    with pytest.raises(UsageError, match=message):
        extract(photo(), **options)


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (8, 8), (9, 9)])
@pytest.mark.parametrize("name", available())
def test_tiny_pictures_have_a_map_too(size, name):
    image = Image(np.random.default_rng(0).random((*size, 3)).astype(np.float32), np.ones(size, bool))
    found = extract(image, name=name)
    assert torch.isfinite(found.values).all()


@pytest.mark.parametrize("name", available())
def test_a_picture_of_which_nothing_is_known_has_nothing_known_in_its_map(name):
    found = extract(Image(np.ones((40, 50, 3), np.float32), np.zeros((40, 50), bool)), name=name)
    assert not found.valid.any()
    assert (found.values == 0).all()


def test_the_same_photo_gives_the_same_map_twice():
    one, two = extract(photo(), name="oriented"), extract(photo(), name="oriented")
    assert torch.equal(one.values, two.values)

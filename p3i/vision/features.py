"""Photo -> feature map. A newcomer adds a feature with a function and one line in EXTRACTORS."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from p3i.errors import UsageError
from p3i.size import Size
from p3i.vision.alexnet import alexnet
from p3i.vision.fill import filled
from p3i.vision.image import Image, resized
from p3i.vision.lab import lab_of
from p3i.vision.lite0 import lite0
from p3i.vision.normalize import locally_normalized, principal, unit_energy
from p3i.vision.oriented import oriented
from p3i.vision.raw import RawFeatures
from p3i.vision.warp import pixel_grid, sample, sample_valid


@dataclass(frozen=True, slots=True, eq=False)
class FeatureMap:
    """Features of a photo on a grid.

    values float32 [C, H, W], mean of |F|^2 over known pixels 1, and 0 where not valid; valid bool [H, W].
    stride: photo pixels per map pixel.

    Convention: pixel centres at whole numbers in both; map point u is photo point (u + 0.5) * stride - 0.5,
    the same factor on both axes.
    """

    values: Tensor
    valid: Tensor
    stride: float

    @property
    def size(self) -> Size:
        """Width and height of the map."""
        return Size(self.valid.shape[1], self.valid.shape[0])

    @property
    def map_from_photo(self) -> Tensor:
        """The matrix [3, 3] (float64) that takes photo pixels to map pixels."""
        shift = 0.5 / self.stride - 0.5
        scale = 1 / self.stride
        rows = [[scale, 0, shift], [0, scale, shift], [0, 0, 1]]
        return torch.tensor(rows, dtype=torch.float64)


# An extractor sees the image at its working size, and the file given with --weights, if any.
Extractor = Callable[[Image, Path | None], RawFeatures]


def _rgb(image: Image, weights: Path | None) -> RawFeatures:
    """The colours alone, as Lab: poor on photos (DESIGN.md, 4.1), a baseline."""
    lab = torch.from_numpy(lab_of(filled(image.pixels, image.valid)))
    return RawFeatures(lab.permute(2, 0, 1).contiguous(), torch.from_numpy(image.valid), 1.0)


def _oriented(image: Image, weights: Path | None) -> RawFeatures:
    return oriented(image)


def _lite0(image: Image, weights: Path | None) -> RawFeatures:
    return lite0(image)


EXTRACTORS: dict[str, Extractor] = {
    "oriented": _oriented,
    "rgb": _rgb,
    "lite0": _lite0,
    "alexnet": alexnet,
}
# Those that read the file given with --weights.
_WITH_WEIGHTS = {"alexnet"}
DEFAULT = "oriented"


def extract(
    image: Image,
    *,
    name: str = DEFAULT,
    longer: int | None = None,
    weights: Path | None = None,
    channels: int = 4,
) -> FeatureMap:
    """The features of a photo, normalised locally, with mean energy 1.

    `name` is a key of EXTRACTORS, or several joined by `+`, whose maps are put together at the finest of
    their strides with equal energy. The photo is first reduced to `longer` pixels on its longer side (None:
    as it is; it is never enlarged). Each feature is reduced to its `channels` principal components.
    `weights` is the weight file of an extractor that asks for one. Raises UsageError for an unknown name,
    weights that nobody asks for, or fewer than one channel, and what the extractors raise.
    """
    if channels < 1:
        raise UsageError(f"features need at least one channel, not {channels}")
    names = [part.strip() for part in name.split("+")]
    for part in names:
        if part not in EXTRACTORS:
            raise UsageError(f"there is no feature {part!r}; p3i knows {', '.join(EXTRACTORS)}")
    if weights is not None and not _WITH_WEIGHTS & set(names):
        raise UsageError(f"--weights is for {', '.join(sorted(_WITH_WEIGHTS))}; {name} needs no weight file")
    working = image if longer is None else resized(image, longer)
    maps = [_normalized(EXTRACTORS[part](working, weights), channels) for part in names]
    found = maps[0] if len(maps) == 1 else _together(maps, working.size)
    return FeatureMap(found.values, found.valid, found.stride * working.stride)


def _normalized(raw: RawFeatures, channels: int) -> RawFeatures:
    local = locally_normalized(raw.values, raw.valid)
    few = principal(local, raw.valid, channels)
    return RawFeatures(unit_energy(few, raw.valid), raw.valid, raw.stride)


def _together(maps: list[RawFeatures], size: Size) -> RawFeatures:
    """Several maps of an image of `size`, on the grid of the finest; valid where all are."""
    finest = min(maps, key=lambda found: found.stride)
    points = pixel_grid(Size(finest.valid.shape[1], finest.valid.shape[0]))
    values, valid = [], torch.ones_like(finest.valid)
    for found in maps:
        if found.stride == finest.stride and found.valid.shape == finest.valid.shape:
            values.append(found.values)
            valid = valid & found.valid
            continue
        at = (points + 0.5) * (finest.stride / found.stride) - 0.5
        values.append(sample(found.values, at).movedim(-1, 0))
        valid = valid & sample_valid(found.valid, at)
    return RawFeatures(unit_energy(torch.cat(values), valid), valid, finest.stride)

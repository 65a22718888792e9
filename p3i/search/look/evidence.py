"""What the search looks at: a photo's features at several sizes and blurs, made when first asked for."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
import torch
from torch import Tensor

from p3i.interp.pattern import Pattern
from p3i.search.config import SearchConfig
from p3i.search.look.part import Box, Part, part_of
from p3i.size import Size
from p3i.vision.features import FeatureMap, extract
from p3i.vision.fill import filled
from p3i.vision.image import Image, resized
from p3i.vision.lab import lab_of

COARSE = 320
"""Longer side, in pixels, of the map on which patterns with large cells are found."""
FINE = 640
"""Longer side of the map for small cells and for the last refinement."""

# A cell is compared through a blur of this share of its side: wider than what its samples lie apart, so that
# gradients of the samples say where the next sample goes, narrow enough to keep the cell's own drawing.
_BLUR_SHARE = 0.1
# Colours are not reduced below this many pixels on the longer side.
_SMALLEST_MAP = 96
# What repeats at fewer pixels of the fine map than so many is not seen (docs/search.md).
_LEAST_PERIOD = 8.0
# Cells narrower than this on the coarse map are looked at on the fine one.
_LEAST_COARSE_CELL = 24.0


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """A blurred feature map and its derivatives.

    Convention: `stack` float32 [3C, H, W] holds the C channels, then their x and their y derivatives per
    map pixel; `valid` bool [H, W]; `map_from_photo` float64 [3, 3] takes photo pixels to map pixels.
    """

    stack: Tensor
    valid: Tensor
    map_from_photo: Tensor
    photo_size: Size
    focal_mm: float

    @property
    def channels(self) -> int:
        """C, the number of feature channels."""
        return self.stack.shape[0] // 3

    @property
    def values(self) -> Tensor:
        """The features alone, [C, H, W]."""
        return self.stack[: self.channels]

    @property
    def size(self) -> Size:
        """Width and height of the map."""
        return Size(self.valid.shape[1], self.valid.shape[0])

    @property
    def unit_px(self) -> float:
        """Map pixels in one program unit, where the plane is seen straight on."""
        return self.photo_size.unit_px * float(self.map_from_photo[0, 0])

    def map_from_plane(self, pattern: Pattern, theta: Tensor) -> Tensor:
        """The homography from program units to map pixels, [..., 3, 3], differentiable in theta."""
        seen = pattern.image_from_plane(theta, size=self.photo_size, focal_mm=self.focal_mm)
        return self.map_from_photo @ seen


@dataclass(frozen=True, slots=True, eq=False)
class ColourMap:
    """A photo's colours, reduced: `lab` float32 [H, W, 3], `valid` [H, W], `map_from_photo` [3, 3].

    `values` [3, H, W] are the same colours in the order that `vision.warp.sample` reads.
    """

    lab: np.ndarray
    values: Tensor
    valid: Tensor
    map_from_photo: Tensor


def _itself(points_px: Tensor) -> Tensor:
    return points_px


@dataclass(slots=True)
class Evidence:
    """A photo as the search sees it. Holds the maps that were made so far, nothing else changes.

    `image` is the whole photo, whose canvas is the camera's; `part` what of it is looked at, and what the
    maps are made of (look/part.py): the `window`, else its region of interest, else all of it.
    `on_photo` takes points [N, 2] in pixels of `image` to pixels of the photo as it is, where that is another
    canvas (look/straight.py).
    """

    image: Image
    config: SearchConfig
    focal_mm: float
    on_photo: Callable[[Tensor], Tensor] = _itself
    window: Box | None = None
    part: Part = field(init=False)
    _maps: dict[tuple[str, int], FeatureMap] = field(default_factory=dict)
    _levels: dict[tuple[str, int, float], Level] = field(default_factory=dict)
    _colours: dict[int, ColourMap] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.part = part_of(self.image, self.window)

    def under(self, focal_mm: float) -> "Evidence":
        """The same photo under another focal (mm); what does not depend on it is shared, not made again."""
        if focal_mm == self.focal_mm:
            return self
        return Evidence(
            self.image,
            self.config,
            focal_mm,
            self.on_photo,
            self.window,
            _maps=self._maps,
            _colours=self._colours,
        )

    def features(self, longer: int, *, name: str | None = None) -> FeatureMap:
        """The features of the part, its longer side reduced to `longer` pixels (never enlarged).

        `name` asks for other features than those of the search.
        """
        key = name or self.config.features_used, min(longer, self.part.size.longer)
        if key not in self._maps:
            self._maps[key] = extract(
                self.part.image, name=key[0], longer=key[1], weights=self.config.weights
            )
        return self._maps[key]

    def level(self, longer: int, *, blur: float, name: str | None = None) -> Level:
        """The map of that size, blurred by a Gaussian of `blur` map pixels, with its derivatives."""
        # Steps of a factor 2^(1/2) in blur: finer ones would only cost memory.
        step = round(2 * math.log2(max(blur, 0.5))) / 2
        key = name or self.config.features_used, min(longer, self.part.size.longer), step
        if key not in self._levels:
            self._levels[key] = _level(self, self.features(longer, name=name), 2.0**step)
        return self._levels[key]

    def colours_for(self, step_px: float) -> ColourMap:
        """The photo's colours on a map where samples `step_px` photo pixels apart are about a pixel apart."""
        halvings = min(5, max(0, round(math.log2(max(step_px, 1.0)) + 0.2)))
        while halvings and self.part.size.longer / 2**halvings < _SMALLEST_MAP:
            halvings -= 1
        if halvings not in self._colours:
            small = resized(self.part.image, math.ceil(self.part.size.longer / 2**halvings))
            lab = cv2.GaussianBlur(lab_of(filled(small.pixels, small.valid)), (0, 0), 0.7)
            shift, scale = 0.5 / small.stride - 0.5, 1 / small.stride
            matrix = torch.tensor([[scale, 0, shift], [0, scale, shift], [0, 0, 1.0]], dtype=torch.float64)
            matrix = matrix @ self.part.from_photo
            values = torch.from_numpy(lab).permute(2, 0, 1).contiguous()
            self._colours[halvings] = ColourMap(lab, values, torch.from_numpy(small.valid), matrix)
        return self._colours[halvings]

    def in_sight(
        self, pattern: Pattern, theta: Tensor | None = None, *, focal_mm: float | None = None
    ) -> Tensor:
        """Which of a program's draws are looked at, [N] bool; by its own numbers and the focal assumed."""
        size = self.image.size
        points, in_front = pattern.centers_px(theta, size=size, focal_mm=focal_mm or self.focal_mm)
        return in_front & self.part.shows(points)

    @property
    def least_period_px(self) -> int | None:
        """Steps of fewer photo pixels are too small for the finest map; None where that is not reduced."""
        reduced = self.part.size.longer / FINE
        return math.ceil(_LEAST_PERIOD * reduced) if reduced > 1 else None

    @property
    def frame(self) -> Level:
        """The map to measure places and sizes on: the coarse one as it is, which every search makes first."""
        return self.level(COARSE, blur=0.5)

    def level_for(self, cell_px: float, *, finest: bool = False, name: str | None = None) -> Level:
        """The map on which cells of `cell_px` photo pixels a side are compared best."""
        scale = min(1.0, COARSE / self.part.size.longer)
        longer = FINE if finest or cell_px * scale < _LEAST_COARSE_CELL else COARSE
        # No cell of a pattern is as large as the map, but one that runs to the horizon.
        cell = min(cell_px * min(1.0, longer / self.part.size.longer), longer)
        return self.level(longer, blur=_BLUR_SHARE * cell, name=name)


def _level(evidence: Evidence, features: FeatureMap, blur: float) -> Level:
    planes = features.values.numpy()
    count = len(planes)
    stack = np.empty((3 * count, *planes.shape[1:]), np.float32)
    for channel, plane in enumerate(planes):
        if blur > 0.6:  # the features themselves are blurred by a pixel already
            plane = cv2.GaussianBlur(plane, (0, 0), blur, borderType=cv2.BORDER_REPLICATE)
        stack[channel] = plane
        stack[count + channel] = cv2.Sobel(plane, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
        stack[2 * count + channel] = cv2.Sobel(plane, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
    return Level(
        torch.from_numpy(stack),
        features.valid,
        features.map_from_photo @ evidence.part.from_photo,
        evidence.image.size,
        evidence.focal_mm,
    )

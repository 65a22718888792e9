"""Drawings over a photo that its lens has bent: what a pinhole camera would see, moved to where it is seen.

Convention: pixels of the canvas; k1 and the two kinds of points as in p3i/interp/lens.py.
"""

import dataclasses
import math

import numpy as np

from p3i.interp.lens import straight_from_photo
from p3i.paint.draw.scene import Dots, Labels, Layer, Pixels, Strokes
from p3i.place.lens import bent_points
from p3i.size import Size
from p3i.vision.warp import pixel_grid, remapped

_PART_PX = 12.0
"""A bent line is drawn in straight parts of about this length."""


def bent(layer: Layer, size: Size, k1: float) -> Layer:
    """A drawn layer as the lens shows it: lines in parts, dots moved (not reshaped), pixels warped."""
    match layer:
        case Strokes():
            return dataclasses.replace(layer, segments=_bent_segments(layer.segments, size, k1))
        case Dots():
            centers, shown = bent_points(layer.centers, size, k1)
            return dataclasses.replace(
                layer,
                centers=centers[shown],
                axes=layer.axes[shown],
                angles_deg=layer.angles_deg[shown],
                colours=layer.colours[shown],
                rims=layer.rims[shown],
            )
        case Labels(texts=texts):
            anchors, shown = bent_points(layer.anchors, size, k1)
            kept = np.flatnonzero(shown)
            return dataclasses.replace(
                layer,
                texts=tuple(texts[place] for place in kept),
                anchors=anchors[kept],
                heights=layer.heights[kept],
            )
        case Pixels(values=values):
            straight = straight_from_photo(pixel_grid(size), k1, size=size).numpy()
            alpha = np.concatenate([values, np.full((*values.shape[:2], 1), 255, np.uint8)], 2)[:, :, :4]
            warped, known = remapped(alpha, np.ones(values.shape[:2], bool), straight)
            return Pixels(np.ascontiguousarray(warped * known[:, :, None].astype(np.uint8)))


def _bent_segments(segments: np.ndarray, size: Size, k1: float) -> np.ndarray:
    """Segments [S, 2, 2] cut into short parts, each part moved."""
    if not len(segments):
        return segments
    longest = float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max())
    parts = max(1, math.ceil(longest / _PART_PX))
    cuts = np.linspace(0, 1, parts + 1)[:, None]
    along = segments[:, None, 0] + cuts[None] * (segments[:, None, 1] - segments[:, None, 0])
    points, shown = bent_points(along, size, k1)
    pieces = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 2)
    return pieces[(shown[:, :-1] & shown[:, 1:]).ravel()]

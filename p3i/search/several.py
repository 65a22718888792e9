"""Every pattern of a photo, one after another: what one explains is masked before the next is sought.

Each is looked for, and judged, as if it were the only one; the first is the answer of a search for one.
"""

import dataclasses
import time
from collections.abc import Callable

import cv2
import numpy as np
import torch

from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.judge.region import photo_points, region_px
from p3i.search.look.patches import frames, spacing
from p3i.search.result import StopReason, SynthesisResult
from p3i.vision.image import Image, masked

MOST_PATTERNS = 24
"""So many patterns are looked for on a photo at most."""

# What is masked of a lattice reaches half a step beyond its cells, or the rest of those at its rim would be
# found as a pattern of their own.
_CORNERS = torch.tensor([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)], dtype=torch.float64)

Search = Callable[[Image, SearchConfig], SynthesisResult]


def all_patterns(image: Image, config: SearchConfig, search: Search) -> tuple[SynthesisResult, ...]:
    """The results of `search` for every pattern of a photo, the most worth first; or its one refusal.

    `config.time_s` is for all of them together; the last result says where that, or an interrupt, cut the
    search short. At most MOST_PATTERNS are looked for.
    """
    begun, found = time.monotonic(), []
    left, seen = config, image
    for _ in range(MOST_PATTERNS):
        result = search(seen, left)
        if result.program is None:
            return tuple(found) or (result,)
        ground = explained_ground(result, image)
        if not found or _is_new(result, seen):
            found.append(dataclasses.replace(result, others=(), notes=_own_notes(result)))
        if result.stop is not StopReason.FOUND:
            break
        seen = masked(seen, ground)
        if config.time_s is not None:
            rest = config.time_s - (time.monotonic() - begun)
            if rest <= 0:
                break
            left = dataclasses.replace(config, time_s=rest)
    return tuple(found)


def explained_ground(result: SynthesisResult, image: Image) -> np.ndarray:
    """Where a photo shows what the program of a result explains: bool [H, W].

    Of rings all that they surround, of a lattice its cells and half a step around.
    """
    canvas = np.zeros(image.valid.shape, np.uint8)
    program = result.program
    if program is None:
        return canvas.astype(bool)
    if result.structure != "lattice":
        hull = region_px(program, image, result.focal_mm, lens_k1=result.lens_k1)
        if hull:
            cv2.fillConvexPoly(canvas, np.round(np.array(hull)).astype(np.int32), 1)
        return canvas.astype(bool)
    pattern = compile(program)
    index = pattern.index.double()
    where = frames(pattern, pattern.theta, index, side=spacing(pattern, pattern.theta))
    corners = where.points(_CORNERS[None]).reshape(-1, 2)
    pixels, shown = photo_points(program, corners, image.size, result.focal_mm, lens_k1=result.lens_k1)
    # Far corners of cells beyond the frame would overflow the whole numbers that OpenCV counts in.
    places = pixels.nan_to_num().clamp(-(2.0**14), 2.0**14).round().int().numpy().reshape(-1, 4, 2)
    for polygon in places[shown.numpy().reshape(-1, 4).all(1)]:
        cv2.fillConvexPoly(canvas, polygon, 1)
    return canvas.astype(bool)


def _is_new(result: SynthesisResult, seen: Image) -> bool:
    """Whether at least half of a result's objects lie on ground that is not explained yet."""
    if not result.centers:
        return False
    x, y = np.round(np.array(result.centers)[:, :2]).astype(int).T
    known = seen.valid[y.clip(0, seen.size.height - 1), x.clip(0, seen.size.width - 1)]
    return float(known.mean()) >= 1 / 2


def _own_notes(result: SynthesisResult) -> tuple[str, ...]:
    """The notes of a result without that of the others, which have programs of their own here."""
    return tuple(note for note in result.notes if "synth --all" not in note)

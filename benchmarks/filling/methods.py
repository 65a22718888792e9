"""The ways to fill a hole that are compared, each as a function from photo, program and hole to pixels."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np

import p3i
from filling.quilting import quilted
from p3i.vision.image import Image

METHODS = ("stack", "npn", "guided patchmatch", "patchmatch", "quilting", "telea", "ns")
_OPENCV_RADIUS_PX = 3
_PATCH_RADIUS_PX = 7

Fill = Callable[[Image, p3i.Program, np.ndarray], np.ndarray]
"""A photo whose hole is black, its program, the hole bool [H, W] -> pixels float32 [H, W, 3] in 0..1."""


def fills(methods: Sequence[str], options: Mapping[str, Any]) -> dict[str, Fill]:
    """The ways of these names; `options` are fields of InpaintOptions for the network."""

    def ours(method: str, **changes: Any) -> Fill:
        return lambda photo, program, hole: (
            p3i.inpaint(photo, program, mask=hole, method=method, **changes).pixels
        )

    def opencv(flag: int) -> Fill:
        return lambda photo, _program, hole: _pixels(
            cv2.inpaint(_values(photo), _unknown(photo, hole).astype(np.uint8), _OPENCV_RADIUS_PX, flag)
        )

    known = {
        "stack": ours("stack"),
        "npn": ours("npn", **options),
        "guided patchmatch": ours("patchmatch"),
        "patchmatch": _plain_patchmatch,
        "quilting": lambda photo, _program, hole: quilted(photo.pixels, _unknown(photo, hole)),
        "telea": opencv(cv2.INPAINT_TELEA),
        "ns": opencv(cv2.INPAINT_NS),
    }
    return {name: known[name] for name in methods}


def _plain_patchmatch(photo: Image, _program: p3i.Program, hole: np.ndarray) -> np.ndarray:
    from patchmatch import patch_match

    patch_match.set_random_seed(0)
    unknown = _unknown(photo, hole).astype(np.uint8)
    return _pixels(patch_match.inpaint(_values(photo), unknown, patch_size=_PATCH_RADIUS_PX))


def _unknown(photo: Image, hole: np.ndarray) -> np.ndarray:
    """The hole and what is transparent: no method but p3i's knows of that otherwise."""
    return hole | ~photo.valid


def _values(photo: Image) -> np.ndarray:
    return np.rint(photo.pixels * 255).astype(np.uint8)


def _pixels(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32) / 255

"""What the network features share: weight files, and maps that lie where p3i's convention wants them."""

import io
import pickle
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from p3i.errors import FileError
from p3i.files import read_bytes
from p3i.vision.fill import eroded


def load_weights(path: Path, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Tensor]:
    """The tensors named in `shapes` from a torch state dict, as float32; other entries are left alone.

    The file is loaded as data only (weights_only=True): it cannot run code. Raises FileError where it is
    missing, no state dict, or has an entry missing or of another shape.
    """
    return tensors_of(read_bytes(path), shapes, name=str(path))


def tensors_of(data: bytes, shapes: Mapping[str, tuple[int, ...]], *, name: str) -> dict[str, Tensor]:
    """`load_weights` of bytes in memory; `name` is what messages call them."""
    try:
        state = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except pickle.UnpicklingError:
        raise FileError(f"{name} is no plain torch state dict: p3i loads tensors only, never code") from None
    except Exception as error:  # torch raises whatever a damaged archive leads it to
        reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise FileError(f"{name} is no torch weight file: {reason}") from None
    if not isinstance(state, Mapping):
        raise FileError(f"{name} holds a {type(state).__name__}, not a state dict")
    found = {}
    for key, shape in shapes.items():
        tensor = state.get(key)
        if not isinstance(tensor, Tensor):
            raise FileError(f"{name} has no {key}: these are the weights of another network")
        if tuple(tensor.shape) != shape:
            raise FileError(f"{name}: {key} is {tuple(tensor.shape)}, expected {shape}")
        found[key] = tensor.float()
    return found


def centred(values: Tensor, shift: float) -> Tensor:
    """The map read `shift` of a pixel (0..1) further right and down, by linear mixing.

    Convention: a network's padding puts its pixel k somewhere inside the block of stride x stride image
    pixels that it stands for; p3i wants it in the middle. values [C, H, W] -> [C, H, W], the last row and
    column repeated.
    """
    for axis in (1, 2):
        length = values.shape[axis]
        following = torch.cat([values.narrow(axis, 1, length - 1), values.narrow(axis, length - 1, 1)], axis)
        values = torch.lerp(values, following, shift)
    return values


def known_blocks(valid: np.ndarray, *, stride: int, before: int, after: int, size: tuple[int, int]) -> Tensor:
    """Which map pixels see known image pixels only.

    Map pixel k reads the image pixels stride * k - before .. stride * k + after on both axes; `size` is the
    map's (height, width). Bool [height, width]; beyond the frame nothing is known.
    """
    reach = -(-(before + after) // 2)
    middle = reach - before
    whole = eroded(valid, reach)
    rows = stride * np.arange(size[0]) + middle
    columns = stride * np.arange(size[1]) + middle
    known = np.zeros(size, bool)
    inside = np.ix_(rows < valid.shape[0], columns < valid.shape[1])
    known[inside] = whole[np.ix_(rows[rows < valid.shape[0]], columns[columns < valid.shape[1]])]
    return torch.from_numpy(known)

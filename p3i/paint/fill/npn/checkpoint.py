"""The file that keeps a photo's training, and what ties it to its photo, program and options."""

import hashlib
import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import torch

from p3i.errors import FileError
from p3i.files import check_writable, read_bytes, write_bytes
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.npn.shipped import SHA256
from p3i.paint.fill.npn.training import Training
from p3i.place.placed import Placed
from p3i.vision.image import Image


def fingerprint(photo: Image, placed: Placed, options: NetworkOptions) -> str:
    """Names all that a photo's one training depends on, but for the hole that it was begun for."""
    digest = hashlib.sha256()
    for array in (
        photo.pixels * photo.valid[:, :, None],
        photo.valid,
        placed.image_from_plane,
        placed.points,
    ):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(repr((SHA256, photo.pixels.shape, options.seed)).encode())
    return digest.hexdigest()


def load(path: Path, key: str, training: Training) -> None:
    """Go on from a checkpoint, if there is one.

    Raises FileError for a file that is no checkpoint, one of another photo, program, seed or version, and
    for a place that cannot be written to.
    """
    check_writable(path, force=True)  # now, not after the first minutes
    if not path.exists():
        return
    saved = _read(path)
    if saved["key"] != key or "training" not in saved:
        raise FileError(
            f"the checkpoint {path} is of another photo, program or seed, or of an earlier p3i: name another "
            "file, or remove it"
        )
    training.restore(saved["training"])


def save(path: Path, key: str, training: Training) -> None:
    """Write the training; whole or not at all. Raises FileError where the file cannot be written."""
    packed = io.BytesIO()
    torch.save({"key": key, "training": training.state()}, packed)
    write_bytes(path, packed.getvalue(), force=True)


def _read(path: Path) -> dict:
    try:
        # weights_only: a checkpoint from elsewhere must not run code.
        found = torch.load(io.BytesIO(read_bytes(path)), map_location="cpu", weights_only=True)
    except (RuntimeError, ValueError, EOFError, pickle.UnpicklingError, zipfile.BadZipFile):
        raise FileError(f"{path} is no checkpoint of a painting network, or it is cut off") from None
    if not isinstance(found, dict) or "key" not in found:
        raise FileError(f"{path} is no checkpoint of a painting network")
    return found

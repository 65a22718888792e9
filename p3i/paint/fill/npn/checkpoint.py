"""The file that keeps a training, and what ties it to its photo, program, hole and options."""

import hashlib
import io
import pickle
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from p3i.errors import FileError
from p3i.files import check_writable, read_bytes, write_bytes
from p3i.options.npn import NetworkOptions
from p3i.paint.fill.npn.training import Training
from p3i.place.placed import Placed
from p3i.vision.image import Image

_VERSION = 2
# These may change between two runs of one training.
_FREE = ("steps", "time_s", "device", "threads", "checkpoint")


def fingerprint(photo: Image, placed: Placed, hole: np.ndarray, options: NetworkOptions) -> str:
    """Names all that a training depends on. What the `hole` [H, W] hides does not count."""
    digest = hashlib.sha256()
    known = photo.valid & ~hole
    for array in (photo.pixels * known[:, :, None], known, placed.image_from_plane, placed.points):
        digest.update(np.ascontiguousarray(array).tobytes())
    kept = {name: value for name, value in asdict(options).items() if name not in _FREE}
    digest.update(repr((_VERSION, photo.pixels.shape, sorted(kept.items()))).encode())
    return digest.hexdigest()


def load(path: Path, key: str, place: int, training: Training) -> bool:
    """Go on from a checkpoint, if there is one for hole number `place`; whether there was.

    Raises FileError for a file that is no checkpoint, or one of another photo, hole or options, and
    for a place that cannot be written to.
    """
    check_writable(path, force=True)  # now, not after the first minutes
    if not path.exists():
        return False
    saved = _read(path)
    if saved.get("key") != key:
        raise FileError(
            f"the checkpoint {path} is of another photo, program, mask or options: name another file, "
            "or remove it"
        )
    state = saved["holes"].get(place)
    if state is not None:
        training.restore(state)
    return state is not None


def save(path: Path, key: str, place: int, training: Training) -> None:
    """Write the training of hole number `place`, keeping those of the others; whole or not at all.

    Raises FileError where the file cannot be written.
    """
    holes = _read(path)["holes"] if path.exists() else {}
    packed = io.BytesIO()
    torch.save({"key": key, "holes": {**holes, place: training.state()}}, packed)
    write_bytes(path, packed.getvalue(), force=True)


def _read(path: Path) -> dict:
    try:
        # weights_only: a checkpoint from elsewhere must not run code.
        found = torch.load(io.BytesIO(read_bytes(path)), map_location="cpu", weights_only=True)
    except (RuntimeError, ValueError, EOFError, pickle.UnpicklingError, zipfile.BadZipFile):
        raise FileError(f"{path} is no checkpoint of a painting network, or it is cut off") from None
    if not isinstance(found, dict) or not {"key", "holes"} <= set(found):
        raise FileError(f"{path} is no checkpoint of a painting network")
    return found

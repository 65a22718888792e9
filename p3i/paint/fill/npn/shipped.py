"""The weights that every training starts from: they ship with p3i, made by scripts/train_npn.py.

A file of plain numbers (numpy's npz, float16), read without pickle: it cannot run code.
"""

import hashlib
import io
from importlib import resources

import numpy as np
import torch
from torch import Tensor

from p3i.errors import FileError
from p3i.paint.fill.npn.network import PaintingNetwork, PatchDiscriminator

NAME = "weights.npz"
SHA256 = "3162fac52084dc9e73fc613b86453352c0af41701c3e5bf26793ef7cc85aaaa0"
"""Of the file; docs/npn.md states it with the seeds that it was made from."""


def shipped() -> dict[str, dict[str, Tensor]]:
    """The weights of "generator" and "discriminator" by their names, float32 [...].

    Raises FileError where the file is not ours.
    """
    try:
        data = (resources.files("p3i.paint.fill.npn") / NAME).read_bytes()
    except OSError:
        raise FileError(
            f"p3i lacks its file {NAME} with the painting network's weights: install it again"
        ) from None
    if hashlib.sha256(data).hexdigest() != SHA256:
        raise FileError(f"the file {NAME} with the painting network's weights was changed: install p3i again")
    return unpacked(data)


def unpacked(data: bytes) -> dict[str, dict[str, Tensor]]:
    """The weights in a file that `packed` made, float32 [...] by network and name."""
    found: dict[str, dict[str, Tensor]] = {"generator": {}, "discriminator": {}}
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        for name in arrays.files:
            network, part = name.split("/")
            found[network][part] = torch.from_numpy(arrays[name].astype(np.float32))
    return found


def packed(generator: PaintingNetwork, discriminator: PatchDiscriminator) -> bytes:
    """The weights of two networks as a file: equal weights, equal bytes."""
    arrays = {
        f"{name}/{part}": values.detach().cpu().numpy().astype(np.float16)
        for name, network in (("generator", generator), ("discriminator", discriminator))
        for part, values in network.state_dict().items()
    }
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)  # zip entries of numpy's carry one fixed date
    return file.getvalue()

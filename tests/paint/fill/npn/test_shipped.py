"""The weights that ship with p3i: small, plain numbers, and those that the documents name."""

import hashlib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import torch
from painted import Scene, batch

from p3i.errors import FileError
from p3i.evaluation.scenes import scene as rendered
from p3i.paint.fill.npn import shipped
from p3i.paint.fill.npn.network import PaintingNetwork, PatchDiscriminator, plain
from p3i.paint.fill.npn.training import hole_error
from p3i.place.placed import placed

ROOT = Path(__file__).parents[4]


def data() -> bytes:
    return (resources.files("p3i.paint.fill.npn") / shipped.NAME).read_bytes()


def test_the_file_is_that_of_the_documents_and_small() -> None:
    assert hashlib.sha256(data()).hexdigest() == shipped.SHA256
    assert shipped.SHA256 in (ROOT / "docs" / "npn.md").read_text(encoding="utf-8")
    assert len(data()) < 2_000_000


def test_it_holds_numbers_only(tmp_path: Path) -> None:
    (tmp_path / "weights.npz").write_bytes(data())
    with np.load(tmp_path / "weights.npz", allow_pickle=False) as arrays:
        assert {arrays[name].dtype for name in arrays.files} == {np.dtype(np.float16)}


def test_it_fits_the_networks_and_is_packed_alike() -> None:
    generator, discriminator = PaintingNetwork(), PatchDiscriminator()
    generator.load_state_dict(shipped.shipped()["generator"])
    discriminator.load_state_dict(shipped.shipped()["discriminator"])
    assert shipped.packed(generator, discriminator) == data()


def test_a_file_that_was_changed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "SHA256", "0" * 64)
    with pytest.raises(FileError, match="was changed"):
        shipped.shipped()
    monkeypatch.setattr(shipped, "NAME", "nowhere.npz")
    with pytest.raises(FileError, match="lacks its file"):
        shipped.shipped()


def test_on_scenes_that_it_has_not_seen_it_paints_better_than_a_weighted_mean() -> None:
    network = PaintingNetwork()
    network.load_state_dict(shipped.shipped()["generator"])
    before, after = 0.0, 0.0
    for seed in (104, 105, 106, 107):
        drawn = rendered("lattice", seed)
        photo = drawn.image()
        found = Scene(photo, placed(drawn.program, photo), np.zeros(photo.valid.shape, bool))
        lessons = batch(found, count=12)
        before += float(hole_error(plain(lessons).fill, lessons).mean())
        with torch.no_grad():
            after += float(hole_error(network(lessons).fill, lessons).mean())
    assert after < 0.98 * before

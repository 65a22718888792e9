"""A library gives back what it borrows of its process: threads, log levels, limits and sources of chance."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from PIL import Image as Pil

import p3i
from p3i.errors import P3IError

TEXT = """SetCameraPose(rx=-10, ry=5)
for i in range(-2, 3):
    for j in range(-2, 3):
        Draw(x=9*i, y=9*j)
"""
ODD_PIXEL_LIMIT = 123_456


def state() -> dict[str, object]:
    """All that the libraries under p3i keep for the whole process and that p3i has a hand in."""
    return {
        "torch threads": torch.get_num_threads(),
        "OpenCV threads": cv2.getNumThreads(),
        "OpenCV log level": cv2.utils.logging.getLogLevel(),
        "Pillow's limit": Pil.MAX_IMAGE_PIXELS,
        "torch gradients": torch.is_grad_enabled(),
        "torch default type": torch.get_default_dtype(),
        "torch chance": torch.get_rng_state().sum().item(),
        "numpy chance": np.random.get_state()[1].sum(),
        "numpy errors": tuple(sorted(np.geterr().items())),
    }


@pytest.fixture(autouse=True)
def of_its_own(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A process whose settings are nobody's default, so that a default put back is seen too."""
    before = torch.get_num_threads(), cv2.getNumThreads(), cv2.utils.logging.getLogLevel()
    torch.set_num_threads(2)
    cv2.setNumThreads(3)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_WARNING)
    monkeypatch.setattr(Pil, "MAX_IMAGE_PIXELS", ODD_PIXEL_LIMIT)
    yield
    torch.set_num_threads(before[0])
    cv2.setNumThreads(before[1])
    cv2.utils.logging.setLogLevel(before[2])


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """Noise, so that nothing stops the search at once."""
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8))
    (tmp_path / "a.p3p").write_text(TEXT)
    (tmp_path / "broken.png").write_bytes(path.read_bytes()[:900])
    return path


CALLS: dict[str, Callable[[Path], object]] = {
    "synth": lambda photo: p3i.synth(photo, structure="lattice"),
    "score": lambda photo: p3i.score(photo, photo.with_suffix(".p3p")),
    "read_image": p3i.read_image,
    "render": lambda photo: p3i.render(photo.with_suffix(".p3p"), image=photo).pixels(),
    "show": lambda photo: p3i.show(photo, photo.with_suffix(".p3p")).pixels(),
    "points": lambda photo: p3i.points(photo.with_suffix(".p3p"), image=photo),
    "rectify": lambda photo: p3i.rectify(photo, photo.with_suffix(".p3p")).paint(),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_call_leaves_its_process_as_it_was(name: str, photo: Path) -> None:
    before = state()
    CALLS[name](photo)
    assert state() == before


def test_a_search_that_fails_leaves_its_process_as_it_was(
    photo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object, **__: object) -> None:
        raise RuntimeError("in the middle")

    before = state()
    with pytest.raises(P3IError):
        p3i.read_image(photo.with_name("broken.png"))
    assert state() == before
    with pytest.raises(P3IError):
        p3i.score(photo, p3i.loads("Draw(x=900, y=900)"))
    assert state() == before
    monkeypatch.setattr("p3i.search.synthesize.Session", failing)
    with pytest.raises(RuntimeError):
        p3i.synth(photo)
    assert state() == before

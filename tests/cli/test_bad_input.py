"""What is no photo of a pattern gets its exit code, one line with the reason, and leaves no file behind.

Each case is a process of its own, as a user starts it.
"""

import io
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

HEIGHT, WIDTH = 240, 320


def chequered() -> np.ndarray:
    """A slanted chequered floor, uint8 [H, W, 3] RGB: a pattern that anyone would see."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    depth = 1 + 0.9 * (HEIGHT - y) / HEIGHT
    u, v = (x - WIDTH / 2) * depth / 20, 260 / depth / 20 * 2.2
    board = (np.floor(u) + np.floor(v * 2)) % 2
    grey = 60 + 130 * board
    return np.repeat(grey[:, :, None], 3, axis=2).astype(np.uint8)


def write(path: Path, pixels: np.ndarray, **options: object) -> None:
    Image.fromarray(pixels).save(path, **options)


def sky(path: Path) -> None:
    ramp = np.linspace(0, 1, HEIGHT)[:, None, None]
    colours = (1 - ramp) * np.array([70, 120, 200]) + ramp * np.array([190, 215, 240])
    write(path, np.broadcast_to(colours, (HEIGHT, WIDTH, 3)).round().astype(np.uint8))


def noise(path: Path) -> None:
    write(path, np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8))


def edge(path: Path) -> None:
    pixels = np.full((HEIGHT, WIDTH, 3), 60, np.uint8)
    pixels[:, WIDTH // 2 :] = 190
    write(path, pixels)


def blobs(path: Path) -> None:
    """Soft dark and bright blotches without any order, as fur or foliage out of focus."""
    field = np.random.default_rng(1).normal(size=(HEIGHT, WIDTH, 3))
    soft = sum(cv2.GaussianBlur(field, (0, 0), sigma) * sigma for sigma in (3, 8, 20))
    low, high = soft.min(), soft.max()
    write(path, ((soft - low) / (high - low) * 255).astype(np.uint8))


def pixel(path: Path) -> None:
    write(path, np.full((1, 1, 3), 128, np.uint8))


def thread(path: Path) -> None:
    write(path, np.random.default_rng(0).integers(0, 256, (1, WIDTH, 3), dtype=np.uint8))


def empty(path: Path) -> None:
    path.write_bytes(b"")


def text(path: Path) -> None:
    path.write_text("This is not a picture, whatever its name says.\n")


def truncated(path: Path) -> None:
    whole = io.BytesIO()
    Image.fromarray(chequered()).save(whole, "JPEG", quality=90)
    path.write_bytes(whole.getvalue()[: len(whole.getvalue()) // 2])


def folder(path: Path) -> None:
    path.mkdir()


def unreadable(path: Path) -> None:
    write(path, chequered())
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read every file (root)")


def missing(path: Path) -> None:
    pass


def deep_tiff(path: Path) -> None:
    cv2.imwrite(str(path), chequered().astype(np.uint16) * 257)


def cmyk(path: Path) -> None:
    Image.fromarray(chequered()).convert("CMYK").save(path, "JPEG", quality=92)


def animation(path: Path) -> None:
    frames = [Image.fromarray(chequered()), Image.fromarray(255 - chequered())]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=100, loop=0)


def transparent(path: Path) -> None:
    write(path, np.zeros((HEIGHT, WIDTH, 4), np.uint8))


REFUSED: list[tuple[Callable[[Path], None], str, int, str]] = [
    (sky, "sky.png", 5, "."),
    (noise, "noise.png", 5, "no regular pattern"),
    (edge, "edge.png", 5, "."),
    (blobs, "blobs.png", 5, "no regular pattern"),
    (pixel, "pixel.png", 5, "."),
    (thread, "thread.png", 5, "."),
    (transparent, "transparent.png", 5, "."),
    (empty, "empty.jpg", 3, "empty"),
    (text, "text.jpg", 3, "no picture"),
    (truncated, "truncated.jpg", 3, "cut off"),
    (folder, "folder.jpg", 3, "folder"),
    (unreadable, "unreadable.png", 3, "permission"),
    (missing, "missing.jpg", 3, "no file"),
]
# Odd ways to store a good picture.
ODD: list[tuple[Callable[[Path], None], str]] = [
    (deep_tiff, "deep.tif"),
    (cmyk, "cmyk.jpg"),
    (animation, "animation.gif"),
]


def synth(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "NO_COLOR": "1"}
    environment.pop("P3I_DEBUG", None)
    return subprocess.run(
        [sys.executable, "-m", "p3i.cli.main", "synth", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize(("make", "name", "code", "reason"), REFUSED, ids=lambda value: str(value)[:12])
def test_what_holds_no_pattern_is_refused_in_one_line(
    make: Callable[[Path], None], name: str, code: int, reason: str, tmp_path: Path
) -> None:
    make(tmp_path / name)
    before = sorted(os.listdir(tmp_path))
    done = synth(tmp_path, name, "-o", "out.p3p")
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    lines = done.stderr.splitlines()
    assert [line for line in lines if not line.startswith("note: ")] == [lines[-1]]
    assert lines[-1].startswith("error: ") and name in lines[-1]
    assert re.search(reason, lines[-1])
    assert sorted(os.listdir(tmp_path)) == before


@pytest.mark.parametrize(("make", "name"), ODD, ids=lambda value: str(value)[:12])
def test_a_pattern_is_found_however_oddly_its_picture_is_stored(
    make: Callable[[Path], None], name: str, tmp_path: Path
) -> None:
    make(tmp_path / name)
    done = synth(tmp_path, name, "--structure", "lattice")
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert 'structure = "lattice"' in done.stdout and "SetCameraPose" in done.stdout


def test_a_batch_of_bad_files_gives_a_line_of_json_for_each(tmp_path: Path) -> None:
    for make, name, _, _ in (REFUSED[4], REFUSED[7], REFUSED[8]):
        make(tmp_path / name)
    done = synth(tmp_path, "--format", "jsonl", "pixel.png", "empty.jpg", "text.jpg")
    assert done.returncode == 6
    assert len(done.stdout.splitlines()) == 3
    assert "Traceback" not in done.stderr

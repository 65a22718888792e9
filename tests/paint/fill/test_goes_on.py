"""Where a program ends before its pattern does, what lies around a hole says whether that goes on."""

import numpy as np
import pytest
from marked import LATTICE, drawn

from p3i import loads
from p3i.paint.fill import stack
from p3i.paint.fill.stack import fill_by_stack
from p3i.place.moves import nearest
from p3i.place.placed import placed
from p3i.vision.image import Image
from p3i.vision.sheet import project

# The program draws no last row.
LAST = 3
SHORT = LATTICE.replace("range(-3, 4)", "range(-3, 3)")
NEVER, ALWAYS = 0.0, 1e9


def with_last_row(marks: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The drawn lattice [H, W, 3] with these marks of its last row alone, and the place (x, y) of one."""
    photo = drawn(LATTICE)
    laid = placed(loads(LATTICE), photo)
    height, width = photo.valid.shape
    points = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2).astype(float)
    on_plane, _ = project(np.linalg.inv(laid.image_from_plane), points)
    index = laid.index[nearest(laid, on_plane)].reshape(height, width, 2)
    bare = (index[..., 1] == LAST) & ~np.isin(index[..., 0], marks)
    light = np.float32(0.8) * (0.65 + 0.25 * np.arange(width, dtype=np.float32) / width)
    pixels = np.where(bare[..., None], light[None, :, None], photo.pixels)
    return pixels, laid.centers_px()[0][(laid.index == (0, LAST)).all(1)][0]


def off(pixels: np.ndarray, hole: np.ndarray) -> float:
    """What a fill by the program without a last row is off by (of 255): hole [H, W], pixels [H, W, 3]."""
    valid = np.ones(hole.shape, bool)
    given = np.where(hole[..., None], np.float32(0), pixels)
    result, _ = fill_by_stack(given, valid, hole, placed(loads(SHORT), Image(given, valid)))
    return float(np.abs(result - pixels)[hole].mean() * 255)


def box(shape: tuple[int, ...], left: float, top: float, right: float, bottom: float) -> np.ndarray:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return (columns > left) & (columns < right) & (rows > top) & (rows < bottom)


def test_half_a_mark_beyond_the_programs_cells_is_made_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """All other ground beyond them is bare, and does not show what is seen of the mark."""
    pixels, (x, y) = with_last_row((0,))
    hole = box(pixels.shape, x, y - 18, x + 18, y + 18)
    assert off(pixels, hole) < 6
    monkeypatch.setattr(stack, "_GOES_ON", NEVER)
    assert off(pixels, hole) > 30, "the rule alone fills it"


@pytest.mark.parametrize("inwards_px", [30, 60])
def test_bare_ground_beyond_the_programs_cells_stays_bare(
    inwards_px: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a row would go on nothing is seen; what is seen beside the hole is bare as ground beyond is."""
    pixels, (x, y) = with_last_row(())
    hole = box(pixels.shape, x - 70, y - inwards_px, x + 70, y + 45)
    kept = off(pixels, hole)
    assert kept < 3
    monkeypatch.setattr(stack, "_GOES_ON", ALWAYS)
    assert off(pixels, hole) > 2 * kept, "the rule alone keeps it bare"

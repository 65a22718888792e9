"""Tiles: the smallest rectangle that repeats, how it wraps, and the light that is taken out of it."""

import cv2
import numpy as np
import pytest

from p3i import loads
from p3i.errors import ProgramError, UsageError
from p3i.paint.straight.light import fitted_light
from p3i.paint.straight.seam import seam_of, wrapped
from p3i.paint.straight.supercell import supercell
from p3i.paint.straight.tile import robust_mean, tile
from p3i.place.placed import placed
from p3i.size import Size
from p3i.vision.image import Image

SKEWED = """SetCameraPose(rx=-30, ry=12)
for i in range(-4, 5):
    for j in range(-4, 5):
        Draw(x=9*i + 4.5*j, y=5*j)
"""
RING = """SetCameraPose(rx=-32, ry=10)
for j in range(0, 12):
    Draw(x=26*Cos(30*j + 7) + 2, y=26*Sin(30*j + 7) - 1)
"""
CANVAS = Size(640, 480)


def painted(text: str, colours, *, size: Size = CANVAS) -> Image:
    """A photo of a plane whose colours are a function of (x, y) in program units [N, 2] -> [N, 3]."""
    laid = placed(
        loads(text),
        Image(np.zeros((size.height, size.width, 3), np.float32), np.ones((size.height, size.width), bool)),
    )
    finer = 2
    y, x = np.mgrid[0 : size.height * finer, 0 : size.width * finer]
    pixels = np.stack([(x + 0.5) / finer - 0.5, (y + 0.5) / finer - 0.5, np.ones(x.shape)], -1)
    plane = pixels @ np.linalg.inv(laid.image_from_plane).T
    values = colours(plane[..., :2] / plane[..., 2:]).astype(np.float32)
    values = cv2.resize(values, (size.width, size.height), interpolation=cv2.INTER_AREA)
    return Image(np.clip(values, 0, 1), np.ones(values.shape[:2], bool))


def bricks(points: np.ndarray) -> np.ndarray:
    """A texture with the periods of SKEWED."""
    b = points[..., 1] / 5
    a = (points[..., 0] - 4.5 * b) / 9
    waves = np.cos(2 * np.pi * a) + 0.6 * np.cos(2 * np.pi * b) + 0.5 * np.sin(2 * np.pi * (a + 2 * b))
    return 0.5 + 0.12 * waves[..., None] * np.array([1, 0.8, 0.5])


def lit_bricks(points: np.ndarray) -> np.ndarray:
    return bricks(points) * np.exp(0.012 * points[..., :1] - 0.01 * points[..., 1:])


@pytest.mark.parametrize(
    ("basis", "cells", "shear_deg"),
    [
        ([[9, 0], [0, 5]], 1, 0.0),
        ([[0, 5], [9, 0]], 1, 0.0),
        ([[9, 0], [4.5, 5]], 2, 0.0),
        ([[9, 0], [3, 5]], 3, 0.0),
        ([[7, 0], [3.5, 3.5 * 3**0.5]], 2, 0.0),
        ([[9, 0], [0.25, 5]], 1, -2.9),
    ],
)
def test_the_smallest_rectangle_of_a_lattice(basis: list[list[float]], cells: int, shear_deg: float) -> None:
    found = supercell(np.array(basis, float))
    assert found.cells == cells
    assert abs(found.shear_deg) == pytest.approx(abs(shear_deg), abs=0.6)
    right, down = found.sides
    assert right[0] > abs(right[1]) and right[0] * down[1] - right[1] * down[0] > 0
    np.testing.assert_allclose(found.steps @ np.array(basis), found.sides)


@pytest.mark.parametrize("slip", [0.0, 0.06, -0.06, 0.2])
def test_the_tile_of_a_honeycomb_stands_as_the_honeycomb_does(slip: float) -> None:
    basis = np.array([[10.826, -slip], [5.413, 9.375]])
    found = supercell(basis)
    assert found.cells == 2
    assert found.steps.tolist() == [[1, 0], [-1, 2]]


def test_the_tile_of_a_chessboard_stands_on_the_rows_that_its_program_has() -> None:
    rows = supercell(np.array([[10.0, 0.1], [5.0, 5.0]]))
    assert rows.steps.tolist() == [[1, 0], [-1, 2]] and rows.cells == 2
    columns = supercell(np.array([[5.0, -5.0], [0.1, 10.0]]))
    assert columns.steps.tolist() == [[2, 1], [0, 1]] and columns.cells == 2
    diagonals = supercell(np.array([[5.0, -5.0], [5.0, 5.0]]))
    assert diagonals.cells == 1
    sheared = supercell(np.array([[5.0, 0.0], [5.0, 5.0]]))
    assert sheared.cells == 1


def test_a_lattice_without_a_rectangle_gets_the_nearest_and_says_how_skewed() -> None:
    found = supercell(np.array([[9, 0], [6.5, 4.4]]))
    assert not found.rectangular and found.cells <= 4
    text = SKEWED.replace("9*i + 4.5*j, y=5*j", "9*i + 6.5*j, y=4.4*j")
    made = tile(painted(text, bricks), loads(text))
    assert any("skewed by" in note for note in made.notes)


@pytest.mark.parametrize("source", ["mean", "best"])
def test_a_tile_of_a_rendered_lattice_is_its_texture_and_wraps(source: str) -> None:
    photo = painted(SKEWED, lit_bricks)
    found = tile(photo, loads(SKEWED), source=source, size=Size(90, 100))
    assert found.record()["cells"] == 2 and found.known.all()
    assert found.seam.ratio < 1.2
    x, y = (np.arange(90) + 0.5) / 90 - 0.5, (np.arange(100) + 0.5) / 100 - 0.5
    sides = found.patches.cell.sides
    truth = bricks(x[None, :, None] * sides[0] + y[:, None, None] * sides[1])
    scale = (found.pixels * truth).sum() / (truth**2).sum()
    assert np.abs(found.pixels / scale - truth).mean() < 0.012


def test_light_kept_is_light_that_shows() -> None:
    photo = painted(SKEWED, lit_bricks)
    even, kept = (tile(photo, loads(SKEWED), light=light, size=Size(60, 66)) for light in (True, False))
    gains = [found.light.gain(np.array([[-20.0, 15], [20.0, -15]])) for found in (even, kept)]
    assert (gains[1] == 1).all()
    np.testing.assert_allclose(gains[0][1] / gains[0][0], np.exp(0.012 * 40 + 0.01 * 30), rtol=0.08)


def test_what_stands_out_in_one_cell_is_not_in_the_mean() -> None:
    values = np.full((9, 8, 8, 3), 20_000, np.uint16)
    values += np.arange(9, dtype=np.uint16)[:, None, None, None]
    values[3, 2:5, 2:5] = 65_000
    seen = np.ones((9, 8, 8), bool)
    seen[:, 0, 0] = False
    mean, known = robust_mean(values, seen)
    assert np.abs(mean[1:] - 20_004 / 65_535).max() < 1e-4
    assert not known[0, 0] and known.sum() == 63 and mean[0, 0].max() == 0


def test_the_light_that_is_fitted_is_the_light_that_was_laid() -> None:
    random = np.random.default_rng(1)
    look = random.uniform(0.2, 0.6, (1, 50, 3))
    points = random.uniform(-20, 20, (12, 1, 2)) + random.uniform(-2, 2, (1, 50, 2))
    gain = np.exp(0.01 * points[..., :1] + 0.0004 * points[..., 1:] ** 2)
    light = fitted_light(look * gain, np.ones((12, 50), bool), points)
    found = light.gain(points) / gain
    assert found.std() / found.mean() < 0.03


def test_a_ring_becomes_its_unrolled_sector() -> None:
    def flags(points: np.ndarray) -> np.ndarray:
        """Red where the angle grows past an object, blue outside the circle."""
        out = points - np.array([2, -1])
        angle = np.degrees(np.arctan2(out[..., 1], out[..., 0])) - 7
        ahead = np.mod(angle + 15, 30) - 15 > 0
        outside = np.linalg.norm(out, axis=-1) > 26
        return np.stack([0.2 + 0.6 * ahead, np.full(ahead.shape, 0.3), 0.2 + 0.6 * outside], -1)

    found = tile(painted(RING, flags), loads(RING))
    height, width = found.pixels.shape[:2]
    assert width == pytest.approx(height, abs=1) and found.record()["structure"] == "ring"
    quarter, last = height // 4, width - width // 4
    assert found.pixels[quarter, last, 0] > 0.7 > 0.3 > found.pixels[quarter, width // 4, 0], (
        "angle to the right"
    )
    assert found.pixels[height - quarter, last, 2] > 0.7 > 0.3 > found.pixels[quarter, last, 2], "radius down"
    assert found.seam.across_y is None


def test_a_piece_that_does_not_wrap_is_made_to() -> None:
    ramp = np.repeat(np.linspace(0, 1, 50)[None, :, None], 40, axis=0).repeat(3, axis=2).astype(np.float32)
    known = np.ones((40, 50), bool)
    cut = seam_of(ramp[:, :40], known[:, :40], down=True)
    pixels, whole = wrapped(ramp, known, Size(40, 40))
    assert cut.ratio > 20 and seam_of(pixels, whole, down=True).ratio < 6
    assert pixels.shape == (40, 40, 3) and whole.all()


def test_what_no_cell_shows_of_a_tile_is_unknown() -> None:
    photo = painted(SKEWED, bricks)
    ends = loads(SKEWED.replace("range(-4, 5)", "range(0, 1)", 1).replace("range(-4, 5)", "range(0, 2)"))
    found = tile(photo, ends)
    assert not found.known.all() and any("transparent" in note for note in found.notes)
    assert found.paint().alpha is not None


@pytest.mark.parametrize(
    ("draw", "reason"),
    [
        ("x=9*i, y=0", "one row"),
        ("x=(5 + i)*Cos(30*i), y=(5 + i)*Sin(30*i)", "spiral"),
        ("x=9*i + 400, y=9*j", "another photo"),
    ],
)
def test_programs_without_a_cell_are_refused_by_name(draw: str, reason: str) -> None:
    text = "for i in range(0, 4):\n    for j in range(0, 2):\n        Draw(" + draw + ")\n"
    with pytest.raises(ProgramError, match=reason):
        tile(painted(SKEWED, bricks), loads(text))


def test_a_tile_repeats_and_too_many_pixels_are_refused() -> None:
    photo = painted(SKEWED, bricks)
    made = tile(photo, loads(SKEWED), size=Size(20, 24), repeat=(3, 2)).paint().values
    assert made.shape == (48, 60, 3)
    np.testing.assert_array_equal(made[:24, :20], made[24:, 40:])
    with pytest.raises(UsageError, match="max-px"):
        tile(photo, loads(SKEWED), size=Size(2000, 2000), repeat=(10, 10))

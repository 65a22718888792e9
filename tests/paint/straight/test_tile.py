"""Tiles: the smallest rectangle that repeats, how it wraps, and the light that is taken out of it."""

import re

import cv2
import numpy as np
import pytest

from p3i import loads
from p3i.errors import ProgramError, UsageError
from p3i.paint.straight.aligned import robust_mean
from p3i.paint.straight.cut import cut_of
from p3i.paint.straight.grain import layers
from p3i.paint.straight.light import fitted_light
from p3i.paint.straight.seam import Seam, seam_of, wrapped
from p3i.paint.straight.supercell import supercell
from p3i.paint.straight.tile import tile
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
    assert diagonals.cells == 2 and diagonals.sides.tolist() == [[10, 0], [0, 10]], "upright, not a diamond"
    sheared = supercell(np.array([[5.0, 0.0], [5.0, 5.0]]))
    assert sheared.cells == 1


@pytest.mark.parametrize(
    "basis",
    [
        [[8.38, 2.47], [-2.75, 7.56]],  # 3.6 degrees off; five cells happen to be off by 1.6
        [[9.0, 1.6], [-0.75, 8.5]],
        [[6.0, -1.6], [2.9, 7.6]],  # 6.1 degrees off; three cells by 1.1
    ],
)
def test_a_cell_that_a_mistaken_focal_skews_is_preferred_to_many_that_chance_makes_square(
    basis: list,
) -> None:
    found = supercell(np.array(basis))
    assert found.cells == 1 and abs(found.shear_deg) < 10


def test_of_two_rectangles_the_one_is_taken_along_which_the_edges_run() -> None:
    basis = np.array([[9.1, 4.6], [-5.5, 6.9]])  # 11.8 degrees off along its sides, 16 across its diagonals
    along = supercell(basis, lambda deg: 6.0 if min(abs(deg - 27), abs(deg - 128.5)) < 4 else 0.4)
    across = supercell(basis, lambda deg: 0.4 if min(abs(deg - 27), abs(deg - 128.5)) < 4 else 6.0)
    assert along.cells == 1 and across.cells == 2


def framed(points: np.ndarray) -> np.ndarray:
    """Light panes in dark frames, 9 wide and 5 high; their middles lie at (2, 1) from the objects'."""
    a, b = (points[..., 0] - 2) / 9, (points[..., 1] - 1) / 5
    pane = (np.abs(a - np.round(a)) < 0.35) & (np.abs(b - np.round(b)) < 0.3)
    return np.where(pane, 0.8, 0.2)[..., None].repeat(3, -1)


UPRIGHT = SKEWED.replace("9*i + 4.5*j", "9*i")


@pytest.mark.parametrize("source", ["mean", "best"])
def test_a_tile_is_cut_between_objects_so_that_they_are_whole(source: str) -> None:
    found = tile(painted(UPRIGHT, framed), loads(UPRIGHT), source=source)
    assert found.cut == pytest.approx((2 / 9, 1 / 5), abs=0.08)
    rim = np.concatenate([found.pixels[0], found.pixels[-1], found.pixels[:, 0], found.pixels[:, -1]])
    assert rim.max() < 0.35, "no pane touches the tile's side"


def test_a_chessboard_is_cut_along_its_fields() -> None:
    y, x = np.mgrid[0:96, 0:96] + 0.5
    fields = (np.floor(x / 48 + 0.5) + np.floor(y / 48 + 0.5)) % 2
    random = np.random.default_rng(0)
    board = np.repeat(fields[:, :, None], 3, axis=2) + random.normal(0, 0.01, (96, 96, 3))
    moved = cut_of(cv2.GaussianBlur(board, (0, 0), 1.0, borderType=cv2.BORDER_REFLECT), down=True)
    assert np.abs(moved) == pytest.approx(np.array([0.25, 0.25]), abs=0.02)


def test_a_smooth_tile_is_not_moved() -> None:
    y, x = np.mgrid[0:60, 0:90]
    waves = 0.5 + 0.2 * np.cos(2 * np.pi * x / 90) + 0.2 * np.cos(2 * np.pi * y / 60)
    assert cut_of(np.repeat(waves[:, :, None], 3, axis=2), down=True) == (0, 0)


def speckled(points: np.ndarray) -> np.ndarray:
    """A smooth pattern on a ground whose grain is new everywhere."""
    random = np.random.default_rng(5)
    return bricks(points) + random.normal(0, 0.06, points.shape[:2])[..., None]


def fine(pixels: np.ndarray) -> float:
    """How strong a picture's grain is."""
    grey = pixels.mean(axis=2)
    return float((grey - cv2.GaussianBlur(grey, (0, 0), 1.5)).std())


def test_the_mean_keeps_the_grain_that_one_cell_has_everywhere() -> None:
    photo = painted(SKEWED, speckled)
    best, kept, smooth = (
        tile(photo, loads(SKEWED), **changes) for changes in ({"source": "best"}, {}, {"grain": False})
    )
    assert fine(smooth.pixels) < 0.5 * fine(best.pixels)
    assert fine(kept.pixels) == pytest.approx(fine(best.pixels), rel=0.12)
    width = kept.size.width
    near, far = kept.pixels[:, : width // 7], kept.pixels[:, width // 3 :]
    assert fine(near) == pytest.approx(fine(far), rel=0.2), "no less where the tile is blended into itself"


def test_grain_is_as_strong_where_a_tile_is_blended_into_itself() -> None:
    random = np.random.default_rng(3)
    grain = random.normal(0, 0.05, (200, 200, 3)).astype(np.float32)
    known = np.ones((200, 200), bool)
    pixels, _ = wrapped(np.zeros_like(grain), known, Size(140, 140), grain=grain)
    blended, plain = pixels[60:, 15:45].std(), pixels[60:, 60:].std()
    assert blended == pytest.approx(plain, rel=0.05)


def test_what_one_cell_has_of_its_own_is_no_grain() -> None:
    random = np.random.default_rng(2)
    mean = np.full((60, 60, 3), 0.5, np.float32)
    own = mean + random.normal(0, 0.02, (60, 60, 1)).astype(np.float32)
    own[20:24, 20:24] += 0.4
    found = layers((own * 65535).astype(np.uint16), np.ones((60, 60), bool), mean, cell=Size(60, 60))
    assert np.abs(found.grain).max() < 0.1 < 0.2 < np.abs(found.fine).max()
    np.testing.assert_allclose(mean + found.shade + found.fine, own, atol=1e-4)


def painted_cells(points: np.ndarray) -> np.ndarray:
    """Cells of UPRIGHT, each of its own colour: red by its column, green by its row."""
    column, row = np.round(points[..., 0] / 9), np.round(points[..., 1] / 5)
    return np.stack([0.5 + 0.05 * column, 0.5 + 0.05 * row, np.full(column.shape, 0.4)], -1)


def test_a_tile_of_many_cells_shows_neighbours_as_they_are() -> None:
    found = tile(
        painted(UPRIGHT, painted_cells), loads(UPRIGHT), cells=(3, 2), light=False, size=Size(180, 80)
    )
    assert found.pixels.shape == (80, 180, 3) and found.known.all()
    assert found.record()["cells_shown"] == [3, 2] and found.record()["from"] == "best"
    middles = found.pixels[20::40, 30::60]
    np.testing.assert_allclose(np.diff(middles[..., 0], axis=1), 0.05, atol=0.012)
    np.testing.assert_allclose(np.diff(middles[..., 1], axis=0), 0.05, atol=0.012)
    ((column, row),) = found.used
    expected = [0.5 + 0.05 * column, 0.5 + 0.05 * row]
    np.testing.assert_allclose(
        middles[0, 0, :2], expected, atol=0.012, err_msg="the first cell is the one told"
    )


def test_what_many_cells_do_not_show_is_as_usual_and_told() -> None:
    few = UPRIGHT.replace("range(-4, 5)", "range(0, 3)", 1)
    found = tile(painted(few, framed), loads(few), cells=(4, 2))
    assert found.known.all() and any("not seen" in note for note in found.notes)


def test_cells_that_cannot_be_are_refused_by_name() -> None:
    photo = painted(SKEWED, bricks)
    with pytest.raises(UsageError, match="--from best"):
        tile(photo, loads(SKEWED), cells=(2, 2), source="mean")
    with pytest.raises(UsageError, match="one cell high"):
        tile(painted(RING, bricks), loads(RING), cells=(2, 2))
    with pytest.raises(UsageError, match="1 to"):
        tile(photo, loads(SKEWED), cells=(0, 2))


@pytest.mark.parametrize(
    ("seam", "words"),
    [
        (Seam(3.0, 3.0, 2.0, None, None, None), "left to right without a visible seam"),
        (Seam(0.9, 0.3, 0.3, 1.0, 1.0, 1.0), "without a visible seam"),
        (Seam(3.0, 2.0, 1.0, 1.0, 1.0, 1.0), "a faint seam left to right"),
        (Seam(1.0, 1.0, 1.0, 9.0, 3.0, 2.0), "a seam shows top to bottom.* 3.0 times"),
    ],
)
def test_a_seam_is_told_in_words(seam: Seam, words: str) -> None:
    assert re.search(words, seam.sentence())


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
    x, y = ((np.arange(n) + 0.5) / n - 0.5 + moved for n, moved in zip((90, 100), found.cut, strict=True))
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

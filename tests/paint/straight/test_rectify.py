"""Straightened views: where the lattice comes to lie, what is known, how sharp it is, and the way back."""

import dataclasses

import cv2
import numpy as np
import pytest

from p3i import loads
from p3i.errors import ProgramError, UsageError
from p3i.options.cell import CellSize, parse_cell
from p3i.options.rectify import CROPS
from p3i.paint.straight.rectify import Rectified, rectify
from p3i.size import Size
from p3i.vision.decode import Source
from p3i.vision.image import Image
from p3i.vision.picture import Picture
from p3i.vision.sheet import project

LATTICE = """SetCameraPose(rx=-38, ry=14)
for i in range(-3, 4):
    for j in range(-3, 4):
        Draw(x=8*i - 1.2*j + 1, y=1.2*i + 8*j - 2)
"""
BOARD = """SetCameraPose(rx=-30, ry=4)
for i in range(-2, 3):
    for j in range(-2, 3):
        Draw(x=7*i - 6.8*j, y=6.8*i + 7*j)
"""
BENT = "# /// p3p\n# version = 1\n# lens_k1 = -0.12\n# ///\n"
CANVAS = Size(480, 360)


def blank(size: Size = CANVAS, *, source: Source | None = None) -> Image:
    known = np.ones((size.height, size.width), bool)
    return Image(np.zeros((*known.shape, 3), np.float32), known, source=source or Source("PNG"))


def scene(text: str = LATTICE, *, size: Size = CANVAS, bits: int = 8) -> Image:
    """Discs with a spot, as the program's camera sees them."""
    laid = rectify(blank(size), loads(text)).view.placed
    finer = 4
    canvas = np.full((size.height * finer, size.width * finer, 3), (170, 180, 190), np.uint8)
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    for point in laid.points:
        for radius, offset, colour in ((2.6, 0.0, (40, 60, 120)), (0.9, 1.0, (240, 220, 90))):
            rim = point + offset + radius * np.stack([np.cos(turn), np.sin(turn)], 1)
            at, front = project(laid.image_from_plane, rim)
            if front.all():
                places = np.round(((at + 0.5) * finer - 0.5) * 16).astype(np.int32)
                cv2.fillPoly(canvas, [places], colour, cv2.LINE_AA, 4)
    pixels = cv2.resize(canvas, (size.width, size.height), interpolation=cv2.INTER_AREA)
    return Image(
        pixels.astype(np.float32) / 255, np.ones(pixels.shape[:2], bool), source=Source("PNG", bits=bits)
    )


def read_again(picture: Picture) -> Image:
    """What `read_image` would make of the picture as a PNG."""
    top = np.float32(2**picture.bits - 1)
    alpha = None if picture.alpha is None else picture.alpha / top
    known = np.ones(picture.values.shape[:2], bool) if alpha is None else alpha >= 0.5
    return Image(picture.values / top, known, source=Source("PNG", picture.bits, alpha))


def centers_in_view(found: Rectified) -> np.ndarray:
    pixels, _ = found.view.placed.centers_px()
    return project(found.view.view_from_pinhole, pixels)[0]


@pytest.mark.parametrize("crop", CROPS)
def test_the_homography_takes_the_lattice_to_an_exact_straight_grid(crop: str) -> None:
    found = rectify(blank(), loads(LATTICE), crop=crop)
    record, index = found.record(), found.view.placed.index
    u, v = (np.array(record[name]) for name in ("u", "v"))
    expected = np.array(record["origin"]) + index[:, :1] * u + index[:, 1:] * v
    np.testing.assert_allclose(centers_in_view(found), expected, atol=1e-6)
    assert abs(u[1]) < 1e-9 and u[0] > 0, "u runs to the right"
    assert u @ v == pytest.approx(0, abs=1e-6)


def test_in_photo_and_in_view_undo_each_other_through_the_lens_too() -> None:
    for header in ("", BENT):
        view = rectify(blank(), loads(header + LATTICE)).view
        x, y, known = view.in_photo(np.array([200.0]), np.array([150.0]))
        assert known.all()
        back_x, back_y, shown = view.in_view(x[0], y[:, 0])
        assert shown.all()
        np.testing.assert_allclose([back_x[0, 0], back_y[0, 0]], [200, 150], atol=1e-6)


def test_local_periods_of_a_painted_view_vary_by_less_than_a_hundredth() -> None:
    found = rectify(scene(), loads(LATTICE))
    record = found.record()
    u, v, origin = (np.array(record[name]) for name in ("u", "v", "origin"))
    values = found.paint().values
    grey = values.astype(np.float32).mean(axis=2)
    side = int(u[0])
    window = cv2.createHanningWindow((side, side), cv2.CV_32F)

    def cut(i: int, j: int) -> np.ndarray:
        x, y = origin + i * u + j * v
        return cv2.getRectSubPix(grey, (side, side), (float(x), float(y)))

    shifts = [
        cv2.phaseCorrelate(cut(i, j), cut(i + 1, j), window)[0] for i in range(-3, 3) for j in range(-2, 3)
    ]
    shifts += [
        cv2.phaseCorrelate(cut(i, j), cut(i, j + 1), window)[0] for i in range(-2, 3) for j in range(-2, 2)
    ]
    assert np.abs(np.array(shifts)).max() < 0.01 * side


def test_a_board_whose_lattice_runs_along_its_diagonals_stands_straight() -> None:
    record = rectify(blank(), loads(BOARD)).record()
    u = np.array(record["u"])
    assert abs(u[0]) == pytest.approx(abs(u[1]), rel=0.05), "the sides of the squares run across, not u"


def test_a_lattice_written_askew_stands_on_its_shortest_vectors() -> None:
    askew = LATTICE.replace("8*i - 1.2*j + 1, y=1.2*i + 8*j", "14.8*i + 6.8*j + 1, y=10.4*i + 9.2*j")
    plain, skewed = (rectify(blank(), loads(text)).view.view_from_plane for text in (LATTICE, askew))
    turns = [np.degrees(np.arctan2(matrix[1, 0], matrix[0, 0])) for matrix in (plain, skewed)]
    assert turns[0] == pytest.approx(turns[1], abs=1e-6)


def test_as_seen_does_not_turn_and_no_view_mirrors() -> None:
    for upright in (True, False):
        matrix = rectify(blank(), loads(LATTICE), upright=upright).view.view_from_plane
        assert np.linalg.det(matrix[:2, :2]) > 0
        assert bool(abs(matrix[0, 1]) < 1e-12) is not upright


def test_scale_one_is_one_pixel_for_one_where_the_photo_is_sharpest_in_the_middle() -> None:
    view = rectify(blank(), loads(LATTICE)).view
    pixels, _ = view.placed.centers_px()
    at = project(view.view_from_pinhole, pixels.mean(axis=0))[0]
    steps = [view.in_photo(at[:1] + move[0], at[1:] + move[1]) for move in ((0, 0), (0.5, 0), (0, 0.5))]
    here, right, down = (np.array([x[0, 0], y[0, 0]]) for x, y, _ in steps)
    jacobian = np.stack([(right - here) / 0.5, (down - here) / 0.5])
    assert np.linalg.norm(jacobian, 2) == pytest.approx(1, rel=0.01)
    twice = rectify(blank(), loads(LATTICE), scale=2.0)
    assert twice.size.width == pytest.approx(2 * view.size.width, abs=2)


def test_inside_holds_known_pixels_only_and_can_hardly_grow() -> None:
    known = np.ones((CANVAS.height, CANVAS.width), bool)
    known[300:306, 200:204] = False
    for header, valid in (("", None), (BENT, None), ("", known)):
        photo = blank() if valid is None else Image(blank().pixels, valid)
        found = rectify(photo, loads(header + LATTICE), crop="inside")
        assert found.paint().alpha is None, "all is known"
        assert found.size.width * found.size.height > 40_000
        x, y = np.arange(-6.0, found.size.width + 6), np.arange(-6.0, found.size.height + 6)
        beyond = found.view.in_photo(x, y)[2]
        if valid is None:
            sides = (beyond[0, 6:-6], beyond[-1, 6:-6], beyond[6:-6, 0], beyond[6:-6, -1])
            assert not any(side.all() for side in sides), "no side could be moved by six pixels"


def test_all_ends_before_the_horizon_and_says_so() -> None:
    steep = LATTICE.replace("rx=-38", "rx=-62")
    found = rectify(blank(), loads(steep), crop="all")
    assert any("horizon" in note for note in found.notes)
    assert max(found.size.width, found.size.height) < 6000


def test_same_keeps_the_canvas_and_the_middle_of_the_pattern() -> None:
    found = rectify(blank(), loads(LATTICE), crop="same", upright=False)
    assert found.size == CANVAS
    pixels, _ = found.view.placed.centers_px()
    middle = pixels.mean(axis=0)
    np.testing.assert_allclose(project(found.view.view_from_pinhole, middle)[0], middle, atol=1e-6)


def test_too_many_pixels_are_scaled_down_or_where_a_scale_was_asked_for_refused() -> None:
    found = rectify(blank(), loads(LATTICE), max_px=20_000)
    assert 15_000 < found.size.width * found.size.height <= 20_000
    assert any("--max-px" in note for note in found.notes)
    with pytest.raises(UsageError, match="max-px"):
        rectify(blank(), loads(LATTICE), max_px=20_000, scale=1.0)


@pytest.mark.parametrize("crop", ["pattern", "same"])
def test_a_limit_of_any_number_of_pixels_is_kept_and_made_use_of(crop: str) -> None:
    """A row ten times as long as high: rounding its short side up must not break the limit."""
    row = LATTICE.replace("range(-3, 4)", "range(0, 1)", 1)
    for limit in (1, 2, 3, 7, 20, 50, 99, 101, 333, 1000, 2001, 5003):
        for text in (LATTICE, row):
            size = rectify(blank(), loads(text), crop=crop, max_px=limit).size
            assert 0.3 * limit <= size.width * size.height <= limit


def test_a_known_cell_makes_the_view_metric_whatever_the_focal() -> None:
    for focal_mm in (24.0, 35.0, 70.0):
        found = rectify(blank(), loads(LATTICE), cell=CellSize(600, 300), focal_mm=focal_mm)
        record = found.record()
        u, v = (np.array(record[name]) * record["mm_per_px"] for name in ("u", "v"))
        np.testing.assert_allclose(np.linalg.norm([u, v], axis=1), [600, 300], rtol=1e-6)
        assert u @ v == pytest.approx(0, abs=1e-3)
        assert record["dpi"] == pytest.approx(25.4 / record["mm_per_px"])
        assert np.linalg.det(found.view.view_from_plane[:2, :2]) > 0


def test_pixels_per_millimetre_are_told_and_can_be_asked_for() -> None:
    told = rectify(blank(), loads(LATTICE), cell=CellSize(600, 300)).record()
    assert told["px_per_mm"] * told["mm_per_px"] == pytest.approx(1)
    asked = rectify(blank(), loads(LATTICE), cell=CellSize(600, 300), px_per_mm=0.25)
    record = asked.record()
    assert record["px_per_mm"] == pytest.approx(0.25) and record["dpi"] == pytest.approx(0.25 * 25.4)
    assert np.linalg.norm(record["u"]) == pytest.approx(150)
    assert rectify(blank(), loads(LATTICE)).record()["px_per_mm"] is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"px_per_mm": 2.0}, "needs --cell"),
        ({"px_per_mm": 2.0, "scale": 1.0, "cell": CellSize(600, 300)}, "one of them"),
        ({"px_per_mm": -1.0, "cell": CellSize(600, 300)}, "above 0"),
        ({"px_per_mm": 1e4, "cell": CellSize(600, 300)}, "max-px"),
    ],
)
def test_pixels_per_millimetre_that_cannot_be_are_refused(changes: dict, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        rectify(blank(), loads(LATTICE), **changes)


ROWS = """SetCameraPose(rx=-30, ry=4)
for i in range(-2, 3):
    for j in range(-2, 3):
        Draw(x={}, y={})
"""


@pytest.mark.parametrize(
    ("draw", "along", "down"),
    [
        (("12*i + 6*j", "0.2*i + 4*j"), (1, 0), (-1, 2)),
        (("6*i", "-4*i + 8*j"), (2, 1), (0, 1)),
    ],
)
def test_the_cell_of_bricks_is_as_wide_as_a_brick_and_as_high_as_a_row(draw, along, down) -> None:
    found = rectify(
        blank(), loads(ROWS.format(*draw)), cell=CellSize(240, 80) if along == (1, 0) else CellSize(80, 240)
    )
    basis = found.view.placed.basis @ found.view.view_from_plane[:2, :2].T * found.view.mm_per_px
    sides = np.array([along, down]) @ basis
    wide, high = (240, 160) if along == (1, 0) else (160, 240)
    np.testing.assert_allclose(np.abs(sides), [[wide, 0], [0, high]], atol=0.5)


@pytest.mark.parametrize(
    ("text", "sides"), [("600x300mm", (600, 300)), ("2x1 ft", (609.6, 304.8)), ("5x4", (5, 4))]
)
def test_cells_are_read_in_all_units(text: str, sides: tuple[float, float]) -> None:
    found = parse_cell(text)
    np.testing.assert_allclose([found.width_mm, found.height_mm], sides)


@pytest.mark.parametrize("text", ["600", "600x300px", "0x3mm", "axb", ""])
def test_what_is_no_cell_is_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_cell(text)


def test_fine_texture_that_the_view_shrinks_turns_even_not_into_moire() -> None:
    random = np.random.default_rng(0)
    pixels = np.repeat(random.integers(0, 2, (CANVAS.height, CANVAS.width, 1)), 3, axis=2).astype(np.float32)
    photo = Image(pixels, np.ones(pixels.shape[:2], bool))
    values = rectify(photo, loads(LATTICE), scale=0.125, crop="inside").paint().values
    # The mean of 64 coins spreads by an eighth of a half; a picked sample by a half.
    assert values.std() / 255 < 0.13


@pytest.mark.parametrize("bits", [8, 16])
def test_an_unedited_view_leaves_the_photo_as_it_is_to_the_bit(bits: int) -> None:
    photo = scene(bits=bits)
    found = rectify(photo, loads(LATTICE))
    returned = found.back(read_again(found.paint()))
    assert returned.changed == 0 and returned.picture.bits == bits
    np.testing.assert_array_equal(returned.picture.values, np.rint(photo.pixels * np.float32(2**bits - 1)))


@pytest.mark.parametrize("header", ["", BENT])
def test_an_edit_goes_back_to_its_place_and_nowhere_else(header: str) -> None:
    photo = scene()
    found = rectify(photo, loads(header + LATTICE))
    painted = found.paint()
    values = painted.values.copy()
    left, top = found.size.width // 2, found.size.height // 2
    values[top : top + 40, left : left + 60] = (255, 0, 255)
    returned = found.back(read_again(Picture(values, painted.alpha)))
    before = np.rint(photo.pixels * 255).astype(np.uint8)
    differs = (returned.picture.values != before).any(axis=2)
    x, y, on_view = found.view.in_view(np.arange(CANVAS.width), np.arange(CANVAS.height))
    outside = (x < left - 3) | (x > left + 62) | (y < top - 3) | (y > top + 42) | ~on_view
    within = (x > left + 6) & (x < left + 53) & (y > top + 6) & (y < top + 33) & on_view
    assert not differs[outside].any()
    assert within.sum() > 300
    assert (returned.picture.values[within] == (255, 0, 255)).mean() > 0.99


def test_a_jpegs_noise_is_no_edit_and_another_size_is_refused() -> None:
    found = rectify(scene(), loads(LATTICE))
    again = read_again(found.paint())
    noisy = Image(
        np.clip(again.pixels + 5 / 255, 0, 1).astype(np.float32), again.valid, source=Source("JPEG")
    )
    assert found.back(noisy).changed == 0
    assert found.back(Image(noisy.pixels, noisy.valid)).changed > 1000
    with pytest.raises(UsageError, match="but the view is"):
        found.back(blank())


def test_a_view_made_with_other_options_of_the_same_size_gets_a_note_and_no_edit_does() -> None:
    photo = scene()
    grain = np.random.default_rng(0).normal(0, 0.03, photo.pixels.shape)  # as every photo has
    photo = dataclasses.replace(photo, pixels=np.clip(photo.pixels + grain, 0, 1).astype(np.float32))
    found = rectify(photo, loads(LATTICE), crop="same", upright=False)
    painted = found.paint()
    edited = painted.values.copy()
    edited[100:200, 150:300] = (255, 0, 255)
    for picture in (painted, Picture(edited, painted.alpha)):
        assert not found.back(read_again(picture)).notes
    jpeg = Source("JPEG")
    for changes in ({"upright": True}, {"focal_mm": 30.0}):
        other = rectify(photo, loads(LATTICE), crop="same", **{"upright": False, **changes}).paint()
        assert other.size == painted.size
        notes = found.back(read_again(other)).notes
        assert len(notes) == 1 and "other options" in notes[0]
    turned = read_again(rectify(photo, loads(LATTICE), crop="same", upright=True).paint())
    assert found.back(Image(turned.pixels, turned.valid, source=jpeg)).notes


def test_holes_of_the_photo_are_transparent_in_the_view() -> None:
    alpha = np.ones((CANVAS.height, CANVAS.width), np.float32)
    alpha[150:200, 200:260] = 0
    photo = scene()
    photo = Image(photo.pixels, alpha >= 0.5, source=Source("PNG", alpha=alpha))
    found = rectify(photo, loads(LATTICE))
    painted = found.paint()
    assert painted.alpha is not None
    at = project(found.view.view_from_pinhole, np.array([230.0, 175.0]))[0].astype(int)
    assert painted.alpha[at[1], at[0]] == 0 and (painted.values[at[1], at[0]] == 0).all()
    returned = found.back(read_again(painted))
    assert returned.changed == 0 and returned.picture.alpha is not None
    assert (returned.picture.alpha[150:200, 200:260] == 0).all()


def test_a_program_of_another_photo_is_refused_by_name() -> None:
    aside = LATTICE.replace("+ 1,", "+ 400,")
    with pytest.raises(ProgramError, match="of another photo"):
        rectify(blank(), loads(aside))

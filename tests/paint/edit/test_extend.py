"""Photos continued beyond their frame: what comes in, what stays, and what is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.cli.main import run
from p3i.errors import UsageError
from p3i.grammar.ast import Affine, Header, Program
from p3i.grammar.leaves import map_affines
from p3i.interp.lens import straight_from_photo
from p3i.options.extend import Margins, parse_margins
from p3i.paint.edit.extend import extend, margins_px
from p3i.place.placed import placed
from p3i.vision.image import Image, read_image
from p3i.vision.warp import pixel_grid, remapped
from p3i.vision.write import write_image

ENDLESS = LATTICE.replace("range(-4, 5)", "range(-14, 15)").replace("range(-3, 4)", "range(-10, 11)")
# The objects of ENDLESS that a crop by MARGIN shows wholly, and an arc of a ring that leaves the crop.
PART = LATTICE.replace("range(-4, 5)", "range(-5, 5)").replace("range(-3, 4)", "range(-5, 4)")
LARGE_RING = RING.replace("26*", "40*")
ARC = LARGE_RING.replace("range(0, 12)", "range(-2, 7)")
MARGIN = 60
ALL_AROUND = Margins(MARGIN, MARGIN, MARGIN, MARGIN)
RATIO = 480 / (480 - 2 * MARGIN)
FOCAL = 35 * RATIO


def cropped(photo: Image, margin: int = MARGIN) -> Image:
    inner = (slice(margin, -margin), slice(margin, -margin))
    return dataclasses.replace(photo, pixels=photo.pixels[inner].copy(), valid=photo.valid[inner].copy())


def on_crop(text: str) -> Program:
    """The program in the units of the crop, whose longer side is shorter."""

    def change(path: str, form: Affine) -> Affine:
        if not path.startswith("draw.") or path.endswith(".angle"):
            return form
        return dataclasses.replace(form, i=form.i * RATIO, j=form.j * RATIO, constant=form.constant * RATIO)

    return map_affines(loads(text), change)


def outside(photo: Image, margin: int = MARGIN) -> np.ndarray:
    hole = np.ones(photo.valid.shape, bool)
    hole[margin:-margin, margin:-margin] = False
    return hole


def test_a_cropped_lattice_gets_back_what_was_cut_off() -> None:
    whole = drawn(ENDLESS)
    given = cropped(whole)
    found = extend(given, on_crop(PART), by=ALL_AROUND, focal_mm=FOCAL)
    assert found.size == whole.size
    wrong = np.abs(found.pixels - whole.pixels)[outside(whole)].mean() * 255
    assert wrong < 6, f"mean L1 {wrong:.1f}"
    assert np.array_equal(found.pixels[MARGIN:-MARGIN, MARGIN:-MARGIN], given.pixels)
    assert found.smooth < 0.05


def test_an_arc_that_leaves_the_frame_is_closed_to_its_ring() -> None:
    whole = drawn(LARGE_RING)
    found = extend(cropped(whole), on_crop(ARC), by=ALL_AROUND, focal_mm=FOCAL, beyond="continue")
    assert sorted(found.laid.index[:, 0] % 12) == list(range(12))
    assert np.abs(found.pixels - whole.pixels)[outside(whole)].mean() * 255 < 8
    assert any("not pattern" in note for note in found.notes)


def test_a_pattern_that_ends_inside_the_photo_is_not_continued() -> None:
    photo = drawn(LATTICE.replace("range(-4, 5)", "range(-2, 3)").replace("range(-3, 4)", "range(-2, 2)"))
    small = loads(LATTICE.replace("range(-4, 5)", "range(-2, 3)").replace("range(-3, 4)", "range(-2, 2)"))
    with pytest.raises(
        UsageError, match=r"on no side does the pattern go on \(100% of the new ground is none"
    ):
        extend(photo, small, by=Margins(10, 10, 10, 10, "%"))
    found = extend(photo, small, by=Margins(10, 10, 10, 10, "%"), beyond="continue")
    assert found.added == 0
    assert found.smooth == 1
    assert any("nothing of it is added" in note for note in found.notes)


def test_a_pattern_that_ends_on_one_side_goes_on_at_the_others_only() -> None:
    """Five columns stand in the middle; their rows leave the frame at the top and at the bottom."""
    text = ENDLESS.replace("range(-14, 15)", "range(-2, 3)")
    found = extend(
        drawn(text),
        loads(text.replace("range(-10, 11)", "range(-5, 4)")),
        by=Margins(60, 60, 60, 60),
        beyond="continue",
    )
    new = found.laid.index[len(found.laid.index) - found.added :]
    assert len(new) >= 5
    assert set(new[:, 0]) <= set(range(-2, 3))


# Rows leave the frame at the right; three of them stand in the middle.
BAND = ENDLESS.replace("range(-10, 11)", "range(-1, 2)").replace("range(-14, 15)", "range(-5, 6)")


@pytest.mark.parametrize("beyond", ["crop", "transparent", "continue", "refuse"])
def test_ground_that_is_not_pattern_is_left_as_asked(beyond: str) -> None:
    """A band of rows crosses the frame left and right: two thirds of the new ground are none of it."""
    photo = drawn(BAND.replace("range(-5, 6)", "range(-14, 15)"))
    asked = {"by": Margins(20, 20, 20, 20), "beyond": beyond}
    if beyond in ("crop", "refuse"):
        with pytest.raises(UsageError, match="pattern"):
            extend(photo, loads(BAND), **asked)
        return
    found = extend(photo, loads(BAND), **asked)
    assert (found.size.width, found.size.height) == (520, 440)
    assert 0.5 < found.smooth < 1 and found.added
    clear = 0.0 if found.alpha is None else float((found.alpha == 0).mean())
    if beyond == "transparent":
        assert found.alpha is not None and (found.alpha[20:-20, 20:-20] == 1).all()
        new = 520 * 440 - 480 * 400
        assert clear * 520 * 440 == pytest.approx(found.smooth * new)
    else:
        assert clear == 0


def test_a_side_where_the_pattern_ends_is_cropped_and_the_others_grow() -> None:
    """All of the photo is pattern but for its top: there, and only there, nothing is to be added."""
    text = ENDLESS.replace("range(-10, 11)", "range(-3, 11)")
    given = drawn(text)
    laid = placed(loads(text), given)
    part = text.replace("range(-14, 15)", "range(-5, 6)").replace("range(-3, 11)", "range(-3, 4)")
    assert laid.in_sight().sum() > 40
    found = extend(given, loads(part), by=Margins(0, 30, 0, 30))
    assert found.margins == (0, 0, 0, 30)
    assert any("top by 0 of 30" in note for note in found.notes)
    assert found.size.height == given.size.height + 30
    assert found.smooth <= 0.1
    assert np.array_equal(found.pixels[: given.size.height], given.pixels)
    new = found.laid.index[len(found.laid.index) - found.added :]
    assert len(new) and new[:, 1].min() >= -3


def test_the_new_program_draws_on_the_new_picture_where_the_old_one_does() -> None:
    given = cropped(drawn(ENDLESS))
    found = extend(given, on_crop(PART), by=Margins(8, 4, 8, 4), focal_mm=FOCAL)
    assert found.program is not None
    blank = Image(found.pixels, np.ones(found.pixels.shape[:2], bool))
    again = placed(found.program, blank)
    at = {
        tuple(index): place for index, place in zip(again.index.tolist(), again.centers_px()[0], strict=True)
    }
    for index, place in zip(found.laid.index.tolist(), found.laid.centers_px()[0], strict=True):
        np.testing.assert_allclose(at[tuple(index)], place, atol=0.05)


def test_unequal_sides_leave_no_program_but_a_homography() -> None:
    given = cropped(drawn(ENDLESS))
    found = extend(given, on_crop(PART), by=Margins(30, 0, 0, 0), focal_mm=FOCAL)
    assert found.program is None
    assert any("homography" in note for note in found.notes)
    before = placed(on_crop(PART), given, focal_mm=FOCAL).centers_px()[0]
    after = found.laid.centers_px()[0][: len(before)]
    np.testing.assert_allclose(after, before + np.array([30, 0]), atol=1e-6)


def test_sixteen_bits_and_transparency_are_kept(tmp_path: Path) -> None:
    alpha = np.ones((280, 360), np.float32)
    alpha[100:120, 100:120] = 0
    given = cropped(drawn(ENDLESS))
    write_image(tmp_path / "a.png", given.pixels + np.float32(100 / 65535), alpha=alpha, bits=16)
    photo = read_image(tmp_path / "a.png")
    asked = {"by": Margins(0, 0, 20, 0), "focal_mm": FOCAL}
    picture = extend(photo, on_crop(PART), keep_transparent=True, **asked).paint()
    assert picture.bits == 16
    assert picture.alpha is not None
    assert (picture.alpha[:, 360:] == 65535).all() and (picture.alpha[100:120, 100:120] == 0).all()
    assert np.array_equal(picture.values[:, :360], np.rint(photo.pixels * 65535).astype(np.uint16))


def test_what_is_hidden_in_the_photo_is_filled_as_well() -> None:
    given = cropped(drawn(ENDLESS))
    hole = np.zeros(given.valid.shape, bool)
    hole[100:140, 100:160] = True
    masked = dataclasses.replace(given, pixels=np.where(hole[:, :, None], np.float32(0), given.pixels))
    clear = dataclasses.replace(given, valid=~hole)
    for found in (
        extend(masked, on_crop(PART), by=Margins(0, 0, 20, 0), focal_mm=FOCAL, mask=hole),
        extend(clear, on_crop(PART), by=Margins(0, 0, 20, 0), focal_mm=FOCAL),
    ):
        assert np.abs(found.pixels[:, :360] - given.pixels)[hole].mean() * 255 < 5
        assert np.array_equal(found.pixels[:, :360][~hole], given.pixels[~hole])
        assert found.filled == found.record()["filled"] == hole.sum() and found.paint().alpha is None


def test_what_was_transparent_stays_so_where_the_pattern_does_not_go_on() -> None:
    text = LATTICE.replace("range(-4, 5)", "range(-2, 3)").replace("range(-3, 4)", "range(-14, 15)")
    photo = drawn(text)
    valid = np.ones_like(photo.valid)
    valid[150:200, :20] = False  # beside the pattern
    found = extend(
        dataclasses.replace(photo, valid=valid), loads(text), by=Margins(0, 0, 0, 10), beyond="continue"
    )
    assert found.alpha is not None and (found.alpha[150:200, :20] == 0).all() and found.filled == 0


def test_a_painted_border_takes_no_part_in_what_is_added() -> None:
    given, whole = cropped(drawn(ENDLESS)), drawn(ENDLESS)
    framed = given.pixels.copy()
    for side in (framed[:8], framed[-8:], framed[:, :8], framed[:, -8:]):
        side[:] = (0.6, 0.05, 0.1)
    photo = dataclasses.replace(given, pixels=framed)
    found = extend(photo, on_crop(PART), by=ALL_AROUND, focal_mm=FOCAL)
    assert any("left 8, top 8, right 8, bottom 8" in note for note in found.notes)
    assert np.abs(found.pixels - whole.pixels)[outside(whole)].mean() * 255 < 8
    assert np.array_equal(found.pixels[MARGIN:-MARGIN, MARGIN:-MARGIN], framed)
    assert not any("photo's edge" in note for note in extend(given, on_crop(PART), by=ALL_AROUND).notes)


def test_cells_are_counted_at_the_middle_of_a_side() -> None:
    laid = placed(loads(LATTICE), drawn(LATTICE))
    one = margins_px(laid, parse_margins("0,0,1,0", option="--cells"))
    two = margins_px(laid, parse_margins("0,0,2,0", option="--cells"))
    pitch = np.diff(laid.centers_px()[0][laid.index[:, 1] == 0][-2:, 0])[0]
    assert one[:2] == (0, 0) and one[3] == 0
    assert 0.8 * pitch < one[2] < 1.3 * pitch
    assert 1.9 < two[2] / one[2] < 2.3


def test_the_horizon_is_refused_with_the_side_that_meets_it() -> None:
    steep = LATTICE.replace("rx=-30", "rx=-62")
    with pytest.raises(UsageError, match=r"horizon lies .* let the top side grow by less"):
        extend(drawn(steep), loads(steep), by=Margins(0, 100, 0, 0, "%"), beyond="continue")
    with pytest.raises(UsageError, match="horizon lies"):
        extend(drawn(steep), loads(steep), by=Margins(0, 500, 0, 0, "cells"), beyond="transparent")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,2", "write one number, or four"),
        ("-5", "write one number, or four"),
        ("10%,5px,0,0", "all sides in per cent, or all in pixels"),
        ("0", "grow by nothing"),
        ("ten", "write one number, or four"),
    ],
)
def test_margins_that_cannot_be_are_refused(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        parse_margins(text)


def test_margins_are_read_for_all_sides_or_each() -> None:
    assert parse_margins("20%") == Margins(20, 20, 20, 20, "%")
    assert parse_margins("10%,0,10%,0") == Margins(10, 0, 10, 0, "%")
    assert parse_margins("40") == parse_margins("40px") == Margins(40, 40, 40, 40, "px")
    assert parse_margins("2,0,1,0", option="--cells") == Margins(2, 0, 1, 0, "cells")


@pytest.mark.parametrize("k1", [-0.1, 0.1])
def test_a_bent_photo_is_straightened_and_then_continued(k1: float) -> None:
    whole = drawn(ENDLESS)
    given = cropped(whole)
    at = straight_from_photo(pixel_grid(given.size), k1, size=given.size).numpy() + MARGIN
    bent = dataclasses.replace(given, pixels=remapped(whole.pixels, whole.valid, at)[0])
    program = dataclasses.replace(on_crop(PART), header=Header(lens_k1=k1))
    found = extend(bent, program, by=ALL_AROUND, focal_mm=FOCAL)
    hole = outside(whole)
    apart = np.abs(found.pixels - whole.pixels).mean(2) * 255
    assert apart[hole].mean() < 7
    assert apart[~hole].mean() < 7, "what the straight picture lacks inside the frame is filled as well"
    corners = [
        apart[y : y + 8, x : x + 8].mean() for x in (MARGIN, -MARGIN - 8) for y in (MARGIN, -MARGIN - 8)
    ]
    assert max(corners) < 10
    assert np.abs(bent.pixels - given.pixels).mean() * 255 > 15, "the lens matters"
    assert found.paint().alpha is None
    assert any("straightened first" in note for note in found.notes)
    assert found.program is not None and found.program.header is not None
    assert found.program.header.lens_k1 is None


@pytest.mark.parametrize("unlike", [False, True])
def test_a_note_warns_of_ghosts_where_the_objects_differ_much(unlike: bool) -> None:
    photo = drawn(ENDLESS)
    random = np.random.default_rng(0)
    rows, columns = np.mgrid[: photo.size.height, : photo.size.width]
    pixels = photo.pixels.copy()
    for x, y in placed(loads(ENDLESS), photo).centers_px()[0]:
        disc = np.hypot(columns - x, rows - y) < 14
        if unlike:
            pixels[disc] = random.random(3)
    given = cropped(dataclasses.replace(photo, pixels=pixels))
    found = extend(given, on_crop(PART), by=Margins(20, 0, 0, 0), focal_mm=FOCAL)
    assert found.added
    assert any("ghosts" in note for note in found.notes) is unlike


def test_too_large_pictures_are_refused() -> None:
    photo = drawn(LATTICE)
    with pytest.raises(UsageError, match="more than --max-px 1,000"):
        extend(photo, loads(LATTICE), max_px=1000)


def test_the_command_writes_the_picture_and_its_facts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_image(tmp_path / "a.png", drawn(LATTICE).pixels)
    (tmp_path / "a.p3p").write_text(LATTICE)
    words = ["extend", str(tmp_path / "a.png"), str(tmp_path / "a.p3p"), "-o", str(tmp_path / "b.png")]
    assert run([*words, "--by", "0,0,5%,0", "--beyond", "continue", "--json", str(tmp_path / "b.json")]) == 0
    assert read_image(tmp_path / "b.png").size.width == 480 + 24
    assert '"right": 24' in (tmp_path / "b.json").read_text()
    assert run([*words, "--by", "5%", "--cells", "1", "--force"]) == 2
    assert "give one of them" in capsys.readouterr().err

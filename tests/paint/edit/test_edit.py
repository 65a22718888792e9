"""Objects laid anew: what is kept, what goes, what comes, and what is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.cli.main import run
from p3i.errors import UsageError
from p3i.options.edit import parse_scale
from p3i.paint.edit.edit import edit
from p3i.paint.fill.cleared import covered
from p3i.paint.fill.cutout import cutout
from p3i.paint.fill.inpaint import inpaint
from p3i.place.placed import placed
from p3i.vision.image import Image, read_image
from p3i.vision.sheet import project
from p3i.vision.write import write_image

SPARSER = LATTICE.replace("9*i", "18*i").replace("range(-4, 5)", "range(-2, 3)")
DENSER = LATTICE.replace("9*i", "6*i").replace("9*j", "6*j")
SHIFTED = LATTICE.replace("9*i + 1", "9*i + 5.5")
RING_HERE = RING.split("\n", 1)[1]  # without a camera of its own


def near(photo: Image, text: str, radius_px: float) -> np.ndarray:
    """The pixels around the objects of a program."""
    rows, columns = np.mgrid[0 : photo.size.height, 0 : photo.size.width]
    found = np.zeros(photo.valid.shape, bool)
    for x, y in placed(loads(text), photo).centers_px()[0]:
        found |= np.hypot(columns - x, rows - y) < radius_px
    return found


def wrong(pixels: np.ndarray, other: np.ndarray, where: np.ndarray) -> float:
    return float(np.abs(pixels - other)[where].mean()) * 255


@pytest.mark.parametrize("text", [LATTICE, RING])
def test_the_same_program_leaves_the_photo_as_it_is(text: str) -> None:
    photo = drawn(text)
    found = edit(photo, loads(text), loads(text))
    assert np.array_equal(found.pixels, photo.pixels)
    assert not found.touched.any()
    assert (found.removed, found.copied) == (0, 0)


@pytest.mark.parametrize("text", [LATTICE, RING])
def test_the_object_of_a_cell_is_told_from_its_ground(text: str) -> None:
    """The marks have a radius of 3.2 units."""
    photo = drawn(text)
    cut = cutout(placed(loads(text), photo), photo)
    assert cut.clear
    assert 3.0 < cut.radius < 4.2


def test_a_sparser_program_removes_every_other_column_and_keeps_the_rest() -> None:
    photo = drawn(LATTICE)
    found = edit(photo, loads(LATTICE), loads(SPARSER))
    assert (found.kept, found.removed, found.copied) == (35, 28, 0)
    expected = drawn(SPARSER)
    gone = near(photo, LATTICE, 24) & ~near(photo, SPARSER, 26)
    assert wrong(photo.pixels, expected.pixels, gone) > 30
    assert wrong(found.pixels, expected.pixels, gone) < 4
    kept = near(photo, SPARSER, 12)
    assert np.array_equal(found.pixels[kept], photo.pixels[kept])


@pytest.mark.parametrize("text", [SHIFTED, RING_HERE])
def test_added_objects_look_as_if_they_had_always_been_there(text: str) -> None:
    photo = drawn(LATTICE)
    found = edit(photo, loads(LATTICE), loads(text))
    camera = LATTICE.split("\n", 1)[0] + "\n"
    laid = placed(loads(text if text.startswith("Set") else camera + text), photo)
    assert found.copied > 5
    for x, y in np.rint(laid.centers_px()[0]).astype(int):
        here = found.pixels[y - 3 : y + 4, x - 3 : x + 4].mean((0, 1))
        assert here[1] > 1.2 * here[2] and here.mean() < 0.45, "a mark is dark and green in its middle"


def test_marks_turn_with_their_ring() -> None:
    """The ring's marks are redder outwards; copied unturned some would be redder inwards."""
    photo = drawn(RING)
    new = RING.replace("30*i)", "30*i + 15)")
    found = edit(photo, loads(RING), loads(new))
    expected = drawn(new)
    marks = near(photo, new, 11)
    assert found.removed == found.copied == 12
    assert wrong(found.pixels, expected.pixels, marks) < 8


def test_new_objects_shrink_with_their_spacing_unless_told_otherwise() -> None:
    photo = drawn(LATTICE)
    small = edit(photo, loads(LATTICE), loads(DENSER))
    large = edit(photo, loads(LATTICE), loads(DENSER), scale=1.0)
    assert any("67% as large" in note for note in small.notes)
    green = [float((one.pixels[:, :, 0] < 0.42).mean()) for one in (small, large)]
    assert green[0] < 0.7 * green[1]


def test_what_is_not_touched_stays_to_the_bit_in_sixteen_bits_with_alpha(tmp_path: Path) -> None:
    alpha = np.ones((400, 480), np.float32)
    alpha[:30, :30] = 0
    write_image(tmp_path / "a.png", drawn(LATTICE).pixels + np.float32(100 / 65535), alpha=alpha, bits=16)
    photo = read_image(tmp_path / "a.png")
    found = edit(photo, loads(LATTICE), loads(SPARSER), keep_transparent=True)
    picture = found.paint()
    assert picture.bits == 16 and picture.alpha is not None
    assert np.array_equal(picture.alpha, np.rint(alpha * 65535).astype(np.uint16))
    same = ~found.touched & photo.valid
    assert np.array_equal(picture.values[same], np.rint(photo.pixels[same] * 65535).astype(np.uint16))


def hidden_right(photo: Image, from_x: int) -> tuple[Image, np.ndarray]:
    """The photo without what lies right of `from_x`, and a mask of that."""
    hole = np.zeros(photo.valid.shape, bool)
    hole[:, from_x:] = True
    return dataclasses.replace(photo, pixels=np.where(hole[:, :, None], np.float32(0), photo.pixels)), hole


def test_the_same_program_fills_hidden_ground_as_inpaint_does() -> None:
    photo, hole = hidden_right(drawn(LATTICE), 390)
    short = loads(LATTICE.replace("range(-4, 5)", "range(-4, 4)"))
    found, filled = edit(photo, short, short, mask=hole), inpaint(photo, short, mask=hole)
    assert np.array_equal(found.pixels, filled.pixels)
    assert found.added == filled.added and len(found.added) > 5
    record = found.record()
    assert (record["filled"], record["unlike"], record["added"]) == tuple(
        filled.record()[name] for name in ("filled", "unlike", "added")
    )


def test_a_sparser_program_goes_on_over_hidden_ground() -> None:
    """The old program ends at the hole, and so does the new one; both go on, the new one every other step."""
    photo, hole = hidden_right(drawn(LATTICE), 340)
    short = LATTICE.replace("range(-4, 5)", "range(-4, 3)")
    sparser = short.replace("9*i", "18*i").replace("range(-4, 3)", "range(-2, 2)")
    found = edit(photo, loads(short), loads(sparser), mask=hole)
    assert wrong(found.pixels, drawn(SPARSER).pixels, hole & near(photo, LATTICE, 12)) < 8


def test_what_is_transparent_is_filled_where_it_is_pattern_unless_told_otherwise() -> None:
    photo = drawn(LATTICE)
    valid = np.ones_like(photo.valid)
    valid[180:240, 200:280] = False
    given = dataclasses.replace(photo, valid=valid)
    found = edit(given, loads(LATTICE), loads(SPARSER))
    assert found.paint().alpha is None and np.array_equal(found.filled, ~valid)
    assert wrong(found.pixels, drawn(SPARSER).pixels, ~valid) < 6
    kept = edit(given, loads(LATTICE), loads(SPARSER), keep_transparent=True)
    alpha = kept.paint().alpha
    assert alpha is not None and np.array_equal(alpha > 0, valid) and not kept.filled.any()


def test_a_mask_is_refused_by_name(tmp_path: Path) -> None:
    photo = drawn(LATTICE)
    with pytest.raises(UsageError, match="a mask is bool"):
        edit(photo, loads(LATTICE), loads(SPARSER), mask=np.zeros((3, 4), bool))
    with pytest.raises(UsageError, match="takes all of the photo"):
        edit(photo, loads(LATTICE), loads(SPARSER), mask=np.ones(photo.valid.shape, bool))


def test_a_cell_without_an_object_is_said_to_have_none() -> None:
    photo = drawn(LATTICE)
    plain = dataclasses.replace(photo, pixels=np.full_like(photo.pixels, 0.5))
    found = edit(plain, loads(LATTICE), loads(SPARSER))
    assert any("no object stands out" in note for note in found.notes)
    assert wrong(found.pixels, plain.pixels, found.touched) < 1


@pytest.mark.parametrize(
    ("radius", "striped", "coloured", "says"),
    [
        (3.2, False, False, None),
        (3.2, True, False, None),
        (3.2, False, True, "differ much"),
        (4.15, False, False, "borders"),
    ],
)
def test_a_note_says_where_an_edit_is_not_to_be_relied_on(
    radius: float, striped: bool, coloured: bool, says: str | None
) -> None:
    size = drawn(LATTICE).size
    laid = placed(loads(LATTICE), drawn(LATTICE))
    x, y = np.meshgrid(np.arange(size.width), np.arange(size.height))
    plane, _ = project(np.linalg.inv(laid.image_from_plane), np.stack([x, y], -1).astype(float))
    pixels = np.full((size.height, size.width, 3), 0.75, np.float32)
    if striped:
        # Bars between the objects, along one direction only: ground that runs on, and stays.
        pixels[np.abs((plane[..., 0] - laid.origin[0]) % 9 - 4.5) < 0.8] = (0.1, 0.3, 0.5)
    random = np.random.default_rng(0)
    for point in laid.points:
        disc = np.hypot(*np.moveaxis(plane - point, -1, 0)) < radius
        pixels[disc] = (0.2, 0.1, 0.3)
        turn = random.uniform(0, 2 * np.pi)
        upper = (plane - point) @ (np.cos(turn), np.sin(turn)) > 0
        for half in (disc & upper, disc & ~upper) if coloured else ():
            pixels[half] = random.integers(0, 2, 3)
    found = edit(Image(pixels, np.ones(x.shape, bool)), loads(LATTICE), loads(SPARSER))
    doubts = [note for note in found.notes if "look at the result" in note]
    assert len(doubts) == (says is not None)
    assert says is None or says in doubts[0]


def test_only_what_the_objects_cover_is_cleared() -> None:
    photo = drawn(LATTICE)
    laid = placed(loads(LATTICE), photo)
    mask = covered(laid, cutout(laid, photo))
    marks = photo.pixels[:, :, 2] < 0.3
    assert (mask | ~marks).mean() > 0.999
    assert mask.sum() < 1.6 * marks.sum()


def test_scales_that_cannot_be_and_photos_without_objects_are_refused() -> None:
    assert parse_scale("auto") is None
    assert parse_scale("0.5") == 0.5
    with pytest.raises(UsageError, match="write auto or a number"):
        parse_scale("small")
    far = LATTICE.replace("9*i + 1", "9*i + 400")
    with pytest.raises(UsageError, match="nothing to copy"):
        edit(drawn(LATTICE), loads(far), loads(LATTICE))
    with pytest.raises(UsageError, match=r"between 0\.05 and 20"):
        edit(drawn(LATTICE), loads(LATTICE), loads(SPARSER), scale=0.0)


def test_the_command_writes_the_picture_and_its_facts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_image(tmp_path / "a.png", drawn(LATTICE).pixels)
    (tmp_path / "old.p3p").write_text(LATTICE)
    (tmp_path / "new.p3p").write_text(SPARSER)
    words = ["edit", *(str(tmp_path / name) for name in ("a.png", "old.p3p", "new.p3p"))]
    assert run([*words, "-o", str(tmp_path / "b.png"), "--json", str(tmp_path / "b.json")]) == 0
    assert "35 objects kept, 28 removed, 0 added" in capsys.readouterr().err
    assert '"removed": 28' in (tmp_path / "b.json").read_text()
    assert run([*words, "-o", str(tmp_path / "c.png"), "--scale", "tiny"]) == 2

"""Holes filled by the program: what stays, what comes in, and what cannot be filled."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.errors import FileError, UsageError
from p3i.evaluation.scenes import scene
from p3i.paint.fill.holes import parse_index
from p3i.paint.fill.inpaint import inpaint
from p3i.place.moves import moves
from p3i.place.placed import placed
from p3i.vision.image import Image, read_image
from p3i.vision.write import write_image


def cell_hole(photo: Image, text: str, number: int) -> np.ndarray:
    laid = placed(loads(text), photo)
    at = laid.centers_px()[0][number]
    rows, columns = np.mgrid[0 : photo.size.height, 0 : photo.size.width]
    return np.hypot(columns - at[0], rows - at[1]) < 22


@pytest.mark.parametrize(("text", "number"), [(LATTICE, 31), (RING, 4)])
def test_a_hidden_cell_comes_back_as_it_was(text: str, number: int) -> None:
    photo = drawn(text)
    hole = cell_hole(photo, text, number)
    given = dataclasses.replace(photo, pixels=np.where(hole[:, :, None], np.float32(0), photo.pixels))
    found = inpaint(given, loads(text), mask=hole)
    wrong = np.abs(found.pixels - photo.pixels)[hole].mean() * 255
    assert wrong < 4, f"mean L1 {wrong:.1f}"
    assert found.unlike == 0


def test_what_lies_outside_the_hole_stays_to_the_bit(tmp_path: Path) -> None:
    photo = drawn(LATTICE)
    hole = cell_hole(photo, LATTICE, 31)
    write_image(tmp_path / "a.png", photo.pixels)
    found = inpaint(read_image(tmp_path / "a.png"), loads(LATTICE), mask=hole)
    found.save(tmp_path / "b.png")
    before, after = (read_image(tmp_path / name).pixels for name in ("a.png", "b.png"))
    assert np.array_equal(before[~hole], after[~hole])
    assert not np.array_equal(before[hole], after[hole])


def test_sixteen_bits_and_transparency_are_kept(tmp_path: Path) -> None:
    photo = drawn(LATTICE)
    hole = cell_hole(photo, LATTICE, 31)
    alpha = np.ones(hole.shape, np.float32)
    alpha[:40] = 0
    alpha[hole] = 0
    fine = photo.pixels + np.float32(100 / 65535)
    write_image(tmp_path / "a.png", fine, alpha=alpha, bits=16)
    given = read_image(tmp_path / "a.png")
    found = inpaint(given, loads(LATTICE), mask=hole).paint()
    assert found.bits == 16
    assert found.alpha is not None
    assert (found.alpha[hole] == 65535).all() and (found.alpha[:40] == 0).all()
    outside = ~hole & given.valid
    assert np.array_equal(found.values[outside], np.rint(given.pixels[outside] * 65535).astype(np.uint16))


def test_without_a_mask_the_transparent_part_is_filled() -> None:
    photo = drawn(LATTICE)
    hole = cell_hole(photo, LATTICE, 31)
    given = dataclasses.replace(photo, valid=~hole)
    found = inpaint(given, loads(LATTICE))
    assert np.array_equal(found.hole, hole)
    assert np.abs(found.pixels - photo.pixels)[hole].mean() * 255 < 4


def test_objects_are_restored_by_index_and_by_name() -> None:
    photo, program = drawn(LATTICE), loads(LATTICE)
    by_index = inpaint(photo, program, restore=["0,0"]).hole
    assert by_index.sum() > 100
    assert np.array_equal(inpaint(photo, program, restore=[(0, 0)]).hole, by_index)
    assert np.array_equal(inpaint(photo, program, restore=["d5"]).hole, by_index)


@pytest.mark.parametrize(
    ("method", "instead"),
    [
        ("stack", "surroundings are continued"),
        ("npn", "surroundings are continued"),
        ("patchmatch", "patchmatch takes what looks alike"),
    ],
)
def test_a_hole_like_nothing_else_is_said_to_be_so_by_every_method(method: str, instead: str) -> None:
    photo = drawn(LATTICE)
    hole = np.zeros(photo.valid.shape, bool)
    hole[:30, :30] = True
    alone = loads(LATTICE.replace("range(-4, 5)", "range(0, 1)").replace("range(-3, 4)", "range(0, 1)"))
    found = inpaint(photo, alone, mask=hole, method=method)
    assert found.unlike == found.fallback == 1
    assert [note for note in found.notes if "100% of the hole the program has nothing like it" in note]
    assert any(instead in note for note in found.notes)
    assert np.isfinite(found.pixels).all()


@pytest.mark.parametrize("method", ["stack", "npn", "patchmatch"])
def test_every_method_tells_the_same_facts(method: str) -> None:
    photo = drawn(LATTICE, width=200, height=160)
    hole = np.zeros(photo.valid.shape, bool)
    hole[70:85, 90:105] = True
    soon = {"time_s": 0.1} if method == "npn" else {}
    found = inpaint(photo, loads(LATTICE), mask=hole, method=method, **soon)
    record = found.record()
    assert set(record) == {
        "photo", "method", "filled", "removed", "unlike", "fallback", "added", "holes", "notes",
    }  # fmt: skip
    assert (record["method"], record["filled"], record["unlike"]) == (method, found.hole.sum(), 0)
    assert record["notes"] == list(found.notes)


def test_the_pattern_goes_on_through_a_hole_at_whose_rim_the_program_ends() -> None:
    """What the search finds with the right third hidden; the pattern is seen to end in its rows only."""
    photo = drawn(LATTICE)
    laid = placed(loads(LATTICE), photo)
    edge = int(laid.centers_px()[0][laid.index[:, 0] == 2][:, 0].min()) - 24
    hole = np.zeros(photo.valid.shape, bool)
    hole[:, edge:] = True
    given = dataclasses.replace(photo, pixels=np.where(hole[:, :, None], np.float32(0), photo.pixels))
    found = inpaint(given, loads(LATTICE.replace("range(-4, 5)", "range(-4, 2)")), mask=hole)
    assert {(i, j) for i in range(2, 5) for j in range(-3, 4)} <= set(found.added)
    assert found.record()["added"] == [list(index) for index in found.added]
    assert any("goes on through the hole" in note for note in found.notes)
    cells = hole & (np.arange(480)[None] < laid.centers_px()[0][:, 0].max())
    assert found.unlike < 0.2, "no smear"
    assert np.abs(found.pixels - photo.pixels)[cells].mean() * 255 < 14


def test_npn_says_so_where_it_gives_the_stacks_fill_to_a_hole_of_many_cells() -> None:
    photo = drawn(LATTICE, width=240, height=200)
    hole = np.zeros(photo.valid.shape, bool)
    hole[10:190, 10:165] = True
    found = inpaint(photo, loads(LATTICE), mask=hole, method="npn", steps=1)
    plain = inpaint(photo, loads(LATTICE), mask=hole)
    assert np.array_equal(found.pixels, plain.pixels)
    assert found.fallback == 1 > found.unlike
    assert any("too few other cells" in note and "the stack's fill stands" in note for note in found.notes)


def test_light_is_matched_at_the_hole() -> None:
    """A patch copied without matching would be off by the light's slope: about 12 of 255 a cell."""
    photo = drawn(LATTICE)
    ramp = np.linspace(0.55, 1.0, photo.size.width, dtype=np.float32)[None, :, None]
    lit = dataclasses.replace(photo, pixels=photo.pixels * ramp)
    hole = cell_hole(photo, LATTICE, 31)
    found = inpaint(lit, loads(LATTICE), mask=hole)
    assert np.abs(found.pixels - lit.pixels)[hole].mean() * 255 < 4


@pytest.mark.parametrize(
    ("mask", "said"),
    [
        (np.zeros((400, 480), bool), "nothing is to be filled"),
        (np.ones((400, 480), bool), "all of the photo"),
    ],
)
def test_empty_and_full_masks_are_refused(mask: np.ndarray, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        inpaint(drawn(LATTICE), loads(LATTICE), mask=mask)


def test_a_mask_of_another_size_is_refused(tmp_path: Path) -> None:
    write_image(tmp_path / "mask.png", np.ones((20, 30, 3), np.uint8) * 255)
    with pytest.raises(FileError, match="30 x 20, but the photo is 480 x 400"):
        inpaint(drawn(LATTICE), loads(LATTICE), mask=tmp_path / "mask.png")


def test_an_object_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(UsageError, match=r"there is no object Z9 .*A1, A2, A3"):
        inpaint(drawn(LATTICE), loads(LATTICE), remove=["Z9"])


def test_moves_lay_each_object_on_each_other() -> None:
    for text in (LATTICE, RING):
        laid = placed(loads(text), drawn(text))
        found = moves(laid, 2)
        np.testing.assert_allclose(
            found[:, :2, :2] @ laid.points[2] + found[:, :2, 2], laid.points, atol=1e-9
        )
    turn = moves(placed(loads(RING), drawn(RING)), 0)[3]
    np.testing.assert_allclose(turn[:2, 0], [0, 1], atol=1e-12)  # three steps of 30 degrees


def test_pieces_of_any_scene_are_filled_alike_twice() -> None:
    one = scene("lattice", 3)
    photo = one.image()
    hole = np.zeros(photo.valid.shape, bool)
    hole[photo.size.height // 2 - 20 :][:40, photo.size.width // 2 - 20 :][:, :40] = True
    first, second = (inpaint(photo, one.program, mask=hole).pixels for _ in range(2))
    assert np.array_equal(first, second)


def test_indices_are_two_whole_numbers() -> None:
    assert parse_index(" -3, 4") == (-3, 4)
    assert parse_index("B3") is None
    assert parse_index("1,2,3") is None


def test_patchmatch_puts_a_mark_where_one_was() -> None:
    """Outside the hole nothing changes, and a mark comes back where one was."""
    photo = drawn(LATTICE)
    hole = cell_hole(photo, LATTICE, 31)
    given = dataclasses.replace(photo, pixels=np.where(hole[:, :, None], np.float32(0), photo.pixels))
    found = inpaint(given, loads(LATTICE), mask=hole, method="patchmatch")
    assert np.array_equal(found.pixels[~hole], given.pixels[~hole])
    assert np.abs(found.pixels - photo.pixels)[hole].mean() * 255 < 12


def test_patchmatch_on_a_ring_says_that_nothing_guides_it() -> None:
    photo = drawn(RING)
    found = inpaint(photo, loads(RING), mask=cell_hole(photo, RING, 4), method="patchmatch")
    assert any("unguided" in note for note in found.notes)
    assert found.unlike == 0 and found.fallback == 1


def test_without_pypatchmatch_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "patchmatch", None)
    photo = drawn(LATTICE)
    with pytest.raises(UsageError, match=r"p3i\[patchmatch\]"):
        inpaint(photo, loads(LATTICE), mask=cell_hole(photo, LATTICE, 31), method="patchmatch")

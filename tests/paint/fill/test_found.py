"""What is marred is found, what is not is not; holes that the pattern cannot fill are told of, one by one."""

import dataclasses

import numpy as np
import pytest
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.errors import UsageError
from p3i.paint.fill.found import find_marred
from p3i.paint.fill.inpaint import inpaint
from p3i.place.placed import placed
from p3i.vision.image import Image


def place_of(text: str, photo: Image, number: int) -> np.ndarray:
    return placed(loads(text), photo).centers_px()[0][number]


def stained(text: str, number: int) -> tuple[Image, np.ndarray]:
    """A photo with a brown blot beside an object, and where the blot is."""
    photo = drawn(text)
    x, y = place_of(text, photo, number) + np.array([6, 4])
    rows, columns = np.mgrid[: photo.size.height, : photo.size.width]
    blot = np.hypot(columns - x, (rows - y) * 1.4) < 11
    pixels = np.where(blot[..., None], np.float32((0.35, 0.2, 0.1)), photo.pixels)
    return dataclasses.replace(photo, pixels=pixels), blot


@pytest.mark.parametrize("text", [LATTICE, RING])
def test_nothing_is_marred_in_a_pattern_without_a_flaw(text: str) -> None:
    found = find_marred(drawn(text), loads(text))
    assert not found.mask.any() and not found.mars
    assert any("nothing is marred" in note for note in found.notes)


@pytest.mark.parametrize(("text", "number"), [(LATTICE, 31), (RING, 4)])
def test_a_blot_is_found_and_can_be_filled(text: str, number: int) -> None:
    photo, blot = stained(text, number)
    found = find_marred(photo, loads(text))
    assert len(found.mars) == 1
    assert (found.mask & blot).sum() > 0.95 * blot.sum()
    assert found.mask.sum() < 3.5 * blot.sum()
    facts = found.record()["found"][0]
    assert facts["objects"][0]["share"] > 0.05
    filled = inpaint(photo, loads(text), mask=found.mask)
    assert np.abs(filled.pixels - drawn(text).pixels)[blot].mean() * 255 < 6
    overlay = found.overlay().values
    assert np.array_equal(overlay[~found.mask], np.rint(photo.pixels[~found.mask] * 255).astype(np.uint8))


def test_too_few_cells_tell_nothing() -> None:
    few = LATTICE.replace("range(-4, 5)", "range(0, 2)").replace("range(-3, 4)", "range(0, 2)")
    with pytest.raises(UsageError, match="too few cells"):
        find_marred(drawn(LATTICE), loads(few))


def lettered() -> Image:
    """Objects each of which has another sign on it."""
    photo = drawn(LATTICE)
    pixels, random = photo.pixels.copy(), np.random.default_rng(3)
    for x, y in np.rint(placed(loads(LATTICE), photo).centers_px()[0]).astype(int):
        for _ in range(5):
            dx, dy = random.integers(-9, 6, 2)
            pixels[max(0, y + dy) : y + dy + 4, max(0, x + dx) : x + dx + 4] = random.uniform(0, 1, 3)
    return dataclasses.replace(photo, pixels=pixels)


def test_where_objects_differ_from_one_another_a_fill_is_said_to_be_a_guess() -> None:
    photo = lettered()
    rows, columns = np.mgrid[: photo.size.height, : photo.size.width]
    x, y = place_of(LATTICE, photo, 31)
    hole = np.hypot(columns - x, rows - y) < 9
    found = inpaint(photo, loads(LATTICE), mask=hole, only_pattern=True)
    assert found.holes[0].guess > 0.5
    assert "a guess" in found.holes[0].note
    assert any("a guess" in note for note in found.notes)
    alpha = found.paint().alpha
    assert alpha is not None
    assert (alpha[found.foreign] == 0).all() and (alpha[~hole] == 255).all()
    plain = inpaint(drawn(LATTICE), loads(LATTICE), mask=hole, only_pattern=True)
    assert plain.holes[0].guess == 0 and plain.paint().alpha is None


def test_what_runs_into_a_hole_is_told_and_each_hole_has_its_own_facts() -> None:
    photo, blot = stained(LATTICE, 31)
    rows, columns = np.mgrid[: photo.size.height, : photo.size.width]
    x = place_of(LATTICE, photo, 31)[0] + 6
    half = blot & (columns > x + 2)
    far = np.hypot(*(np.stack([columns, rows], -1) - place_of(LATTICE, photo, 10)).transpose(2, 0, 1)) < 6
    found = inpaint(photo, loads(LATTICE), mask=half | far)
    assert [one.pixels for one in found.holes] == sorted((int(half.sum()), int(far.sum())), reverse=True)
    facts = {one.pixels: one for one in found.holes}
    assert facts[int(half.sum())].rim > 0.1
    assert facts[int(far.sum())].rim == 0 and not facts[int(far.sum())].note
    record = found.record()["holes"]
    assert len(record) == 2 and all(len(one["box"]) == 4 for one in record)

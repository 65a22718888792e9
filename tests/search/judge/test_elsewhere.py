"""Two patterns on one photo: the dominant one is the answer, and says where the other lies."""

import re

import cv2
import numpy as np
import pytest
import torch
from drawn import DrawnRing
from truth import SMALL, pose_error_deg, small_scene

from p3i.evaluation.lattice_scenes import lattice_scene
from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.search import synthesize as synthesize_module
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.places import measured, numbers_of
from p3i.search.forms.spelled import ring_filling
from p3i.search.judge.elsewhere import with_others
from p3i.search.judge.region import objects_px
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import NEEDED_BITS
from p3i.search.synthesize import searched, synthesize
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid

LEFT, RIGHT = 3, 18


def side_by_side() -> Image:
    return beside(small_scene(LEFT).pixels, small_scene(RIGHT).pixels)


def beside(left: np.ndarray, right: np.ndarray) -> Image:
    """The left half of one scene and the right half of another, whose planes differ."""
    pixels = left.copy()
    half = pixels.shape[1] // 2
    pixels[:, half:] = right[:, half:]
    return Image(pixels.astype(np.float32) / 255, np.ones(pixels.shape[:2], bool))


def test_another_plane_is_told_of_with_its_place() -> None:
    result = synthesize(side_by_side(), SearchConfig(structure="lattice"))
    assert result.program is not None
    of_left = pose_error_deg(result.program, small_scene(LEFT).program)
    of_right = pose_error_deg(result.program, small_scene(RIGHT).program)
    assert min(of_left, of_right) < 3
    said = re.compile(r"another pattern lies around \((\d+), (\d+)\): .+")
    told = [said.fullmatch(note) for note in result.notes]
    place = next((match for match in told if match), None)
    assert place is not None, result.notes
    assert (int(place[1]) > SMALL.width / 2) == (of_left < of_right), "it lies on the other side"
    corners = np.array(result.region)
    assert (corners[:, 0].mean() < SMALL.width / 2) == (of_left < of_right)


def place_told(notes: tuple[str, ...]) -> tuple[float, float]:
    said = re.compile(r"another pattern lies around \((-?\d+), (-?\d+)\): .+")
    (told,) = [match for note in notes if (match := said.fullmatch(note))]
    return float(told[1]), float(told[2])


def test_under_a_lens_the_other_plane_is_where_the_photo_as_it_is_shows_it() -> None:
    straight, k1 = side_by_side(), -0.25
    at = straight_from_photo(pixel_grid(SMALL), k1, size=SMALL).numpy()
    pixels = cv2.remap(
        straight.pixels, at[..., 0].copy(), at[..., 1].copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    bent = Image(pixels, straight.valid)
    plain = place_told(synthesize(straight, SearchConfig(structure="lattice")).notes)
    through = place_told(synthesize(bent, SearchConfig(structure="lattice", lens=k1)).notes)
    expected, _ = photo_from_straight(torch.tensor([plain], dtype=torch.float64), k1, size=SMALL)
    # Not all of the same objects are found; on the canvas without the lens it lies 100 pixels off.
    assert through == pytest.approx(expected[0].tolist(), abs=30)


def test_a_plane_whose_cells_reach_into_the_answers_region_is_told_of_too() -> None:
    image = beside(lattice_scene(35).pixels, lattice_scene(59).pixels)
    result = synthesize(image, SearchConfig(structure="lattice"))
    assert any("another pattern lies around" in note for note in result.notes), result.notes


def test_the_pattern_that_says_more_is_the_answer_though_another_was_found_first() -> None:
    look = Session(Evidence(side_by_side(), SearchConfig(), 35.0), SearchConfig(structure="lattice"))
    found = searched(look)
    worked_out = [synthesize_module._finished(look, fit) for fit in found.fits]
    answers = sorted((one for one in worked_out if one is not None), key=lambda one: -one.worth)
    dominant = answers[0]
    beside = next(
        one for one in answers if abs(_across(look, one) - _across(look, dominant)) > SMALL.width / 4
    )
    told = with_others(look, found.fits, [beside], finish=synthesize_module._finished)
    assert told[0].program == dominant.program
    assert told[0].others[0].center[0] == pytest.approx(_across(look, beside), abs=2)
    assert beside.program in [one.program for one in told[1:]]


def _across(look: Session, answer: Answer) -> float:
    """How far from the left, in pixels, the middle of an answer's objects lies."""
    return float(np.median(objects_px(answer, look.evidence.image, 35.0)[:, 0]))


def test_of_a_single_pattern_nothing_is_told() -> None:
    result = synthesize(small_scene(LEFT).image(), SearchConfig(structure="lattice"))
    assert result.program is not None
    assert not any("another" in note for note in result.notes)


def test_a_ring_that_was_fitted_beside_the_answer_is_no_lattice_to_be_worked_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The ring's objects lie on the other half; what they mean as a lattice must not even be asked.
    lattice, ring = small_scene(LEFT), DrawnRing(center=(28.0, 0.0), radius=12.0, size=4.0)
    image = beside(lattice.pixels, (ring.image().pixels * 255).astype(np.uint8))
    look = Session(Evidence(image, SearchConfig(), 35.0), SearchConfig())
    found = searched(look)
    fit = measured(look.evidence, ring_filling(12), _numbers_of(ring), focal_mm=35.0)
    assert fit is not None and any(answer.worth > NEEDED_BITS for answer in found.asked())
    found.fits.append(fit)
    monkeypatch.setattr(synthesize_module, "searched", lambda _: found)
    answers = synthesize_module._answers(look)
    assert answers[0].structure == "lattice"


def _numbers_of(ring: DrawnRing) -> torch.Tensor:
    x, y = ring.center
    values = {
        "camera.rx": ring.rx_deg,
        "camera.ry": ring.ry_deg,
        "draw.x.radius.1": ring.radius,
        "draw.x.angle.1": ring.first_deg,
        "draw.x.offset.1": x,
        "draw.y.offset.1": y,
    }
    return numbers_of(ring_filling(12), values)

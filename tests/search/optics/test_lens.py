"""Lens distortion, known or estimated, on scenes bent by a known lens."""

from functools import cache

import cv2
import numpy as np
import pytest
import torch
from drawn import DrawnRing
from truth import SMALL, pose_error_deg, small_scene

from p3i.grammar.ast import Program
from p3i.grammar.leaves import leaves
from p3i.grammar.parser import parse
from p3i.interp.lens import photo_from_straight, straight_from_photo
from p3i.search.config import SearchConfig
from p3i.search.forms.whole import scaled
from p3i.search.look.straight import straightened
from p3i.search.result import SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid

SEED = 15
"""A scene with many objects."""


def bent(image: Image, k1: float) -> Image:
    """A pinhole camera's picture as a lens of k1 shows it."""
    at = straight_from_photo(pixel_grid(image.size), k1, size=image.size).numpy()
    pixels = cv2.remap(
        image.pixels, at[..., 0].copy(), at[..., 1].copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return Image(pixels, np.ones(pixels.shape[:2], bool))


@cache
def answer(k1: float, lens: float | str | None) -> SynthesisResult:
    return synthesize(bent(small_scene(SEED).image(), k1), SearchConfig(structure="lattice", lens=lens))  # pyright: ignore


def far_off(result: SynthesisResult, k1: float) -> np.ndarray:
    """How many pixels each found centre lies from the nearest object of the bent scene."""
    objects, shown = photo_from_straight(torch.from_numpy(small_scene(SEED).centers_px), k1, size=SMALL)
    found = np.array([(x, y) for x, y, _, _ in result.centers])
    return np.linalg.norm(found[:, None] - objects[shown].numpy()[None], axis=2).min(1)


@pytest.mark.parametrize("k1", [-0.3, -0.2, 0.15])
def test_a_lens_is_estimated_from_the_pattern(k1: float) -> None:
    result, blind = answer(k1, "auto"), answer(k1, None)
    assert result.program is not None and blind.program is not None
    assert result.lens_k1 is not None and abs(result.lens_k1 - k1) < 0.02
    assert blind.lens_k1 is None
    truth = small_scene(SEED).program
    assert pose_error_deg(result.program, truth) < min(0.3, pose_error_deg(blind.program, truth))
    assert any("k1" in note for note in result.notes)
    assert np.median(far_off(result, k1)) < 2.0


RING = DrawnRing(count=20, slots=20, center=(12.0, 2.0), radius=30.0, size=7.0, rx_deg=0.0, ry_deg=25.0)
"""A ring that reaches into a corner, where a lens makes an egg of it."""


def test_a_lens_is_estimated_from_a_ring() -> None:
    config = SearchConfig(structure="circular", focal_mm=35.0, lens="auto")
    result = synthesize(bent(RING.image(), -0.3), config)
    assert result.lens_k1 == pytest.approx(-0.3, abs=0.02)
    assert result.program is not None
    camera = result.program.camera
    assert (camera.rx_deg, camera.ry_deg) == pytest.approx((RING.rx_deg, RING.ry_deg), abs=0.5)
    found = leaves(result.program)
    assert found["draw.x.radius.1"] == found["draw.y.radius.1"] == pytest.approx(RING.radius, rel=0.1)
    assert found["draw.x.offset.1"] == pytest.approx(RING.center[0], abs=0.3)


def test_a_ring_tells_no_lens_where_there_is_none() -> None:
    result = synthesize(RING.image(), SearchConfig(structure="circular", focal_mm=35.0, lens="auto"))
    assert result.program is not None and result.lens_k1 is None


def test_a_lens_that_is_known_is_taken_as_it_is() -> None:
    result = answer(-0.2, -0.2)
    assert result.program is not None and result.lens_k1 == -0.2
    assert pose_error_deg(result.program, small_scene(SEED).program) < 1
    assert np.median(far_off(result, -0.2)) < 2.0


def test_where_no_lens_shows_the_answer_is_the_one_without() -> None:
    result, blind = answer(0.0, "auto"), answer(0.0, None)
    assert result.lens_k1 is None
    assert result.program == blind.program and result.centers == blind.centers


def test_a_straightened_photo_shows_all_of_a_barrel_and_keeps_the_middle() -> None:
    image = bent(small_scene(SEED).image(), 0.0)
    free = straightened(image, -0.2)
    assert free.image.size.width > SMALL.width and free.scale > 1
    assert free.scale == free.image.size.longer / SMALL.longer
    shift = np.array(free.image.size.middle) - SMALL.middle
    assert (shift == np.round(shift)).all()
    middle = np.round(free.image.size.middle).astype(int)
    # Near the middle nothing moves but by the margin.
    ours = image.pixels[middle[1] - int(shift[1]), middle[0] - int(shift[0])]
    np.testing.assert_allclose(free.image.pixels[middle[1], middle[0]], ours, atol=0.02)
    corner, _ = photo_from_straight(
        torch.tensor([-shift.tolist()[0], -shift.tolist()[1]], dtype=torch.float64)[None], -0.2, size=SMALL
    )
    assert not bool(free.image.valid[0, 0]) or bool((corner >= 0).all())


def test_lengths_of_a_program_scale_and_angles_do_not() -> None:
    text = (
        "SetCameraPose(rx=-30, ry=10)\nfor j in range(0, 6):\n"
        "    Draw(x=20*cos(60*j) + 3, y=20*sin(60*j) - 4)\n"
    )
    program = parse(text)
    assert isinstance(program, Program)
    before, after = leaves(program), leaves(scaled(program, 1.5))
    for path, value in before.items():
        length = path.startswith("draw.") and ".angle." not in path
        assert after[path] == pytest.approx(1.5 * value if length else value)


def test_what_a_pincushion_does_not_show_is_unknown() -> None:
    free = straightened(Image(np.ones((48, 64, 3), np.float32), np.ones((48, 64), bool)), 0.2)
    assert free.image.size == Size(64, 48) and free.scale == 1
    assert not free.image.valid[0, 0] and free.image.valid[24, 32]

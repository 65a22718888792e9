"""Object patches: equal where objects turn with their ring, contrast at the right count, objects found."""

import math

import cv2
import numpy as np
import pytest
import torch
from drawn import DrawnRing

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.cells import agreement
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import (
    Frames,
    find_about,
    frames,
    half_steps,
    patch_contrast,
    read,
    sample_px,
    spacing,
)
from p3i.vision.image import Image

RING = DrawnRing()
FILLING = RING.filling()
PATTERN, THETA = FILLING.pattern, FILLING.theta(RING.numbers(FILLING))
INDEX = PATTERN.index.double()
SIDE = spacing(PATTERN, THETA)


def agreements(evidence: Evidence, where: Frames) -> torch.Tensor:
    """How alike the first patch is to each of the others."""
    matrix = PATTERN.image_from_plane(THETA, size=evidence.image.size, focal_mm=35.0)
    cells = read(evidence.colours_for(sample_px(matrix, where)), matrix, where).cells()
    return agreement(cells.values[1:], cells.values[0], cells.known[1:] & cells.known[:1])


def contrast_of(count: int, *, ring: DrawnRing = RING) -> torch.Tensor:
    """The contrast of the draws of a ring of `count` objects through the first of `ring`."""
    filling = ring_filling(count)
    theta = filling.theta(ring.numbers(filling))
    index = filling.pattern.index.double()
    side = spacing(filling.pattern, theta)
    found = patch_contrast(ring.evidence(), filling.pattern, theta, index, side=side, focal_mm=35.0)
    return found


def test_patches_that_turn_with_the_ring_are_equal_and_upright_ones_are_not() -> None:
    evidence, turned = RING.evidence(), frames(PATTERN, THETA, INDEX, side=SIDE)
    upright = Frames(
        turned.origin, turned.along[:1].expand_as(turned.along), turned.across[:1].expand_as(turned.across)
    )
    assert float(agreements(evidence, turned).min()) > 0.85
    assert float(agreements(evidence, upright).median()) < 0.6


def test_a_frame_is_a_square_along_the_curve() -> None:
    where = frames(PATTERN, THETA, INDEX, side=3.0)
    np.testing.assert_allclose(where.along.norm(dim=1), 3.0, rtol=1e-6)
    np.testing.assert_allclose((where.along * where.across).sum(1), 0.0, atol=1e-9)
    outward = where.origin - torch.tensor(RING.center, dtype=torch.float64)
    np.testing.assert_allclose((where.along * outward).sum(1), 0.0, atol=1e-6)
    np.testing.assert_allclose(where.origin, RING.places(), atol=1e-9)


def test_a_ring_has_contrast_at_its_count_and_none_where_half_steps_are_objects_too() -> None:
    assert float(contrast_of(12).min()) > 0.9
    every_other = contrast_of(6)  # half a step on is the next object
    assert float(every_other.max()) < 0.05 and abs(float(every_other.median())) < 0.05


def test_a_photo_without_objects_has_no_contrast() -> None:
    nothing = DrawnRing(missing=frozenset(range(12)))
    assert float(contrast_of(12, ring=nothing).abs().mean()) < 0.1


@pytest.mark.parametrize("beyond", [0.5, 4.0, 6.0])
def test_the_rim_of_a_disc_takes_no_contrast_from_the_objects_on_it(beyond: float) -> None:
    round_ = np.radians(np.arange(0, 360, 3))
    rim = np.array(RING.center) + (RING.radius + RING.size / 2 + beyond) * np.stack(
        [np.cos(round_), np.sin(round_)], 1
    )
    plain = RING.image()
    outside = np.ones(plain.valid.shape, np.uint8)
    cv2.fillPoly(outside, [np.round(RING.seen(rim)).astype(np.int32)], 0)
    on_disc = np.where(outside[..., None], np.float32(0.1), plain.pixels)
    evidence = Evidence(Image(on_disc, plain.valid), SearchConfig(), 35.0)
    found = patch_contrast(evidence, PATTERN, THETA, INDEX, side=SIDE, focal_mm=35.0)
    assert float(found.min()) > 0.6


def test_an_object_that_is_missing_has_no_contrast() -> None:
    found = contrast_of(12, ring=DrawnRing(missing=frozenset({2, 7})))
    gone = torch.zeros(12, dtype=torch.bool)
    gone[[2, 7]] = True
    assert float(found[gone].max()) < 0.2 < 0.7 < float(found[~gone].min())


def test_objects_that_were_moved_are_found_where_they_are() -> None:
    nudges = {3: (2.0, 0.0), 7: (0.0, -1.5), 10: (-1.0, 1.0)}
    evidence = DrawnRing(nudges=nudges).evidence()
    matrix = PATTERN.image_from_plane(THETA, size=evidence.image.size, focal_mm=35.0)
    where = frames(PATTERN, THETA, INDEX, side=SIDE)
    found = find_about(evidence, matrix, where, INDEX, torch.ones(12))
    true = np.array([nudges.get(number, (0.0, 0.0)) for number in range(12)])
    np.testing.assert_allclose(found.offsets.numpy() * SIDE, true, atol=0.15)
    assert float(found.certainty.min()) > 0.8


def test_the_spacing_is_that_of_neighbours() -> None:
    assert math.isclose(SIDE, 2 * RING.radius * math.sin(math.pi / 12), rel_tol=1e-9)


def test_the_spacing_of_thousands_of_draws_is_that_of_neighbours_too() -> None:
    program = parse("for i in range(0, 47):\n    for j in range(0, 61):\n        Draw(x=i, y=2*j)\n")
    assert isinstance(program, Program)
    pattern = compile(program)
    assert spacing(pattern, pattern.theta) == 1.0


def test_half_steps_and_turning_follow_the_variables_that_move_the_draws() -> None:
    row = compile(parse("SetCameraPose(rx=0, ry=0)\nfor i in range(0, 5):\n    Draw(x=9*i, y=1)\n"))
    assert half_steps(row).tolist() == [[0.5, 0.0]]
    assert half_steps(PATTERN).tolist() == [[0.0, 0.5]]
    assert row.turning is None and PATTERN.turning == 1

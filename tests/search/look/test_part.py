"""A region of interest is looked at closer, and the program stays that of the whole photo."""

import numpy as np
import pytest
import torch
from walls import Wall, hall

import p3i
from p3i.api.search import without
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.look.evidence import FINE, Evidence
from p3i.search.look.part import Box, part_of, shown
from p3i.search.look.straight import straightened
from p3i.search.result import SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.vision.image import Image, resized

SIZE = (1500, 1100)
SMALL = Wall((900, 640), 9.0, (30, 20))
LATTICE = SearchConfig(structure="lattice")


def around(wall: Wall, margin: int) -> tuple[tuple[float, float], ...]:
    (x0, y0), (x1, y1) = wall.outline.min(0) - margin, wall.outline.max(0) + margin
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


@pytest.fixture(scope="module")
def photo() -> Image:
    return hall(SIZE, SMALL)


@pytest.fixture(scope="module")
def closer(photo: Image) -> SynthesisResult:
    return p3i.synth(photo, LATTICE, roi=around(SMALL, 25))


def test_a_small_wall_is_found_within_its_region(closer: SynthesisResult) -> None:
    assert closer.program is not None, closer.reason
    assert len(closer.centers) == 600


def test_the_program_is_that_of_the_whole_photo(closer: SynthesisResult, photo: Image) -> None:
    assert closer.program is not None
    pattern = compile(closer.program)
    points, _ = pattern.centers_px(size=photo.size, focal_mm=35.0)
    low, high = points.min(0).values.numpy(), points.max(0).values.numpy()
    assert np.abs(low - (SMALL.outline.min(0) + 4.5)).max() < 6
    assert np.abs(high - (SMALL.outline.max(0) - 4.5)).max() < 6
    camera = Camera.of(closer.program)
    assert abs(camera.rx_deg) < 45 and abs(camera.ry_deg) < 45


def test_the_score_of_the_program_is_what_was_printed(closer: SynthesisResult, photo: Image) -> None:
    assert closer.program is not None and closer.score is not None
    box = around(SMALL, 25)
    assert closer.window is not None and closer.record()["window"] == list(closer.window)
    assert np.abs(np.array(closer.window[:2]) - box[0]).max() <= 1
    assert p3i.score(photo, closer.program).agreement == pytest.approx(closer.agreement, abs=1e-6)


def test_nothing_is_drawn_outside_the_region(photo: Image) -> None:
    (x0, y0), (x1, y1) = SMALL.outline.min(0), SMALL.outline.max(0)
    roi = ((x0 - 20, y0 - 20), ((x0 + x1) / 2, y0 - 20), ((x0 + x1) / 2, y1 + 20), (x0 - 20, y1 + 20))
    seen = without(photo, mask=None, roi=roi)
    result = synthesize(seen, LATTICE)
    assert result.program is not None and len(result.centers) > 250
    points = torch.tensor(result.centers)[:, :2]
    assert bool(shown(seen, points).all())


def test_a_slanting_region_cuts_the_ranges_by_guards(photo: Image) -> None:
    (x0, y0), (x1, y1) = SMALL.outline.min(0), SMALL.outline.max(0)
    seen = without(photo, mask=None, roi=((x0 - 20, y0 - 20), (x1 + 20, y0 - 20), (x0 - 20, y1 + 20)))
    result = synthesize(seen, LATTICE)
    assert result.program is not None and len(result.centers) > 200
    outside = ~shown(seen, torch.tensor(result.centers)[:, :2])
    assert float(outside.double().mean()) < 0.05


def test_the_maps_are_made_of_the_region_and_lie_right_on_the_photo(photo: Image) -> None:
    evidence = Evidence(without(photo, mask=None, roi=around(SMALL, 25)), LATTICE, 35.0)
    whole = Evidence(photo, LATTICE, 35.0)
    assert evidence.level(FINE, blur=0.5).size.width == evidence.part.size.width < FINE
    corner = torch.tensor([*evidence.part.corner, 1.0], dtype=torch.float64)
    assert (evidence.level(FINE, blur=0.5).map_from_photo @ corner)[:2].abs().max() < 1e-9
    assert (evidence.colours_for(1.0).map_from_photo @ corner)[:2].abs().max() < 1e-9
    assert torch.equal(whole.frame.map_from_photo, whole.features(320).map_from_photo)


def test_a_window_is_part_of_the_photo_without_hiding_the_rest(photo: Image) -> None:
    part = part_of(photo, Box(100, 200, 400, 500))
    assert (part.size.width, part.corner, part.image.roi is None) == (300, (100, 200), True)
    assert np.array_equal(part.image.pixels, photo.pixels[200:500, 100:400])
    assert part.shows(torch.tensor([[100.0, 200.0], [99.0, 200.0]])).tolist() == [True, False]
    assert bool(shown(photo, torch.tensor([[99.0, 200.0]])).all())


def test_a_region_follows_its_photo_when_it_is_reduced_or_straightened(photo: Image) -> None:
    seen = without(photo, mask=None, roi=around(SMALL, 25))
    assert resized(seen, 500).roi is None
    straight = straightened(seen, -0.1).image
    assert straight.roi is not None and seen.roi is not None
    assert straight.roi.shape == straight.valid.shape
    assert 0.7 < straight.roi.sum() / seen.roi.sum() < 1.5

"""The agreement that `synth` tells is the one that `p3i score` says of the program it prints."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import DrawnRing
from truth import small_scene

import p3i
from p3i.evaluation.hybrid_scenes import hybrid_scene
from p3i.interp.lens import straight_from_photo
from p3i.search.config import SearchConfig
from p3i.search.result import NEEDED, SynthesisResult
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid


def bent(image: Image, k1: float) -> Image:
    at = straight_from_photo(pixel_grid(image.size), k1, size=image.size).numpy()
    x, y = at[..., 0].copy(), at[..., 1].copy()
    pixels = cv2.remap(image.pixels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return Image(pixels, image.valid)


def a_part(image: Image) -> Image:
    """The pattern in the left half of the picture only."""
    pixels = image.pixels.copy()
    pixels[:, image.size.width // 2 :] = np.random.default_rng(0).random((1, 1, 3), np.float32)
    return Image(pixels, image.valid)


@cache
def picture(name: str) -> tuple[Image, SearchConfig]:
    lattice = small_scene(16).image()
    match name:
        case "lattice":
            return lattice, SearchConfig(structure="lattice")
        case "lattice with guards":
            return small_scene(3, guards=1.0).image(), SearchConfig(structure="lattice")
        case "the whole image":
            return a_part(lattice), SearchConfig(structure="lattice", extent="image")
        case "own focal":
            return lattice, SearchConfig(structure="lattice", focal_mm="auto")
        case "a lens":
            return bent(lattice, -0.2), SearchConfig(structure="lattice", lens=-0.2)
        case "strict":
            return lattice, SearchConfig(structure="lattice", strict=True)
        case "circular":
            return DrawnRing(focal_mm=50.0, rx_deg=-42.0).image(), SearchConfig(structure="circular")
        case _:
            return hybrid_scene(HYBRID).image(), SearchConfig(structure="hybrid")


HYBRID = 12
NAMES = [
    "lattice",
    "lattice with guards",
    "the whole image",
    "own focal",
    "a lens",
    "strict",
    "circular",
    "hybrid",
]


@pytest.mark.parametrize("name", NAMES)
def test_synth_tells_the_agreement_that_score_says(name: str, tmp_path: Path) -> None:
    image, config = picture(name)
    found: SynthesisResult = p3i.synth(image, config, top=2)
    assert found.program is not None and found.score is not None, found.reason
    for candidate in found.candidates:
        text = tmp_path / "a.p3p"
        text.write_text(p3i.format(candidate.program))
        said = p3i.score(image, text).agreement
        assert f"{candidate.agreement:.4f}" == f"{said:.4f}"
    header = found.program.header
    assert header is not None and dict(header.fit)["score"] == round(found.score, 4)
    assert found.score == found.candidates[0].score
    if config.extent == "found":
        assert found.agreement is not None and found.agreement >= NEEDED

"""How well a tilt is known: small where many objects fix it, large where a ring says nothing of it."""

import math

import cv2
import numpy as np
import pytest
import torch
from drawn import DrawnRing
from torch import Tensor
from truth import SMALL, evidence_of, small_scene

from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.interp.camera import Camera, project
from p3i.interp.lens import straight_from_photo
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.robust import fitted
from p3i.search.look.evidence import Evidence
from p3i.search.optics.tilt import covariance_of, doubt_note, pose_sigma_deg, sigma_of_normal_deg
from p3i.search.result import StructureFound
from p3i.vision.image import Image
from p3i.vision.warp import pixel_grid


def answer(text: str, structure: StructureFound, *, lens_k1: float | None = None) -> Answer:
    program = parse(text)
    assert isinstance(program, Program)
    return Answer(program, structure, 0.5, 100.0, lens_k1=lens_k1)


def ring_answer(ring: DrawnRing) -> Answer:
    angle, (x, y) = f"{360 / ring.slots:g}*j + {ring.first_deg:g}", ring.center
    return answer(
        f"SetCameraPose(rx={ring.rx_deg:g}, ry={ring.ry_deg:g})\nfor j in range(0, {ring.count}):\n"
        f"    Draw(x={ring.radius:g}*Cos({angle}) + {x:g}, y={ring.radius:g}*Sin({angle}) + {y:g})\n",
        "circular",
    )


BOARD = """SetCameraPose(rx=-45, ry=0)
for i in range(0, 8):
    for j in range(0, 8):
        Draw(x=9*i - 31.5, y=9*j - 31.5)
"""


def board(*, stray: float = 0.2) -> Image:
    """BOARD painted: discs of radius 3, each `stray` program units off its place."""
    plane_from_image = torch.linalg.inv(Camera(-45.0).image_from_plane(SMALL))
    plane = project(plane_from_image, pixel_grid(SMALL).double().reshape(-1, 2))[0].numpy()
    pixels = np.full((len(plane), 3), 0.8, np.float32)
    chance = np.random.default_rng(1)
    for i in range(8):
        for j in range(8):
            middle = np.array([9 * i - 31.5, 9 * j - 31.5]) + chance.normal(0, stray, 2)
            pixels[np.linalg.norm(plane - middle, axis=1) < 3] = (0.2, 0.3, 0.5)
    picture = cv2.GaussianBlur(pixels.reshape(SMALL.height, SMALL.width, 3), (0, 0), 0.8)
    return Image(picture, np.ones(picture.shape[:2], bool))


def test_a_few_objects_of_a_ring_seen_head_on_hardly_tell_the_tilt() -> None:
    nudges = {number: (0.1 * (-1) ** number, 0.05 * number) for number in range(6)}
    ring = DrawnRing(count=6, slots=6, center=(0, 0), radius=6, size=3, rx_deg=0, ry_deg=0, nudges=nudges)
    sigma = pose_sigma_deg(ring.evidence(), ring_answer(ring))
    assert sigma is not None and 4 < sigma < 43
    note = doubt_note(sigma, two_tilts=False)
    assert note is not None and f"{sigma:.0f} degrees" in note


def test_many_objects_under_a_strong_tilt_tell_it() -> None:
    sigma = pose_sigma_deg(Evidence(board(), SearchConfig(), 35.0), answer(BOARD, "lattice"))
    assert sigma is not None and 0.01 < sigma < 0.6
    assert doubt_note(sigma, two_tilts=False) is None


def test_objects_that_stray_more_tell_less() -> None:
    neat, loose = (
        pose_sigma_deg(Evidence(board(stray=stray), SearchConfig(), 35.0), answer(BOARD, "lattice"))
        for stray in (0.05, 0.5)
    )
    assert neat is not None and loose is not None
    assert loose > 2 * neat


def test_what_a_lens_does_to_the_objects_is_no_doubt_once_it_is_told() -> None:
    scene, k1 = small_scene(15), -0.2
    image = scene.image()
    at = straight_from_photo(pixel_grid(image.size), k1, size=image.size).numpy()
    pixels = cv2.remap(
        image.pixels, at[..., 0].copy(), at[..., 1].copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    bent = Evidence(Image(pixels, image.valid), SearchConfig(), 35.0)
    straight = pose_sigma_deg(evidence_of(scene), Answer(scene.program, "lattice", 0.5, 100.0))
    told = pose_sigma_deg(bent, Answer(scene.program, "lattice", 0.5, 100.0, lens_k1=k1))
    untold = pose_sigma_deg(bent, Answer(scene.program, "lattice", 0.5, 100.0))
    assert straight is not None and told is not None and untold is not None
    assert told == pytest.approx(straight, rel=0.5)
    assert untold > 3 * told


def test_a_program_out_of_sight_has_no_tilt_to_speak_of() -> None:
    away = answer("for j in range(0, 5):\n    Draw(x=9*j + 500, y=0)\n", "lattice")
    assert pose_sigma_deg(evidence_of(small_scene(15)), away) is None


def test_the_angle_of_the_normal_has_the_variance_that_its_slopes_give_it() -> None:
    rx_deg, ry_deg, step = 37.0, -64.0, 1e-4
    covariance = torch.tensor([[4.0, 1.3], [1.3, 2.0]], dtype=torch.float64)
    slopes = np.stack(
        [
            (
                np.array(Camera(rx_deg + step * (k == 0), ry_deg + step * (k == 1)).normal)
                - np.array(Camera(rx_deg - step * (k == 0), ry_deg - step * (k == 1)).normal)
            )
            / (2 * math.radians(step))
            for k in (0, 1)
        ],
        1,
    )
    expected = math.sqrt(np.trace(slopes @ covariance.numpy() @ slopes.T))
    assert sigma_of_normal_deg(covariance, rx_deg=rx_deg) == pytest.approx(expected, rel=1e-6)


def _row(noise: Tensor, **changes: float) -> float:
    """The standard deviation of the place of a row of 400 points, which strayed by `noise` [400, 2]."""
    places = torch.stack([torch.arange(400.0), torch.zeros(400)], 1).double()
    start = torch.zeros(2, dtype=torch.float64)
    fit = fitted(
        lambda moved: places + moved[..., None, :],
        start,
        places=places + noise,
        whiten=torch.eye(2, dtype=torch.float64).expand(400, 2, 2),
        weights=torch.ones(400, dtype=torch.float64),
        limits=torch.ones(2, dtype=torch.float64),
    )
    known = torch.full((2,), changes.get("known", 0.0), dtype=torch.float64)
    share = fit.share(each=changes.get("each", 1.0), directions=1)
    return float(covariance_of(fit, start, known=known, share=share)[0, 0].sqrt())


def noise(scale: float = 2.0) -> Tensor:
    """Strays of `scale` that sum to nothing."""
    drawn = torch.randn(400, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return scale * (drawn - drawn.mean(0)) / drawn.std(0)


def test_residuals_tell_how_large_the_noise_is() -> None:
    assert _row(noise()) == pytest.approx(2 / math.sqrt(400), rel=0.15)
    assert _row(noise(20.0)) == pytest.approx(10 * _row(noise()), rel=0.05)


def test_strays_do_not_widen_it_and_more_points_alike_narrow_it() -> None:
    strayed = noise()
    strayed[::20] += torch.tensor([40.0, -40.0]) * (1 - 2 * (torch.arange(20) % 2))[:, None]
    assert _row(strayed) < 1.4 * _row(noise())
    assert _row(noise(), each=4.0) == pytest.approx(_row(noise()) / 2, rel=0.1)


def test_neighbours_that_stray_alike_count_as_few() -> None:
    waves = torch.stack([(torch.arange(400) / 8).sin(), (torch.arange(400) / 8).cos()], 1).double() * 2
    assert _row(waves) > 1.7 * _row(noise(1.4))


def test_numbers_that_disagree_with_the_places_are_known_no_better_than_that() -> None:
    assert _row(noise() + torch.tensor([3.0, 0.0])) == pytest.approx(3, rel=0.1)


def test_what_is_known_beforehand_bounds_what_nothing_is_seen_of() -> None:
    assert _row(noise(1e6), known=1 / 30**2) == pytest.approx(30, rel=0.1)


def test_the_note_says_which_tilt_it_speaks_of() -> None:
    assert doubt_note(12.3, two_tilts=False) == "the tilt is known to about 12 degrees only"
    assert doubt_note(12.3, two_tilts=True) == "either tilt is known to about 12 degrees only"
    assert doubt_note(0.4, two_tilts=True) is None

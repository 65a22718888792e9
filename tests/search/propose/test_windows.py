"""Proposals: one of the first few is near enough to the truth to be refined."""

import cv2
import numpy as np
from truth import PATTERN, evidence_of, lattice_error, lattice_of, normal, pose_error_deg, small_scene

from p3i.interp.camera import Camera
from p3i.search.config import SearchConfig
from p3i.search.forms.guess import lattice_guess, tilted
from p3i.search.forms.lattice import Lattice, map_from_index
from p3i.search.look.evidence import Evidence
from p3i.search.propose.poses import pose_grid
from p3i.search.propose.windows import (
    MOST_TILT_DEG,
    POSE_STEP_DEG,
    SIDE,
    straightened_guesses,
    window_guesses,
)
from p3i.vision.image import Image


def test_the_poses_begin_straight_on_and_cover_all_tilts_up_to_sixty() -> None:
    poses = pose_grid(POSE_STEP_DEG, MOST_TILT_DEG)
    assert poses[0] == (0.0, 0.0)
    normals = np.array([normal(Lattice(rx, ry, np.eye(2), np.zeros(2))) for rx, ry in poses])
    assert len(np.unique(normals.round(6), axis=0)) == len(poses)
    assert normals[:, 2].min() > np.cos(np.radians(70))
    random = np.random.default_rng(0)
    for _ in range(300):
        tilt, around = np.radians(random.uniform(0, 60)), random.uniform(0, 2 * np.pi)
        wanted = np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)])
        assert np.degrees(np.arccos((normals @ wanted).clip(-1, 1).max())) < 9


def test_a_straightened_view_shows_the_lattice_near_the_true_pose() -> None:
    for seed in (14, 18):
        scene = small_scene(seed)
        proposals = straightened_guesses(evidence_of(scene))
        worths = [proposal.promise for proposal in proposals]
        assert worths == sorted(worths, reverse=True)
        truth = lattice_of(scene.program)
        near = [
            proposal
            for proposal in proposals[:10]
            if pose_error_deg(proposal.lattice, truth) < 12 and not proposal.local
        ]
        assert near
        assert any(lattice_error(one.lattice.basis, truth.basis) < 0.3 for one in near)


def steps_px(lattice: Lattice, at: np.ndarray) -> np.ndarray:
    """The steps [2, 2] (as rows) of a lattice at a point of the photo, in pixels."""
    level = evidence_of(small_scene(14)).level(448, blur=0.5)
    matrix = map_from_index(level, PATTERN, lattice.theta(PATTERN))
    back = np.linalg.inv(matrix) @ [*at, 1.0]
    middle = back[:2] / back[2]

    def seen(index: np.ndarray) -> np.ndarray:
        x, y, depth = matrix @ [*index, 1.0]
        return np.array([x, y]) / depth

    return np.array([(seen(middle + step) - seen(middle - step)) / 0.02 for step in np.eye(2) * 0.01])


def origin_px(lattice: Lattice) -> np.ndarray:
    camera = Camera(lattice.rx_deg, lattice.ry_deg)
    x, y, depth = camera.image_from_plane(small_scene(14).size).numpy() @ [*lattice.origin, 1.0]
    return np.array([x, y]) / depth


def test_a_window_shows_the_steps_of_its_place() -> None:
    scene = small_scene(14)
    proposals = window_guesses(evidence_of(scene))
    assert proposals and all(proposal.local for proposal in proposals)
    truth = lattice_of(scene.program)
    errors = []
    for proposal in proposals[:4]:
        at = origin_px(proposal.lattice)
        assert (at >= 0).all() and (at < [scene.size.width, scene.size.height]).all()
        errors.append(lattice_error(steps_px(proposal.lattice, at), steps_px(truth, at)))
    assert min(errors) < 0.1


def test_a_tilted_proposal_keeps_its_place_and_its_steps_in_the_photo() -> None:
    level = evidence_of(small_scene(14)).level(448, blur=0.5)
    flat = Lattice(0.0, 0.0, np.array([[7.0, 1.0], [-2.0, 9.0]]), np.array([12.0, -9.0]))
    for rx, ry in ((30.0, 0.0), (-20.0, 35.0), (0.0, -50.0)):
        found = tilted(
            lattice_guess(flat, 0.7, local=True), rx_deg=rx, ry_deg=ry, focal_mm=35.0, size=level.photo_size
        )
        assert (found.promise, found.local) == (0.7, True)
        assert (found.lattice.rx_deg, found.lattice.ry_deg) == (rx, ry)
        at = origin_px(flat)
        np.testing.assert_allclose(origin_px(found.lattice), at, atol=1e-6)
        np.testing.assert_allclose(steps_px(found.lattice, at), steps_px(flat, at), rtol=1e-3, atol=1e-3)


def test_a_picture_smaller_than_a_window_has_no_window() -> None:
    pixels = np.random.default_rng(0).uniform(size=(31, 200, 3)).astype(np.float32)
    image = Image(pixels, np.ones((31, 200), bool))
    assert window_guesses(Evidence(image, SearchConfig(), 35.0)) == []


def test_windows_without_known_pixels_are_left_out() -> None:
    scene = small_scene(14)
    valid = np.zeros((scene.size.height, scene.size.width), bool)
    valid[:, : scene.size.width // 2] = True
    found = window_guesses(Evidence(Image(scene.image().pixels, valid), SearchConfig(), 35.0))
    assert found
    assert all(origin_px(proposal.lattice)[0] < 0.6 * scene.size.width for proposal in found)


def small_among_stripes() -> Image:
    """A tile of 5 x 5 dots, 50 pixels wide, on a ground of stripes of many widths."""
    y, x = np.mgrid[0:448, 0:640]
    random = np.random.default_rng(3)
    edges = np.sort(random.uniform(-300, 900, 90))
    ground = 0.25 + 0.6 * (np.searchsorted(edges, x + 0.7 * y) % 2)
    dots = np.where(np.hypot(x % 10 - 5, y % 10 - 5) < 3, 0.5, 0.58)
    tile = (x >= 300) & (x < 350) & (y >= 200) & (y < 250)
    grey = cv2.GaussianBlur(np.where(tile, dots, ground).astype(np.float32), (0, 0), 0.7)
    pixels = np.repeat(grey[:, :, None], 3, 2)
    return Image(pixels, np.ones(grey.shape, bool))


def test_windows_half_as_wide_see_a_small_pattern_that_whole_ones_do_not() -> None:
    image = small_among_stripes()
    evidence = Evidence(image, SearchConfig(), 35.0)
    middle = np.array(image.size.middle)

    def rank(side: int) -> int:
        for place, guess in enumerate(window_guesses(evidence, side=side)):
            steps = np.hypot(*(guess.lattice.basis * image.size.unit_px).T)
            at = guess.lattice.origin * image.size.unit_px + middle
            if np.abs(steps - 10).max() < 0.5 and (abs(at - (325, 225)) < 60).all():
                return place
        return 999

    assert rank(SIDE // 2) == 0 < rank(SIDE)

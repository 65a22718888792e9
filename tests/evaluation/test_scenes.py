"""Rendered scenes: repeatable, within their limits, and true."""

import cv2
import numpy as np
import pytest
import torch

from p3i.evaluation.looks import LOOKS, SIDE
from p3i.evaluation.scenes import annotation, lattice_scene
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.interp.camera import project
from p3i.interp.compile import compile
from p3i.size import Size

torch.set_num_threads(1)


def test_a_seed_gives_the_same_scene_twice_and_another_seed_another() -> None:
    first, again, other = lattice_scene(3), lattice_scene(3), lattice_scene(4)
    np.testing.assert_array_equal(first.pixels, again.pixels)
    assert first.program == again.program != other.program


@pytest.mark.parametrize("seed", range(8))
def test_the_truth_of_a_scene_is_what_its_program_draws(seed: int) -> None:
    scene = lattice_scene(seed, tilt_deg=(20, 50))
    assert parse(format_program(scene.program)) == scene.program
    assert scene.pixels.shape == (480, 640, 3) and scene.pixels.dtype == np.uint8
    assert 19.9 < scene.camera.tilt_deg < 50.1
    pattern = compile(scene.program)
    pixels, in_front = pattern.centers_px(size=scene.size)
    inside = in_front & ((pixels >= 0) & (pixels <= torch.tensor([639, 479]))).all(dim=1)
    np.testing.assert_allclose(scene.centers_px, pixels[inside].numpy(), atol=1e-9)
    assert scene.index.tolist() == pattern.index[inside].tolist()
    assert len(scene.index) >= 12


@pytest.mark.parametrize("look", sorted(LOOKS.keys() - {"ring"}))
def test_objects_stand_where_the_truth_says(look: str) -> None:
    scene = lattice_scene(1, look=look, jitter=0, noise=0, clutter=0, tilt_deg=(10, 30))
    pattern = compile(scene.program)
    half = torch.tensor(scene.index, dtype=torch.float64) + 0.5
    matrix = pattern.image_from_plane(size=scene.size)
    between, _ = project(matrix, pattern.points_at(half))

    def colours(points: np.ndarray) -> np.ndarray:
        inside = ((points > 3) & (points < np.array([636, 476]))).all(axis=1)
        columns, rows = np.rint(points[inside]).astype(int).T
        return cv2.blur(scene.pixels, (5, 5))[rows, columns].astype(float)

    objects, ground = colours(scene.centers_px), colours(between.numpy())
    apart = np.linalg.norm(objects[:, None] - ground, axis=2).min(axis=1)
    assert np.median(apart) > 12, "the colour of an object is not found in the middle between objects"


@pytest.mark.parametrize("look", LOOKS)
def test_every_look_is_a_sprite_with_an_inside_and_an_outside(look: str) -> None:
    sprite = LOOKS[look](np.random.default_rng(0))
    assert sprite.shape == (SIDE, SIDE, 4) and sprite.dtype == np.float32
    assert sprite.min() >= 0 and sprite.max() <= 1
    alpha = sprite[:, :, 3]
    assert 0.1 < alpha.mean() < 0.95 and alpha[0, 0] == 0


def test_an_annotation_says_the_program_in_plane_pixels() -> None:
    scene = lattice_scene(5, size=Size(320, 240))
    said = annotation(scene, "scene.png")
    assert (said["width"], said["height"], said["file"]) == (320, 240, "scene.png")
    lattice = said["lattice"]
    i, j = scene.index[0]
    plane_px = np.array(lattice["base"]) + i * np.array(lattice["u"]) + j * np.array(lattice["v"])
    matrix = scene.camera.image_from_plane(scene.size).numpy()
    x, y, depth = matrix @ [*(plane_px / scene.size.unit_px), 1]
    np.testing.assert_allclose([x / depth, y / depth], scene.centers_px[0], atol=0.01)
    assert said["pose"]["rx"] == scene.program.camera.rx_deg

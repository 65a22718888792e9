"""Where in the cell an object's middle is, on drawn photos where that is known."""

import numpy as np
import pytest

from p3i.search.extent.phase import find_phases

CELLS = [(i, j) for i in range(7) for j in range(8)]


def phase_of(scene, shift=(0.0, 0.0), **changes):
    """The phase of a scene whose plane is shifted by `shift`, so that no origin is the natural one."""
    moved = np.eye(3)
    moved[:2, 2] = -np.array(shift)
    given = {
        "pixels": scene.pixels,
        "valid": scene.valid,
        "image_from_plane": scene.image_from_plane @ moved,
        "basis": scene.basis,
        **changes,
    }
    phases = find_phases(**given)
    return phases[0].origin if phases else None


def miss(scene, origin, shift=(0.0, 0.0)):
    """How far an origin lies from the nearest object's place, in periods, along u or v."""
    cell = (np.asarray(origin) - shift - scene.origin) @ np.linalg.inv(scene.basis)
    return np.abs(cell - np.round(cell)).max()


@pytest.mark.parametrize("kind", ["disc", "light_disc", "square", "letter"])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (37.0, 61.0)])
def test_compact_objects_are_met_in_their_middle(draw_scene, kind, shift):
    scene = draw_scene(CELLS, kind=kind)
    assert miss(scene, phase_of(scene, shift), shift) < 0.1


@pytest.mark.parametrize("radius", [12, 40])
def test_small_and_large_objects_are_met_in_their_middle(draw_scene, radius):
    scene = draw_scene(CELLS, radius=radius)
    assert miss(scene, phase_of(scene)) < 0.1


def test_the_middle_is_met_to_a_fraction_of_a_sample(draw_scene):
    scene = draw_scene(CELLS, radius=30, noise=0.005)
    assert miss(scene, phase_of(scene)) < 0.012


def test_the_rim_tells_dark_squares_from_the_light_ones_between_them(draw_scene):
    # On the lattice of every second square, dark and light ones are equals but for the board's end.
    cells = [(i, j) for i in range(-3, 7) for j in range(-3, 7) if 0 <= i + j < 8 and -3 <= i - j <= 4]
    scene = draw_scene(
        cells, kind="square", basis=((100.0, 100.0), (100.0, -100.0)), origin=(250.0, 600.0), radius=49.5
    )
    assert miss(scene, phase_of(scene)) < 0.1


def test_a_slanted_basis_is_no_obstacle(draw_scene):
    scene = draw_scene(CELLS[:42], basis=((110.0, 10.0), (50.0, 95.0)))
    assert miss(scene, phase_of(scene)) < 0.1


def test_where_thin_lines_cross_is_the_object(draw_scene):
    scene = draw_scene(CELLS, kind="crossing")
    assert miss(scene, phase_of(scene)) < 0.1


def test_a_pattern_without_a_rim_is_enough(draw_scene):
    cells = [(i, j) for i in range(-2, 11) for j in range(-2, 11)]
    scene = draw_scene(cells, corners=((-300, -200), (900, -260), (1000, 760), (-380, 700)))
    assert miss(scene, phase_of(scene)) < 0.1


def test_the_origin_lies_within_the_pattern(draw_scene):
    scene = draw_scene(CELLS)
    cell = np.round((phase_of(scene) - scene.origin) @ np.linalg.inv(scene.basis)).astype(int)
    assert tuple(cell) in scene.cells


def test_the_answer_is_the_same_every_time(draw_scene):
    scene = draw_scene(CELLS)
    assert np.array_equal(phase_of(scene), phase_of(scene))


def test_a_plain_photo_has_no_phase(draw_scene):
    scene = draw_scene([])
    assert phase_of(scene, pixels=np.full_like(scene.pixels, 0.5)) is None

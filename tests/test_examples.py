"""The sample picture is what its script paints, and the sample programs are what they say."""

import importlib.util
from pathlib import Path

import numpy as np

import p3i

EXAMPLES = Path(__file__).parent.parent / "examples"


def painter():
    spec = importlib.util.spec_from_file_location("make_tiles", EXAMPLES / "make_tiles.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_sample_picture_is_what_its_script_paints() -> None:
    painted = painter().paint(samples=1)[:, :, ::-1] / 255
    shipped = p3i.read_image(EXAMPLES / "tiles.jpg").pixels
    assert painted.shape == shipped.shape
    # One ray a pixel is rougher than the sixteen of the shipped picture, and JPEG adds its part.
    assert np.abs(painted - shipped).mean() < 0.04


def test_the_truth_beside_the_picture_has_the_numbers_of_the_script() -> None:
    script = painter()
    program = p3i.load(EXAMPLES / "tiles.p3p")
    assert p3i.Camera.of(program) == script.CAMERA
    points = {(i, j): (x, y) for x, y, i, j in p3i.expand(program)}
    assert set(points) == {(i, j) for i in range(script.TILES[0]) for j in range(script.TILES[1])}
    for (i, j), point in points.items():
        assert np.allclose(point, script.FIRST + i * script.STEP_I + j * script.STEP_J)


def test_the_triangle_has_the_ten_objects_of_the_papers_first_figure() -> None:
    rows = [j for _, _, _, j in p3i.expand(p3i.load(EXAMPLES / "triangle.p3p"))]
    assert sorted(rows.count(row) for row in set(rows)) == [1, 2, 3, 4]

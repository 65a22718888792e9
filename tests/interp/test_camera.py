"""The camera against OpenCV, finite differences, and numbers computed elsewhere."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.grammar.ast import Affine, CameraPose, Draw, Header, Program
from p3i.interp.camera import Camera, image_from_plane, project, rotation
from p3i.size import Size

torch.set_num_threads(1)
# torch.func.jacfwd loads decompositions that torch itself still scripts.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit.script` is deprecated:DeprecationWarning")

GOLDEN = json.loads((Path(__file__).parent / "golden" / "cameras.json").read_text())
"""Written by a separate script from the formulas of docs/geometry.md, with 40 digits."""

angles = st.floats(-70, 70)
focals = st.floats(15, 200)
sizes = st.builds(Size, st.integers(2, 5000), st.integers(2, 5000))


def float64(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


@pytest.mark.parametrize("row", GOLDEN, ids=lambda row: f"{row['rx']}_{row['ry']}")
def test_the_homography_is_the_golden_one(row: dict) -> None:
    size = Size(row["width"], row["height"])
    matrix = image_from_plane(row["rx"], row["ry"], size=size, focal_mm=row["focal_mm"])
    np.testing.assert_allclose(matrix.numpy(), row["image_from_plane"], rtol=1e-13, atol=1e-11)
    plane, image = (torch.tensor([pair[k] for pair in row["points"]], dtype=torch.float64) for k in (0, 1))
    points, in_front = project(matrix, plane)
    assert in_front.all()
    np.testing.assert_allclose(points.numpy(), image.numpy(), rtol=1e-12)


@settings(deadline=None)
@given(angles, angles, focals, sizes, st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=1))
def test_projection_equals_opencv(rx: float, ry: float, focal: float, size: Size, plane: list) -> None:
    camera = Camera(rx, ry, focal)
    f_px = camera.focal_px(size)
    lens = np.array([[f_px, 0, (size.width - 1) / 2], [0, f_px, (size.height - 1) / 2], [0, 0, 1]])
    turn_x, _ = cv2.Rodrigues(np.array([math.radians(rx), 0, 0]))
    turn_y, _ = cv2.Rodrigues(np.array([0, math.radians(ry), 0]))
    vector, _ = cv2.Rodrigues(turn_y @ turn_x)
    spatial = np.array([(x * max(size.width, size.height) / 100, y * size.longer / 100, 0) for x, y in plane])
    points, in_front = project(camera.image_from_plane(size), torch.tensor(plane, dtype=torch.float64))
    expected, _ = cv2.projectPoints(spatial, vector, np.array([0, 0, f_px]), lens, None)
    near = (spatial @ (turn_y @ turn_x)[2] + f_px) > 1e-3 * f_px  # OpenCV does not say what is behind
    np.testing.assert_allclose(points.numpy()[near], expected[:, 0][near], rtol=1e-6, atol=1e-6 * size.longer)
    assert in_front.numpy()[near].all()


def test_a_floor_that_recedes_towards_the_top_has_a_negative_rx() -> None:
    matrix = Camera(-40, 0).image_from_plane(Size(640, 480))
    (top, bottom), in_front = project(matrix, torch.tensor([[10.0, -20], [10, 20]], dtype=torch.float64))
    assert in_front.all()
    assert top[1] < 239.5 < bottom[1]
    assert top[0] - 319.5 < bottom[0] - 319.5, "what is farther away is drawn smaller"


def test_points_at_or_behind_the_camera_are_not_in_front() -> None:
    size = Size(640, 480)
    depth_per_unit = math.sin(math.radians(-60)) / 100 * 640
    at_camera = -Camera(-60).focal_px(size) / depth_per_unit  # y grows towards the viewer
    plane = torch.tensor([[0, at_camera * share] for share in (0.999, 1, 1.001)], dtype=torch.float64)
    _, in_front = project(image_from_plane(-60, 0, size=size), plane)
    assert in_front.tolist() == [True, False, False]


def test_the_inverse_says_what_lies_beyond_the_horizon() -> None:
    size = Size(640, 480)
    camera = Camera(-80, 10)
    line = camera.horizon(size)
    assert line is not None
    a, b, c = line
    pixels = torch.tensor([[x, y] for x in (0.0, 320, 639) for y in (0.0, 50, 100, 479)], dtype=torch.float64)
    _, in_front = project(torch.linalg.inv(camera.image_from_plane(size)), pixels)
    expected = [a * x + b * y + c > 0 for x, y in pixels.tolist()]
    assert any(expected) and not all(expected)
    assert in_front.tolist() == expected


@settings(deadline=None)
@given(angles, angles)
def test_far_points_of_the_plane_approach_the_horizon(rx: float, ry: float) -> None:
    size = Size(640, 480)
    line = Camera(rx, ry).horizon(size)
    if line is None or Camera(rx, ry).tilt_deg < 1:
        return
    a, b, c = line
    assert math.isclose(math.hypot(a, b), 1)
    away = torch.tensor(Camera(rx, ry).normal, dtype=torch.float64)
    turned = rotation(rx, ry)
    # The direction in the plane that recedes fastest, far out.
    steepest = turned.T @ torch.tensor([0, 0, 1.0], dtype=torch.float64)
    far = steepest[:2] / steepest[:2].norm() * 1e9
    assert abs(float(away @ turned[:, 0])) < 1e-12
    points, in_front = project(image_from_plane(rx, ry, size=size), far[None])
    assert in_front.all()
    assert abs(a * float(points[0, 0]) + b * float(points[0, 1]) + c) < 1e-4 + 1e-5 * abs(c)


def test_a_plane_seen_straight_on_has_no_horizon() -> None:
    assert Camera(0, 0).horizon(Size(10, 10)) is None


@settings(deadline=None)
@given(st.floats(-89, 89), st.floats(-89, 89), focals)
def test_the_normal_gives_the_angles_back(rx: float, ry: float, focal: float) -> None:
    camera = Camera(rx, ry, focal)
    back = Camera.from_normal(camera.normal, focal_mm=focal)
    assert (back.rx_deg, back.ry_deg) == pytest.approx((rx, ry), abs=1e-6)
    np.testing.assert_allclose(camera.normal, rotation(rx, ry)[:, 2].numpy(), atol=1e-15)
    opposite = Camera.from_normal(tuple(-part * 3 for part in camera.normal), focal_mm=focal)
    assert (opposite.rx_deg, opposite.ry_deg) == pytest.approx((rx, ry), abs=1e-6)


@settings(deadline=None)
@given(st.floats(-60, 60), st.floats(-60, 60), focals, focals)
def test_under_another_focal_the_straightened_view_changes_by_an_affine_map_only(
    rx: float, ry: float, focal: float, other_focal: float
) -> None:
    size = Size(640, 480)
    camera = Camera(rx, ry, focal)
    other = camera.refocused(other_focal)
    other_from_plane = torch.linalg.solve(other.image_from_plane(size), camera.image_from_plane(size))
    np.testing.assert_allclose(other_from_plane[2, :2].numpy() / float(other_from_plane[2, 2]), 0, atol=1e-9)
    assert other.refocused(focal).normal == pytest.approx(camera.normal, abs=1e-9)
    line, other_line = camera.horizon(size), other.horizon(size)
    if line is not None and camera.tilt_deg > 0.1:
        assert other_line == pytest.approx(line, rel=1e-6, abs=1e-6)


def test_a_rotation_is_orthogonal_and_batched() -> None:
    rx = torch.linspace(-80, 80, 5, dtype=torch.float64)[:, None]
    ry = torch.linspace(-80, 80, 3, dtype=torch.float64)
    turned = rotation(rx, ry)
    assert turned.shape == (5, 3, 3, 3)
    np.testing.assert_allclose(
        (turned @ turned.mT).numpy(), np.broadcast_to(np.eye(3), (5, 3, 3, 3)), atol=1e-15
    )
    np.testing.assert_allclose(turned[1, 2].numpy(), rotation(float(rx[1]), float(ry[2])).numpy())
    assert rotation(torch.tensor(3.0), 4).dtype == torch.float32
    assert rotation(3, 4).dtype == torch.float64


def test_angles_and_focals_broadcast_to_a_batch_of_homographies() -> None:
    focal = torch.tensor([[28.0], [50.0]], dtype=torch.float64)
    batch = image_from_plane(float64(-10, -20, -30), 5, size=Size(64, 48), focal_mm=focal)
    assert batch.shape == (2, 3, 3, 3)
    single = image_from_plane(-20, 5, size=Size(64, 48), focal_mm=50)
    np.testing.assert_allclose(batch[1, 1].numpy(), single.numpy())


def test_the_homography_has_the_gradients_of_finite_differences() -> None:
    numbers = float64(-42, -15, 35).requires_grad_()

    def homography(values: torch.Tensor) -> torch.Tensor:
        rx, ry, focal = values
        return image_from_plane(rx, ry, size=Size(64, 48), focal_mm=focal)

    assert torch.autograd.gradcheck(homography, (numbers,))
    forward = torch.func.jacfwd(homography)(numbers.detach())
    step = 1e-5
    for k in range(3):
        shift = torch.zeros(3, dtype=torch.float64)
        shift[k] = step
        there, back = homography(numbers.detach() + shift), homography(numbers.detach() - shift)
        np.testing.assert_allclose(forward[..., k].numpy(), ((there - back) / (2 * step)).numpy(), atol=1e-6)


def test_points_behind_the_camera_do_not_spoil_gradients() -> None:
    numbers = float64(-60, 0).requires_grad_()
    plane = torch.tensor([[0.0, 10], [0, 112.2368], [0, 1000]], dtype=torch.float64)
    points, in_front = project(image_from_plane(numbers[0], numbers[1], size=Size(64, 48)), plane)
    torch.where(in_front[:, None], points, 0).sum().backward()
    assert numbers.grad is not None and torch.isfinite(numbers.grad).all()


def test_the_camera_of_a_program_takes_the_given_focal_then_the_headers_then_35() -> None:
    draw = Draw(Affine(), Affine())
    bare = Program(CameraPose(-3, 4), draw)
    assert Camera.of(bare) == Camera(-3, 4, 35)
    headed = Program(CameraPose(-3, 4), draw, header=Header(focal_mm=50))
    assert Camera.of(headed).focal_mm == 50
    assert Camera.of(headed, focal_mm=28).focal_mm == 28


@pytest.mark.parametrize(
    "values", [(math.nan, 0, 35), (0, math.inf, 35), (0, 0, 0), (0, 0, -1), (0, 0, math.nan)]
)
def test_a_camera_that_cannot_be_is_refused(values: tuple) -> None:
    with pytest.raises(ValueError, match=r"finite|positive"):
        Camera(*values)


def test_a_normal_without_direction_is_refused() -> None:
    with pytest.raises(ValueError, match="direction"):
        Camera.from_normal((0, 0, 0))

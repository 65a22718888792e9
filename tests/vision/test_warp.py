import cv2
import numpy as np
import pytest
import torch

from p3i.size import Size
from p3i.vision.warp import pixel_grid, sample, sample_valid, warp, warp_pixels, warp_valid


def noise(channels: int = 3, height: int = 12, width: int = 17, dtype=torch.float64) -> torch.Tensor:
    return torch.rand(channels, height, width, generator=torch.Generator().manual_seed(0), dtype=dtype)


def slant() -> torch.Tensor:
    return torch.tensor([[0.9, 0.1, 1.3], [-0.05, 0.8, 2.1], [0.004, 0.006, 1.0]], dtype=torch.float64)


def test_a_whole_point_reads_its_pixel():
    values = noise()
    read = sample(values, torch.tensor([[3.0, 5.0], [0.0, 0.0], [16.0, 11.0]], dtype=torch.float64))
    expected = torch.stack([values[:, 5, 3], values[:, 0, 0], values[:, 11, 16]])
    torch.testing.assert_close(read, expected)


def test_half_a_pixel_reads_the_mean_of_its_neighbours():
    values = noise()
    points = torch.tensor([[3.5, 5.0], [3.0, 5.5], [3.5, 5.5]], dtype=torch.float64)
    expected = torch.stack(
        [values[:, 5, 3:5].mean(1), values[:, 5:7, 3].mean(1), values[:, 5:7, 3:5].mean((1, 2))]
    )
    torch.testing.assert_close(sample(values, points), expected)


def test_the_identity_leaves_every_pixel_where_it_is():
    values = noise(dtype=torch.float32)
    torch.testing.assert_close(warp(values, torch.eye(3), Size(17, 12)), values, atol=2e-6, rtol=0)
    assert warp_valid(torch.ones(12, 17, dtype=torch.bool), torch.eye(3), Size(17, 12)).all()


def test_a_whole_shift_moves_pixels_and_reveals_the_unknown():
    values = noise()
    shift = torch.tensor([[1.0, 0, 4], [0, 1, -2], [0, 0, 1]], dtype=torch.float64)
    moved = warp(values, shift, Size(17, 12))
    torch.testing.assert_close(moved[:, 2:, :13], values[:, :10, 4:])
    valid = warp_valid(torch.ones(12, 17, dtype=torch.bool), shift, Size(17, 12))
    expected = torch.zeros(12, 17, dtype=torch.bool)
    expected[2:, :13] = True
    assert torch.equal(valid, expected)


def test_sampling_equals_a_naive_bilinear_reading():
    values = noise()
    generator = torch.Generator().manual_seed(1)
    points = torch.rand(4, 5, 2, generator=generator, dtype=torch.float64) * torch.tensor([16.0, 11.0])
    read = sample(values, points)
    assert read.shape == (4, 5, 3)
    for row in range(4):
        for column in range(5):
            x, y = points[row, column].tolist()
            x0, y0 = min(int(x), 15), min(int(y), 10)
            a, b = x - x0, y - y0
            expected = (
                (1 - a) * (1 - b) * values[:, y0, x0]
                + a * (1 - b) * values[:, y0, x0 + 1]
                + (1 - a) * b * values[:, y0 + 1, x0]
                + a * b * values[:, y0 + 1, x0 + 1]
            )
            torch.testing.assert_close(read[row, column], expected)


def test_gradients_equal_finite_differences_in_values_and_points():
    values = noise(2, 6, 7).requires_grad_()
    points = torch.tensor([[1.3, 2.6], [4.7, 0.2], [5.1, 4.4]], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(sample, (values, points))


def test_gradients_flow_through_a_homography():
    values = noise(2, 8, 9)
    matrix = slant().requires_grad_()
    assert torch.autograd.gradcheck(lambda m: warp(values, m, Size(4, 3)), (matrix,))


def test_a_batch_of_homographies_is_warped_as_one_by_one():
    values = noise()
    matrices = torch.stack([slant(), torch.eye(3, dtype=torch.float64)])
    together = warp(values, matrices, Size(9, 7))
    assert together.shape == (2, 3, 7, 9)
    torch.testing.assert_close(together[0], warp(values, slant(), Size(9, 7)))
    torch.testing.assert_close(together[1], values[:, :7, :9])


def test_outside_the_nearest_pixel_is_read_but_never_valid():
    values = noise()
    far = [[-5.0, 3.0], [40.0, 3.0], [3.0, -0.01], [3.0, 11.01], [1e20, 3.0], [float("nan"), 3.0]]
    points = torch.tensor([*far, [float("inf"), 2.0]], dtype=torch.float64)
    read = sample(values, points)
    torch.testing.assert_close(read[0], values[:, 3, 0])
    torch.testing.assert_close(read[1], values[:, 3, 16])
    torch.testing.assert_close(read[4], values[:, 3, 16])
    assert torch.isfinite(read).all()
    assert not sample_valid(torch.ones(12, 17, dtype=torch.bool), points).any()


def test_the_frame_ends_at_the_outermost_centres():
    corners = torch.tensor([[0.0, 0.0], [16.0, 0.0], [0.0, 11.0], [16.0, 11.0]])
    assert sample_valid(torch.ones(12, 17, dtype=torch.bool), corners).all()


def test_an_unknown_pixel_spoils_what_it_contributes_to_and_nothing_else():
    valid = torch.ones(12, 17, dtype=torch.bool)
    valid[5, 8] = False
    points = torch.tensor(
        [[8.0, 5.0], [7.5, 5.0], [8.9, 4.1], [7.0, 5.0], [9.0, 6.0], [6.5, 5.0], [8.0, 3.0]]
    )
    expected = [False, False, False, True, True, True, True]
    assert sample_valid(valid, points).tolist() == expected


def test_behind_the_camera_nothing_is_valid():
    # w = 1 - 0.2 x turns negative beyond x = 5.
    matrix = torch.tensor([[1.0, 0, 0], [0, 1, 0], [-0.2, 0, 1]], dtype=torch.float64)
    valid = warp_valid(torch.ones(400, 400, dtype=torch.bool), matrix, Size(9, 3))
    assert valid[:, :5].all()
    assert not valid[:, 5:].any()


def test_large_pictures_keep_their_precision():
    ramp = torch.arange(8000, dtype=torch.float32).expand(1, 3, 8000)
    points = torch.tensor([[7990.25, 1.0], [4000.5, 1.0]])
    torch.testing.assert_close(sample(ramp, points)[:, 0], points[:, 0], atol=2e-3, rtol=0)


@pytest.mark.parametrize("channels", [None, 1, 3, 6])
def test_the_fast_warp_equals_the_differentiable_one(channels):
    values = noise(channels or 1, 60, 80, torch.float32)
    smooth = torch.nn.functional.avg_pool2d(values, 9, stride=1, padding=4)
    pixels = smooth.permute(1, 2, 0).contiguous().numpy()
    if channels is None:
        pixels = pixels[:, :, 0]
    slow = warp(smooth.double(), slant(), Size(50, 40)).permute(1, 2, 0).numpy()
    fast = warp_pixels(pixels, slant().numpy(), Size(50, 40))
    valid = warp_valid(torch.ones(60, 80, dtype=torch.bool), slant(), Size(50, 40)).numpy()
    assert valid.mean() > 0.5
    # OpenCV before 5.0 rounds points to 1/32 of a pixel.
    np.testing.assert_allclose(fast.reshape(40, 50, -1)[valid], slow[valid], atol=4e-3)


def test_the_warp_equals_opencv_in_its_reading_of_the_matrix():
    image = np.zeros((40, 50), np.float32)
    image[17, 23] = 1
    matrix = np.array([[1, 0, 3], [0, 1, -4], [0, 0, 1]], np.float64)
    theirs = cv2.warpPerspective(image, matrix, (50, 40), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    ours = warp(torch.from_numpy(image)[None].double(), torch.from_numpy(matrix), Size(50, 40))[0].numpy()
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    assert ours[21, 20] == pytest.approx(1)


def test_the_grid_lists_x_before_y():
    grid = pixel_grid(Size(4, 3))
    assert grid.shape == (3, 4, 2)
    assert grid[2, 1].tolist() == [1.0, 2.0]

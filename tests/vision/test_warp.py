import numpy as np
import pytest
import torch

from p3i.size import Size
from p3i.vision.warp import pixel_grid, sample, sample_valid, warp_pixels


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


def test_large_pictures_keep_their_precision():
    ramp = torch.arange(8000, dtype=torch.float32).expand(1, 3, 8000)
    points = torch.tensor([[7990.25, 1.0], [4000.5, 1.0]])
    torch.testing.assert_close(sample(ramp, points)[:, 0], points[:, 0], atol=2e-3, rtol=0)


@pytest.mark.parametrize("channels", [None, 1, 3, 6])
def test_a_view_through_a_homography_reads_where_the_matrix_says(channels):
    values = noise(channels or 1, 60, 80, torch.float32)
    smooth = torch.nn.functional.avg_pool2d(values, 9, stride=1, padding=4)
    pixels = smooth.permute(1, 2, 0).contiguous().numpy()
    if channels is None:
        pixels = pixels[:, :, 0]
    seen = warp_pixels(pixels, slant().numpy(), Size(50, 40)).reshape(40, 50, -1)
    rows, columns = np.mgrid[:40, :50]
    x, y, depth = np.einsum("rc,chw->rhw", slant().numpy(), np.stack([columns, rows, np.ones((40, 50))]))
    points = torch.from_numpy(np.stack([x / depth, y / depth], axis=-1))
    expected = sample(smooth.double(), points).numpy()
    assert np.ptp(expected) > 0.1
    # Beyond the picture the nearest pixel goes on. OpenCV before 5.0 rounds points to 1/32 of a pixel.
    np.testing.assert_allclose(seen, expected, atol=4e-3)


def test_the_grid_lists_x_before_y():
    grid = pixel_grid(Size(4, 3))
    assert grid.shape == (3, 4, 2)
    assert grid[2, 1].tolist() == [1.0, 2.0]

import cv2
import numpy as np
import pytest
import torch

from p3i.vision.normalize import locally_normalized, principal, unit_energy

GENERATOR = torch.Generator()


def noise(channels: int, height: int, width: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(channels, height, width, generator=GENERATOR.manual_seed(seed))


def known(height: int, width: int) -> torch.Tensor:
    valid = torch.ones(height, width, dtype=torch.bool)
    valid[10:40, 50:90] = False
    return valid


def test_local_normalisation_follows_its_formula():
    height, width = 120, 160
    values = noise(3, height, width) + torch.linspace(-3, 3, width)
    valid = known(height, width)
    weight = valid.numpy().astype(float)
    truth = values.numpy().astype(float)

    def blurred(array):
        return cv2.GaussianBlur(array, (193, 193), 16, borderType=cv2.BORDER_CONSTANT)

    def smooth(array):
        return blurred(array * weight) / blurred(weight)

    energy = (truth**2).sum(0)
    scale = np.sqrt(smooth(energy) + energy[valid.numpy()].mean())
    expected = np.stack([(plane - smooth(plane)) / scale for plane in truth]) * weight
    found = locally_normalized(values, valid).numpy()
    # The Gaussian is computed on a map four times smaller.
    assert np.abs(found - expected).max() < 0.06
    assert np.abs(found - expected).mean() < 0.006


def test_brightness_and_contrast_that_change_slowly_are_taken_out():
    texture = noise(1, 200, 200).repeat(1, 1, 1)
    valid = torch.ones(200, 200, dtype=torch.bool)
    shaded = texture * torch.linspace(1, 6, 200)
    found = locally_normalized(shaded, valid).square().sum(0)
    # The formula, with the neighbourhood's energy for the Gaussian's.
    left, right = (shaded[0, :, part].square().mean() for part in (slice(20, 60), slice(140, 180)))
    mean = shaded.square().mean()
    expected = (right / (right + mean)) / (left / (left + mean))
    assert found[:, 140:180].mean() / found[:, 20:60].mean() == pytest.approx(float(expected), rel=0.1)
    assert expected < 0.5 * right / left


def test_unknown_pixels_never_leak_into_the_normalisation():
    valid = known(60, 100)
    values, other = noise(2, 60, 100), noise(2, 60, 100)
    other[:, ~valid] = 1e6
    assert torch.equal(locally_normalized(values, valid), locally_normalized(other, valid))
    few, others = principal(values, valid, 2), principal(other, valid, 2)
    torch.testing.assert_close(few[:, valid], others[:, valid])


@pytest.mark.parametrize("valid_value", [True, False])
def test_a_flat_or_unknown_map_gives_zeros(valid_value):
    flat = torch.zeros(3, 8, 9)
    valid = torch.full((8, 9), valid_value)
    assert (locally_normalized(flat, valid) == 0).all()
    assert (unit_energy(flat, valid) == 0).all()
    assert principal(flat, valid, 2).abs().max() == 0


def test_principal_components_hold_the_most_energy_and_keep_distances():
    mixing = torch.randn(9, 3, generator=GENERATOR.manual_seed(3))
    values = (mixing @ noise(3, 40, 50).reshape(3, -1)).reshape(9, 40, 50)
    valid = torch.ones(40, 50, dtype=torch.bool)
    few = principal(values, valid, 6)
    assert few.shape == (3, 40, 50)  # there are no more than three
    energies = few.var((1, 2))
    assert (energies.diff() <= 0).all()
    torch.testing.assert_close(
        (few[:, 3, 4] - few[:, 30, 21]).norm(),
        (values[:, 3, 4] - values[:, 30, 21]).norm(),
        rtol=1e-4,
        atol=0,
    )


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_how_many_components_hold_energy_does_not_depend_on_the_unit(scale):
    mixing = torch.randn(9, 3, generator=GENERATOR.manual_seed(3))
    values = scale * (mixing @ noise(3, 40, 50).reshape(3, -1)).reshape(9, 40, 50)
    assert len(principal(values, torch.ones(40, 50, dtype=torch.bool), 6)) == 3


def test_principal_components_do_not_depend_on_the_sign_that_a_solver_happens_to_give():
    values = noise(4, 30, 30)
    valid = torch.ones(30, 30, dtype=torch.bool)
    few = principal(values, valid, 4)
    weights = torch.linalg.lstsq(values.reshape(4, -1).T, few.reshape(4, -1).T).solution
    largest = weights.gather(0, weights.abs().argmax(0, keepdim=True))
    assert (largest > 0).all()


def test_unit_energy_counts_known_pixels_only():
    valid = known(60, 100)
    scaled = unit_energy(7 * noise(3, 60, 100), valid)
    assert scaled.square().sum(0)[valid].mean() == pytest.approx(1, rel=1e-5)
    assert (scaled[:, ~valid] == 0).all()

"""What a rim lacks, carried in part by part, is what is carried in at once."""

import numpy as np
import pytest

from p3i.paint.fill.light import carried, carried_into
from p3i.vision.strips import Window


@pytest.mark.parametrize(("spacing_px", "most"), [(40.0, 1e-6), (400.0, 3e-3)])
def test_parts_join_to_the_whole(spacing_px: float, most: float) -> None:
    random = np.random.default_rng(0)
    rim = np.zeros((700, 530), bool)
    rim[:, 260:263] = rim[400:403] = True
    light = np.linspace(-0.1, 0.1, 700, dtype=np.float32)[:, None, None]
    off = rim[:, :, None] * (light + random.normal(0, 0.01, (700, 530, 3)).astype(np.float32))

    def read(window: Window) -> tuple[np.ndarray, np.ndarray]:
        return off[window], rim[window]

    found = np.zeros_like(off)
    for window, lift in carried_into(read, rim.shape, spacing_px=spacing_px):
        found[window] += lift
    wanted = carried(off, rim.astype(np.float32), spacing_px=spacing_px)
    near = np.abs(wanted).sum(2) > 0
    assert np.abs(found - wanted)[near].max() < most


def test_nothing_is_carried_in_without_a_rim() -> None:
    def read(window: Window) -> tuple[np.ndarray, np.ndarray]:
        shape = tuple(part.stop - part.start for part in window)
        return np.zeros((*shape, 3), np.float32), np.zeros(shape, bool)

    for spacing_px in (40.0, 400.0):
        assert not list(carried_into(read, (300, 200), spacing_px=spacing_px))

"""What a rim lacks is carried in alike part by part and at once, from reduced pictures and from the whole."""

import numpy as np
import pytest

from p3i.paint.fill import light
from p3i.paint.fill.light import carried_into, rim_of
from p3i.vision.strips import Window


def carried(off: np.ndarray, rim: np.ndarray, *, spacing_px: float) -> np.ndarray:
    """All that is carried in from a rim [h, w] that lacks `off` [h, w, 3]."""

    def read(window: Window) -> tuple[np.ndarray, np.ndarray]:
        return off[window], rim[window]

    found = np.zeros_like(off)
    for window, lift in carried_into(read, np.ones_like(rim), spacing_px=spacing_px):
        found[window] += lift
    return found


@pytest.mark.parametrize(("spacing_px", "most"), [(40.0, 1e-5), (110.0, 1e-3), (400.0, 1e-3), (1100.0, 2e-3)])
def test_parts_join_to_the_whole(spacing_px: float, most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(0)
    rim = np.zeros((701, 530), bool)
    rim[:, 260:263] = rim[400:403] = True
    lifted = np.linspace(-0.1, 0.1, 701, dtype=np.float32)[:, None, None]
    off = rim[:, :, None] * (lifted + random.normal(0, 0.01, (701, 530, 3)).astype(np.float32))
    found = carried(off, rim, spacing_px=spacing_px)
    monkeypatch.setattr(light, "_COARSE_SIGMA", np.inf)
    monkeypatch.setattr(light, "_PART_PX", 10_000)
    wanted = carried(off, rim, spacing_px=spacing_px)
    assert np.abs(wanted).max() > 0.05
    # So far in that a bell ends there it ends a few pixels earlier or later.
    far = 3 * spacing_px * light._SMOOTH * light._SCALES[-1]
    near = rim_of(~rim, np.ones_like(rim), reach_px=far) | rim
    assert np.abs(found - wanted)[near].max() < most


def test_a_ring_is_carried_alike_on_a_reduced_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    rows, columns = np.mgrid[:300, :420]
    rim = np.abs(np.hypot(rows - 150, columns - 210) - 120) < 3
    off = (rim * np.where(columns < 210, 0.1, -0.05))[:, :, None].repeat(3, 2).astype(np.float32)
    reduced = carried(off, rim, spacing_px=260)
    monkeypatch.setattr(light, "_COARSE_SIGMA", np.inf)
    exact = carried(off, rim, spacing_px=260)
    assert np.abs(exact).max() > 0.03
    assert np.abs(reduced - exact).max() < 0.5 / 255


def test_a_step_along_a_rim_is_met_beside_it() -> None:
    hole = np.zeros((80, 80), np.uint8)
    hole[20:60, 20:60] = 1
    rim = rim_of(hole, np.ones((80, 80), bool), reach_px=4)
    step = np.where(np.arange(80) < 40, -0.1, 0.1)[None, :, None] * np.ones(3)
    off = np.where(rim[:, :, None], step, 0).astype(np.float32)
    lift = carried(off, rim, spacing_px=64.0)
    assert np.abs(lift[20, 20:36] + 0.1).max() < 0.01
    assert np.abs(lift[20, 44:60] - 0.1).max() < 0.01


def test_nothing_is_carried_in_without_a_rim() -> None:
    for spacing_px in (40.0, 400.0):
        assert not carried(
            np.ones((300, 200, 3), np.float32), np.zeros((300, 200), bool), spacing_px=spacing_px
        ).any()

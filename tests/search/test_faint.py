"""Many objects that each agree a little are an answer; as many that stand anywhere are none."""

from functools import cache

import cv2
import numpy as np

import p3i
from p3i.search.config import SearchConfig
from p3i.search.result import MOST_FALSE_ALARMS, NEEDED, StopReason, SynthesisResult
from p3i.vision.image import Image

COLUMNS, ROWS, CELL_PX = 19, 17, 20
FINER = 4


def board(*, stray_px: float, ruled: bool) -> Image:
    """A ruled board under black and white stones put down by hand, on half of its crossings."""
    random = np.random.default_rng(0)
    width, height, cell = (COLUMNS + 1) * CELL_PX, (ROWS + 1) * CELL_PX, CELL_PX * FINER
    pixels = np.full((height * FINER, width * FINER), 0.62, np.float32)
    for i in range(1, COLUMNS + 1) if ruled else ():
        cv2.line(pixels, (i * cell, cell), (i * cell, ROWS * cell), 0.25, FINER)
    for j in range(1, ROWS + 1) if ruled else ():
        cv2.line(pixels, (cell, j * cell), (COLUMNS * cell, j * cell), 0.25, FINER)
    for i in range(1, COLUMNS + 1):
        for j in range(1, ROWS + 1):
            if random.random() < 0.55:
                grey = float(random.choice([0.08, 0.95]))
                x, y = (cell * k + FINER * random.normal(0, stray_px) for k in (i, j))
                cv2.circle(pixels, (int(x), int(y)), int(0.46 * cell), grey, -1, cv2.LINE_AA)
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    small = small + 0.1 * random.normal(size=small.shape).astype(np.float32)
    shown = np.repeat(np.clip(small, 0, 1)[..., None], 3, axis=2)
    return Image(np.ascontiguousarray(shown, np.float32), np.ones(small.shape, bool))


@cache
def answer() -> SynthesisResult:
    return p3i.synth(board(stray_px=2.4, ruled=True), SearchConfig(structure="lattice"))


def test_a_board_of_three_hundred_faint_cells_is_answered_by_what_they_explain_together() -> None:
    found = answer()
    assert found.program is not None and found.stop is StopReason.FOUND, found.reason
    assert len(found.centers) > 0.8 * COLUMNS * ROWS
    assert abs(found.program.camera.rx_deg) < 2 and abs(found.program.camera.ry_deg) < 2
    assert found.agreement is not None and found.agreement < NEEDED
    assert found.false_alarms is not None and found.false_alarms < MOST_FALSE_ALARMS
    assert found.candidates[0].false_alarms == found.false_alarms


def test_nothing_says_that_such_an_answer_needs_a_score() -> None:
    found = answer()
    assert found.needed is None and "needs" not in found.reason


def test_its_agreement_is_the_one_that_score_says(tmp_path) -> None:
    found = answer()
    assert found.program is not None and found.agreement is not None
    text = tmp_path / "a.p3p"
    text.write_text(p3i.format(found.program))
    said = p3i.score(board(stray_px=2.4, ruled=True), text).agreement
    assert f"{found.agreement:.4f}" == f"{said:.4f}"


def test_stones_strewn_over_a_plain_ground_are_refused() -> None:
    found = p3i.synth(board(stray_px=30.0, ruled=False), SearchConfig(structure="lattice"))
    assert found.program is None and found.false_alarms is None
    assert found.needed is None

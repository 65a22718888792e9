"""The overlay: what is on it, and that labels keep apart."""

import numpy as np
import pytest
from marked import LATTICE, drawn

from p3i import loads
from p3i.errors import UsageError
from p3i.paint.draw.scene import Dots, Labels, Strokes
from p3i.paint.draw.show import show
from p3i.vision.image import Image

BOARD = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 12):
    for j in range(0, 8):
        Draw(x=5*i - 27.5, y=5*j - 17.5)
"""


def grey(value: float = 0.5, width: int = 640, height: int = 480) -> Image:
    return Image(np.full((height, width, 3), value, np.float32), np.ones((height, width), bool))


def labels(photo: Image, text: str = BOARD, **changes) -> Labels:
    (layer,) = [part for part in show(photo, loads(text), **changes).scene.layers if isinstance(part, Labels)]
    return layer


@pytest.mark.parametrize("width", [200, 640, 2000])
def test_labels_overlap_nowhere_at_any_size(width: int) -> None:
    found = labels(grey(width=width, height=width * 3 // 4))
    halves = found.heights[:, None] / 2 * np.array([[0.6 * len(text), 1] for text in found.texts])
    assert len(found.texts) >= 4
    for k, middle in enumerate(found.anchors):
        apart = np.abs(found.anchors - middle) >= halves + halves[k]
        assert np.delete(apart.any(axis=1), k).all()


def test_there_is_room_for_all_labels_on_a_large_picture() -> None:
    assert len(labels(grey(width=2000, height=1500)).texts) == 96


def test_labels_are_names_or_indices_or_left_out() -> None:
    assert {"A1", "H12"} <= set(labels(grey(width=2000, height=1500)).texts)
    assert {"0,0", "11,7"} <= set(labels(grey(width=2000, height=1500), labels="index").texts)
    picture = show(grey(), loads(BOARD), labels="none")
    assert not any(isinstance(part, Labels) for part in picture.scene.layers)


@pytest.mark.parametrize("ground", [0.0, 1.0])
def test_a_label_is_seen_on_dark_and_on_light_ground(ground: float) -> None:
    photo = grey(ground, 1000, 750)
    bare = show(photo, loads(BOARD), labels="none").pixels().astype(int)
    written = show(photo, loads(BOARD)).pixels().astype(int)
    changed = np.abs(written - bare).max(axis=2)
    assert (changed > 150).sum() > 1000


def test_the_extent_runs_round_all_cells_once() -> None:
    with_it = show(grey(), loads(BOARD), labels="none", points=False, cells=False, horizon=False)
    lines = [part for part in with_it.scene.layers if isinstance(part, Strokes)]
    assert {len(line.segments) for line in lines} == {2 * (12 + 8)}


def test_the_pictures_that_a_program_names_are_not_laid_over_its_photo() -> None:
    named = BOARD.replace("Draw(", 'Draw("nowhere.png", ')
    assert np.array_equal(show(grey(), loads(named)).pixels(), show(grey(), loads(BOARD)).pixels())


def test_an_unknown_option_is_refused_by_name() -> None:
    with pytest.raises(UsageError, match="no option 'lables'"):
        show(grey(), loads(BOARD), lables="none")


def test_dots_of_one_column_share_a_colour_and_columns_differ() -> None:
    (dots,) = [p for p in show(drawn(LATTICE), loads(LATTICE)).scene.layers if isinstance(p, Dots)]
    colours, counts = np.unique(dots.colours, axis=0, return_counts=True)
    assert 1 < len(colours) < len(dots.centers) and counts.min() > 1

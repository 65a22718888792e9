"""The filling benchmark hides what it says, measures what it says, and quilts as the paper does."""

import importlib
import types
from typing import Any

import cv2
import numpy as np
import pytest
from test_benchmarks import SCRIPTS

import p3i
from p3i.evaluation.truth import truth_of
from p3i.interp.camera import Camera
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.sheet import project

SIZE = Size(600, 480)
RANDOM = np.random.default_rng(7)


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS[0].parent))


def module(name: str) -> types.ModuleType:
    return importlib.import_module(name)


def photo_like() -> np.ndarray:
    """Whole numbers of 0..255 with detail of several sizes: float [120, 150, 3]."""
    coarse = cv2.resize(RANDOM.random((15, 19, 3)), (150, 120), interpolation=cv2.INTER_CUBIC)
    return np.rint((0.7 * coarse + 0.3 * RANDOM.random((120, 150, 3))).clip(0, 1) * 255)


def box(shape: tuple[int, int], top: int, left: int, height: int, width: int) -> np.ndarray:
    mask = np.zeros(shape, bool)
    mask[top : top + height, left : left + width] = True
    return mask


def annotated(kind: str, *, rx_deg: float = 0.0, spoilt: tuple[int, ...] = ()) -> tuple[dict[str, Any], Any]:
    """A made-up annotation of 12 x 10 lattice points 20 apart, or of two rings of 16, and its truth."""
    pose = {"rx": rx_deg, "ry": 0.0, "focal_mm": 35.0}
    matrix = Camera(rx_deg, 0.0, 35.0).image_from_plane(SIZE).numpy()

    def pixels(plane: np.ndarray) -> list[list[float]]:
        return project(matrix, plane / SIZE.unit_px)[0].tolist()

    said: dict[str, Any] = {"file": "made up", "width": SIZE.width, "height": SIZE.height, "pose": pose}
    if kind == "lattice":
        steps = np.array([(i, j) for i in range(12) for j in range(10)])
        said |= {"structure": kind, "lattice": {"base": [-110, -90], "u": [20, 0], "v": [0, 20]}}
        said |= {"centers": pixels(np.array([-110, -90]) + 20.0 * steps), "hidden": list(spoilt)}
    else:
        around = 2 * np.pi * np.arange(16) / 16
        rings = [
            {"center": [0, 0], "n": 16, "centers": pixels(r * np.c_[np.cos(around), np.sin(around)])}
            for r in (100.0, 125.0)
        ]
        said |= {"structure": "hybrid", "rings": rings}
        said |= {"centers": [center for ring in rings for center in ring["centers"]]}
    return said, truth_of(said)


def within(mask: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which of the pixels [K, 2] the mask has."""
    columns, rows = np.rint(points).astype(int).T
    return mask[rows, columns]


def test_the_truth_itself_measures_as_perfect() -> None:
    truth, hole = photo_like(), box((120, 150), 40, 50, 30, 40)
    whole = np.ones_like(hole)
    found = module("filling.measures").judged(truth, truth, hole, pattern=whole, known=whole)
    assert found.l1 == 0 and found.psnr > 70 and found.ssim == pytest.approx(1)
    assert found.sharp == 1 and found.seam == 1 and found.sharp_pattern == pytest.approx(1, rel=0.2)


def test_a_blurred_fill_is_less_sharp_than_the_truth_and_a_harder_one_is_sharper() -> None:
    truth, hole = photo_like(), box((120, 150), 40, 50, 30, 40)
    whole = np.ones_like(hole)
    judged = module("filling.measures").judged
    mean = truth[hole].mean()
    for fill, low, high in (
        (cv2.GaussianBlur(truth, (0, 0), 2), 0, 0.3),
        (np.full_like(truth, mean), 0, 0.01),
        (mean + 2 * (truth - mean), 3.99, 4.01),  # an energy: of the squares
    ):
        found = judged(truth, np.where(hole[..., None], fill, truth), hole, pattern=whole, known=whole)
        assert low <= found.sharp <= high and low <= found.sharp_pattern <= 1.3 * high
        assert found.l1 > 0


def test_a_shifted_patch_and_one_of_other_light_have_a_seam() -> None:
    smooth = np.rint(cv2.GaussianBlur(photo_like(), (0, 0), 4))
    hole = box((120, 150), 40, 50, 30, 40)
    whole = np.ones_like(hole)
    judged = module("filling.measures").judged
    for fill in (np.roll(smooth, 15, axis=1), smooth + 20):
        found = judged(smooth, np.where(hole[..., None], fill, smooth), hole, pattern=whole, known=whole)
        assert found.seam > 2


def test_what_is_unknown_beside_a_hole_is_no_seam_and_no_pattern() -> None:
    truth, hole = photo_like(), box((120, 150), 40, 0, 30, 75)
    known = ~box((120, 150), 0, 75, 120, 75)
    spoilt = np.where(known[..., None], truth, 9999)
    judged = module("filling.measures").judged
    found = judged(spoilt, spoilt + 200, hole, pattern=np.ones_like(hole), known=known)
    assert found.seam > 2 and found.sharp_pattern == pytest.approx(1, rel=0.2)


def test_similarity_is_that_of_its_formula() -> None:
    first, second = photo_like(), photo_like()
    found = module("filling.measures").similarity(first, second)
    a, b = (one[50:57, 60:67].reshape(49, 3) for one in (first, second))
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    each = [
        (2 * x.mean() * y.mean() + c1)
        * (2 * np.cov(x, y)[0, 1] + c2)
        / ((x.mean() ** 2 + y.mean() ** 2 + c1) * (x.var(ddof=1) + y.var(ddof=1) + c2))
        for x, y in zip(a.T, b.T, strict=True)
    ]
    assert found[53, 63] == pytest.approx(np.mean(each))


HOLES = {
    "inside": (40, 30, 30, 45),
    "a side": (0, 0, 120, 40),
    "a corner": (0, 90, 60, 60),
    "another corner": (80, 50, 40, 100),
    "a band": (50, 0, 30, 150),
}


@pytest.mark.parametrize("place", HOLES)
def test_quilting_fills_a_periodic_texture_exactly(place: str) -> None:
    tile = np.random.default_rng(1).random((10, 14, 3)).astype(np.float32)
    picture, hole = np.tile(tile, (12, 11, 1))[:, :150], box((120, 150), *HOLES[place])
    found = module("filling.quilting").quilted(np.where(hole[..., None], np.float32(0), picture), hole)
    assert np.array_equal(found, picture)


def test_quilting_leaves_the_photo_and_follows_its_seed() -> None:
    picture, hole = (photo_like() / 255).astype(np.float32), box((120, 150), 0, 40, 60, 110)
    quilted = module("filling.quilting").quilted
    first, again, other = (quilted(picture, hole, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert np.array_equal(first[~hole], picture[~hole]) and not np.array_equal(first[hole], picture[hole])
    # Every pixel comes from the photo; none of it is a mixture.
    known = {tuple(colour) for colour in picture[~hole].tolist()}
    assert all(tuple(colour) in known for colour in first[hole].tolist())


def test_the_cut_of_quilting_takes_the_path_of_least_error() -> None:
    error = np.full((6, 5), 9.0)
    path = [1, 2, 3, 3, 2, 1]
    error[range(6), path] = 0
    assert module("filling.quilting")._before(error).sum(1).tolist() == path


def test_quilting_needs_a_block_of_the_photo() -> None:
    hole = ~box((40, 40), 0, 0, 3, 40)
    with pytest.raises(ValueError, match="no block"):
        module("filling.quilting").quilted(np.zeros((40, 40, 3), np.float32), hole)


@pytest.mark.parametrize("rx_deg", [0.0, 35.0])
def test_blocks_and_boxes_of_a_lattice_hide_as_many_objects_as_they_say(rx_deg: float) -> None:
    said, truth = annotated("lattice", rx_deg=rx_deg)
    parts = module("filling.ground").grounds(said, truth)
    centers = np.array(said["centers"])
    assert len(parts[0].cells) == 120 and np.allclose(np.sort(parts[0].centers(), 0), np.sort(centers, 0))
    assert within(parts[0].mask(), centers).all()
    for seed in range(5):
        found = {
            hole.kind: hole.mask for hole in module("filling.holes").holes(parts, np.random.default_rng(seed))
        }
        for kind, count in (("1 cell", 1), ("2 cells", 2), ("4 cells", 4), ("12 cells", 12)):
            assert within(found[kind], centers).sum() == count
        assert 1 <= within(found["box of 1.2"], centers).sum() <= 4
        assert 9 <= within(found["box of 3"], centers).sum() <= 12
        assert within(found["edge"], centers).sum() == 2 and within(found["corner"], centers).sum() == 1


def test_boxes_over_edge_and_corner_lie_on_the_pattern_by_half() -> None:
    said, truth = annotated("lattice")
    parts = module("filling.ground").grounds(said, truth)
    pattern = parts[0].mask()
    for seed in range(5):
        found = {
            hole.kind: hole.mask for hole in module("filling.holes").holes(parts, np.random.default_rng(seed))
        }
        for kind in ("edge", "corner"):
            assert found[kind].sum() == pytest.approx(40 * 40, rel=0.1)
            assert (found[kind] & pattern).sum() == pytest.approx(found[kind].sum() / 2, rel=0.1)
        assert found["box of 1.2"].sum() == pytest.approx(24 * 24, rel=0.1)
        assert (found["box of 3"] & ~pattern).sum() == 0


def test_an_object_that_a_scene_does_not_show_is_in_no_block() -> None:
    spoilt = tuple(range(0, 120, 7))
    said, truth = annotated("lattice", spoilt=spoilt)
    parts = module("filling.ground").grounds(said, truth)
    gone = np.array(said["centers"])[list(spoilt)]
    assert len(parts[0].cells) == 120 - len(spoilt)
    for seed in range(5):
        for hole in module("filling.holes").holes(parts, np.random.default_rng(seed)):
            if hole.kind.endswith(("cell", "cells")):
                assert not within(hole.mask, gone).any()


@pytest.mark.parametrize("rx_deg", [0.0, 35.0])
def test_arcs_of_a_ring_hide_as_many_of_its_objects_as_they_say(rx_deg: float) -> None:
    said, truth = annotated("rings", rx_deg=rx_deg)
    parts = module("filling.ground").grounds(said, truth)
    centers = np.array(said["centers"])
    assert [len(part.cells) for part in parts] == [16, 16]
    inner, outer = (part.mask() for part in parts)
    assert (inner & outer).sum() < 0.05 * inner.sum()  # they share their rims
    for seed in range(5):
        found = {
            hole.kind: hole.mask for hole in module("filling.holes").holes(parts, np.random.default_rng(seed))
        }
        for kind, count in (("1 object", 1), ("2 objects", 2), ("quarter of ring", 4)):
            hidden = within(found[kind], centers)
            assert sorted((hidden[:16].sum(), hidden[16:].sum())) == [0, count]


@pytest.mark.parametrize("kind", ["lattice", "rings"])
def test_completions_hide_a_quarter_to_a_half_up_to_the_edge(kind: str) -> None:
    said, truth = annotated(kind)
    parts = module("filling.ground").grounds(said, truth)
    holes = module("filling.holes")
    centers = np.concatenate([part.centers() for part in parts])
    pattern = np.any([part.mask() for part in parts], axis=0)
    rows, columns = (np.flatnonzero(pattern.any(axis)) for axis in (1, 0))
    for seed in range(5):
        found = list(holes.holes(parts, np.random.default_rng(seed)))
        groups = holes.in_groups(found, centers)
        assert sorted(hole.kind for group in groups for hole in group) == sorted(h.kind for h in found)
        large = {hole.kind: hole.mask for hole in found if hole.kind in holes.COMPLETIONS}
        assert set(large) == set(holes.COMPLETIONS)
        area = (rows[-1] + 1 - rows[0]) * (columns[-1] + 1 - columns[0])
        for mask in large.values():
            assert 0.24 * area <= mask.sum() <= 0.46 * area
        side, band = large["side missing"], large["band missing"]
        assert within(side, centers).any() and side.any(1).sum() >= len(rows) - 2
        assert side[:, columns[0] + 1].any() != side[:, columns[-1] - 1].any()
        assert band.any(0).sum() >= len(columns) - 2 and not band[[rows[0], rows[-1]]].any()
        for group in groups:
            if len(group) > 1:
                together = np.any([hole.mask for hole in group], axis=0)
                assert within(together, centers).mean() <= 1 / 6


@pytest.mark.parametrize("method", ["stack", "guided patchmatch", "patchmatch", "quilting", "telea", "ns"])
def test_each_method_fills_the_hole_alone_and_never_from_what_is_transparent(method: str) -> None:
    dots = np.full((160, 200, 3), 0.2, np.float32)
    for x in range(10, 200, 20):
        for y in range(10, 160, 20):
            cv2.circle(dots, (x, y), 6, (0.7, 0.8, 0.7), -1)
    size = Size(200, 160)
    step, first = 20 / size.unit_px, -90 / size.unit_px
    program = p3i.loads(
        f"SetCameraPose(rx=0, ry=0)\nfor i in range(0, 10):\n    for j in range(-1, 9):\n"
        f"        Draw(x={step}*i + {first}, y={step}*j + {first})\n"
    )
    hole, gone = box((160, 200), 60, 60, 20, 40), box((160, 200), 50, 100, 40, 60)
    pixels = np.where(gone[..., None], np.float32([1, 0, 1]), np.where(hole[..., None], np.float32(0), dots))
    (fill,) = module("filling.methods").fills([method], {}).values()
    filled = fill(Image(pixels, ~gone), program, hole)
    assert filled.dtype == np.float32 and filled.shape == dots.shape
    assert np.allclose(filled[~hole & ~gone], dots[~hole & ~gone], atol=1 / 255)
    assert (filled[hole][:, 1] > 0.15).all()
    if method == "stack":
        assert np.abs(filled - dots)[hole].mean() < 0.02

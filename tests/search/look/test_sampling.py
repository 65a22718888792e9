"""Blocks of a compressed picture and the pixels of an enlarged one are no pattern, though they repeat."""

import math

import cv2
import numpy as np
import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

import p3i
from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.judge.accept import beyond_noise
from p3i.search.look.evidence import Evidence
from p3i.search.look.recurrence import recurrence_bits
from p3i.search.look.sampling import on_own_grid
from p3i.vision.image import Image

SIDE = 320
LOOPS = torch.cartesian_prod(*[torch.arange(-6, 7, dtype=torch.float64)] * 2)

small = st.integers(-3, 3)


@given(basis=st.tuples(small, small, small, small), side=st.floats(4, 16), shift=st.floats(-200, 200))
def test_steps_of_whole_squares_lie_on_the_grid(
    basis: tuple[int, int, int, int], side: float, shift: float
) -> None:
    steps = torch.tensor(basis, dtype=torch.float64).reshape(2, 2)
    assume(abs(float(torch.linalg.det(steps))) > 0.5 and math.gcd(*basis) == 1)
    assert on_own_grid(side * LOOPS @ steps + shift, LOOPS)


@given(side=st.floats(18, 60), fields=st.sampled_from([((1, 0), (0, 1)), ((1, 1), (-1, 1))]))
def test_the_fields_of_a_board_that_faces_the_camera_are_larger(
    side: float, fields: tuple[tuple[int, int], ...]
) -> None:
    assert not on_own_grid(side * LOOPS @ torch.tensor(fields, dtype=torch.float64), LOOPS)


@given(turn_deg=st.floats(2, 43), side=st.floats(8, 40))
def test_what_is_turned_does_not(turn_deg: float, side: float) -> None:
    turn = torch.deg2rad(torch.tensor(turn_deg, dtype=torch.float64))
    sine, cosine = turn.sin(), turn.cos()
    tangents = [abs(float(turn.tan()) - ratio) for ratio in (1 / 3, 1 / 2, 2 / 3)]
    assume(min(tangents) > 0.03)  # those are steps of whole squares again
    steps = side * torch.stack([torch.stack([cosine, sine]), torch.stack([-sine, cosine])])
    assert not on_own_grid(LOOPS @ steps, LOOPS)


def test_what_is_seen_at_a_slant_does_not() -> None:
    pattern = compile(
        parse(
            "SetCameraPose(rx=12, ry=0)\nfor i in range(0, 12):\n    for j in range(0, 12):\n"
            "        Draw(x=7*i - 38, y=7*j - 38)"
        )
    )
    points, _ = pattern.centers_px(size=p3i.Size(SIDE, SIDE), focal_mm=35.0)
    assert not on_own_grid(points, pattern.index.double())


def smooth(seed: int, *, blur: float) -> NDArray:
    drawn = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(SIDE, SIDE, 3)), (0, 0), blur)
    return 0.5 + 0.2 * drawn / drawn.std()


def picture(pixels: NDArray) -> Image:
    return Image(np.ascontiguousarray(np.clip(pixels, 0, 1), np.float32), np.ones(pixels.shape[:2], bool))


def compressed(pixels: NDArray, quality: int) -> NDArray:
    done, stream = cv2.imencode(
        ".jpg", np.clip(255 * pixels, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    assert done
    return cv2.imdecode(stream, cv2.IMREAD_COLOR) / 255.0


def enlarged(seed: int, times: int) -> NDArray:
    grain = np.random.default_rng(seed).uniform(size=(SIDE // times, SIDE // times, 3))
    return 0.3 + 0.4 * cv2.resize(grain, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize(
    "pixels",
    [compressed(smooth(1, blur=30), 12), compressed(smooth(2, blur=60), 25), enlarged(3, 16)],
    ids=["blocks", "fainter blocks", "enlarged"],
)
def test_a_picture_with_nothing_but_its_own_grid_is_refused(pixels: NDArray) -> None:
    assert p3i.synth(picture(pixels)).program is None


def grid_of(step_px: float, count: int) -> str:
    step = step_px / SIDE * 100
    start = -step * (count - 1) / 2
    return (
        f"SetCameraPose(rx=0, ry=0)\nfor i in range(0, {count}):\n    for j in range(0, {count}):\n"
        f"        Draw(x={step:g}*i + {start:g}, y={step:g}*j + {start:g})"
    )


def test_a_board_that_faces_the_camera_is_still_found() -> None:
    pixels = np.full((SIDE, SIDE, 3), 0.8)
    for row in range(8):
        for column in range(8):
            cv2.circle(pixels, (column * 32 + 48, row * 32 + 48), 9, (0.1, 0.2, 0.5), -1, cv2.LINE_AA)
    found = p3i.synth(picture(pixels + 0.05 * (smooth(4, blur=2) - 0.5)))
    assert found.program is not None
    assert found.structure == "lattice"


def test_of_many_draws_those_not_read_count_only_beside_enough_that_were() -> None:
    pixels = np.full((SIDE, SIDE, 3), 0.8)
    for row in range(20):
        for column in range(20):
            cv2.circle(pixels, (column * 16 + 8, row * 16 + 8), 4, (0.1, 0.2, 0.5), -1, cv2.LINE_AA)
    evidence = Evidence(picture(pixels), SearchConfig(), 35.0)
    pattern = compile(parse(grid_of(16, 20)))

    def saved(needed: float) -> float:
        index = pattern.index.double()
        return recurrence_bits(evidence, pattern, index, focal_mm=35.0, cells=True, needed=needed)

    read = saved(1e9)
    assert beyond_noise(read)
    assert saved(0.9 * read) == pytest.approx(2 * read)

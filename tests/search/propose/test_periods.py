"""Periods at both ends: as small as eight pixels, as large as a third of the frame."""

import cv2
import numpy as np
import pytest
from truth import lattice_error, lattice_of, pose_error_deg

from p3i.grammar.ast import Affine, CameraPose, Draw, For, Program
from p3i.interp.camera import Camera, project
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image

SIZE = Size(640, 480)


def lattice(step: float, count: int, camera: tuple[float, float]) -> Program:
    """`count` x `count` objects `step` units apart around the middle."""
    first = -(count - 1) / 2 * step
    draw = Draw(Affine(i=step, constant=first), Affine(j=step, constant=first))
    bound = Affine(constant=count)
    return Program(CameraPose(*camera), For("i", Affine(), bound, For("j", Affine(), bound, draw)))


def discs(program: Program, share: float) -> Image:
    """Discs of `share` of the spacing in radius, with a mark, on an uneven ground."""
    random = np.random.default_rng(3)
    scale = 4
    pattern, matrix = compile(program), Camera.of(program).image_from_plane(SIZE)
    centers, _ = project(matrix, pattern.centers())
    beside, _ = project(matrix, pattern.points_at(pattern.index.double() + 0.1))
    ground = cv2.resize(random.uniform(0.55, 0.85, (12, 16)), (scale * SIZE.width, scale * SIZE.height))
    canvas = np.repeat(ground[:, :, None], 3, 2).astype(np.float32)
    for (x, y), (x2, y2) in zip(centers.tolist(), beside.tolist(), strict=True):
        radius = scale * share / 0.14 * np.hypot(x2 - x, y2 - y)
        at = (round(scale * (x + 0.5)), round(scale * (y + 0.5)))
        cv2.circle(canvas, at, round(radius), (0.2, 0.3, 0.6), -1, cv2.LINE_AA)
        mark = (round(at[0] + 0.4 * radius), round(at[1] - 0.3 * radius))
        cv2.circle(canvas, mark, round(0.35 * radius), (0.9, 0.8, 0.3), -1, cv2.LINE_AA)
    small = cv2.resize(canvas, (SIZE.width, SIZE.height), interpolation=cv2.INTER_AREA)
    noisy = small + random.normal(0, 0.01, small.shape)
    return Image(np.clip(noisy, 0, 1).astype(np.float32), np.ones(small.shape[:2], bool))


@pytest.mark.parametrize(
    ("step", "count"), [(1.25, 24), (25.0, 4)], ids=["eight pixels", "a quarter of the width"]
)
def test_the_lattice_is_found(step: float, count: int) -> None:
    truth = lattice(step, count, (-12.0, 10.0))
    result = synthesize(discs(truth, 0.3), SearchConfig(structure="lattice"))
    assert result.program is not None, result.reason
    assert lattice_error(lattice_of(result.program).basis, lattice_of(truth).basis) < 0.1
    assert pose_error_deg(result.program, truth) < 2

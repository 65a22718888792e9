"""How well a program explains a photo: equation 2 against a loop, and a score for right and wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from columns import two_kinds_of_columns
from truth import SMALL, evidence_of, small_scene

from p3i.errors import ProgramError
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, If, Polar, Program
from p3i.interp.camera import Camera
from p3i.interp.unroll import points
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.forms.length import cost_bits
from p3i.search.judge.bits import explained_bits
from p3i.search.judge.evaluate import evaluate
from p3i.search.look.contrast import score_of
from p3i.search.look.evidence import Evidence
from p3i.vision.image import Image

CONFIG = SearchConfig()


def lattice(
    u: tuple[float, float], v: tuple[float, float], base: tuple[float, float], *, pose: CameraPose
) -> Program:
    draw = Draw(Affine(u[0], v[0], base[0]), Affine(u[1], v[1], base[1]))
    inner = For("j", Affine(), Affine(constant=5), draw)
    return Program(pose, For("i", Affine(), Affine(constant=6), inner))


def test_the_true_program_scores_high_and_a_wrong_one_low() -> None:
    scene = small_scene(16)
    truth = evaluate(scene.image(), scene.program, CONFIG)
    assert truth.agreement > 0.5
    assert truth.objects == len(scene.index)
    wrong_step = lattice((10.0, 1.3), (-0.8, 9.4), (-28.0, -18.0), pose=scene.program.camera)
    assert evaluate(scene.image(), wrong_step, CONFIG).agreement < 0.1
    camera = scene.program.camera
    flat = replace(scene.program, camera=CameraPose(camera.rx_deg + 25, camera.ry_deg - 30))
    assert evaluate(scene.image(), flat, CONFIG).agreement < 0.15


def test_a_score_is_of_the_objects_whatever_steps_they_are_written_in() -> None:
    scene = small_scene(16)
    whole = replace(scene.program, header=None)
    world = whole.world
    assert isinstance(world, For) and isinstance(world.body, For) and isinstance(world.body.body, Draw)
    draw, across, down = world.body.body, int(world.stop.constant), int(world.body.stop.constant)
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    # j becomes i + j, so that i runs along the other diagonal, and two guards hold the same cells.
    sheared = Draw(*(Affine(one.i - one.j, one.j, one.constant) for one in (draw.x, draw.y)))
    guarded = If(Affine(-1, 1, 0), If(Affine(1, -1, down - 1), sheared))
    inner = For("j", Affine(), Affine(constant=across + down), guarded)
    other = replace(whole, world=replace(world, body=inner))
    assert len(points(other)) == len(points(whole))
    scores = [evaluate(scene.image(), program, CONFIG).agreement for program in (whole, other)]
    assert scores[0] == pytest.approx(scores[1], abs=1e-6)
    told = [Answer(program, "lattice", 1.0, 0.0) for program in (whole, other)]
    bits = [explained_bits(evidence_of(scene), one) + cost_bits(one.program) for one in told]
    assert bits[0] == pytest.approx(bits[1])


def test_a_shifted_program_scores_as_high_but_one_at_twice_the_step_does_not() -> None:
    """What repeats repeats at any phase; but at a double step the half step is a period, too."""
    scene = small_scene(16)
    truth = evaluate(scene.image(), scene.program, CONFIG).agreement
    world = scene.program.world
    assert isinstance(world, For) and isinstance(world.body, For) and isinstance(world.body.body, Draw)
    draw = world.body.body
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)

    def with_draw(x: Affine, y: Affine, *, i_stop: int = 8) -> Program:
        inner = For("j", Affine(), Affine(constant=4), Draw(x, y))
        return replace(scene.program, world=For("i", Affine(), Affine(constant=i_stop), inner))

    double = with_draw(
        Affine(2 * draw.x.i, draw.x.j, draw.x.constant),
        Affine(2 * draw.y.i, draw.y.j, draw.y.constant),
        i_stop=4,
    )
    assert evaluate(scene.image(), double, CONFIG).agreement < 0.2 * truth


def bilinear(values: np.ndarray, x: float, y: float) -> np.ndarray:
    left, top = min(math.floor(x), values.shape[2] - 2), min(math.floor(y), values.shape[1] - 2)
    a, b = x - left, y - top
    square = values[:, top : top + 2, left : left + 2]
    upper, lower = (
        square[:, 0, 0] * (1 - a) + square[:, 0, 1] * a,
        square[:, 1, 0] * (1 - a) + square[:, 1, 1] * a,
    )
    return upper * (1 - b) + lower * b


@pytest.mark.parametrize("features", ["oriented", "rgb"])
def test_equation_2_is_the_naive_sum_over_neighbours_in_sight(features: str) -> None:
    scene = small_scene(7)
    config = SearchConfig(features=features)
    values = Evidence(scene.image(), config, 35.0).features(SMALL.longer).values.numpy().astype(float)
    matrix = Camera.of(scene.program).image_from_plane(SMALL).numpy()
    read: dict[tuple[int, int], np.ndarray] = {}
    for x, y, i, j in points(scene.program):
        a, b, depth = matrix @ [x, y, 1.0]
        if depth > 0 and 0 <= a / depth <= SMALL.width - 1 and 0 <= b / depth <= SMALL.height - 1:
            read[i, j] = bilinear(values, a / depth, b / depth)
    loss, pairs = 0.0, 0
    for (i, j), here in read.items():
        for neighbour in ((i + 1, j), (i, j + 1)):
            if neighbour in read:
                loss, pairs = loss + float(((here - read[neighbour]) ** 2).sum()), pairs + 1
    found = evaluate(scene.image(), scene.program, config)
    assert pairs > 30
    assert found.edges == pairs
    assert found.equation2 == pytest.approx(loss, rel=1e-3)


def test_the_score_of_two_kinds_of_columns_does_not_depend_on_their_number() -> None:
    few, many, odd = (
        evaluate(*two_kinds_of_columns(rows, columns), CONFIG).agreement
        for rows, columns in ((24, 24), (30, 30), (27, 31))
    )
    assert many == pytest.approx(few, abs=0.03) and odd == pytest.approx(few, abs=0.03)


def test_draws_that_coincide_count_once() -> None:
    scene = small_scene(16)
    # Ring i has i * 6 draws at multiples of 60 degrees: each of its six places i times (Table 1).
    x = Polar("Cos", Affine(i=8), Affine(j=60), Affine())
    y = Polar("Sin", Affine(i=8), Affine(j=60), Affine())

    def rings(stop: Affine) -> Program:
        return Program(
            scene.program.camera,
            For("i", Affine(constant=1), Affine(constant=4), For("j", Affine(), stop, Draw(x, y))),
        )

    doubled, once = (
        evaluate(scene.image(), rings(stop), CONFIG) for stop in (Affine(i=6), Affine(constant=6))
    )
    assert doubled.objects == once.objects == 18
    assert doubled == once


def test_a_row_is_scored_along_its_one_loop() -> None:
    scene = small_scene(16)
    world = scene.program.world
    assert isinstance(world, For) and isinstance(world.body, For) and isinstance(world.body.body, Draw)
    draw = world.body.body
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    row = Draw(
        replace(draw.x, j=0.0, constant=draw.x.constant + 3 * draw.x.j),
        replace(draw.y, j=0.0, constant=draw.y.constant + 3 * draw.y.j),
    )
    program = replace(
        scene.program,
        world=For("i", Affine(), Affine(constant=10), For("j", Affine(), Affine(constant=1), row)),
    )
    found = evaluate(scene.image(), program, CONFIG)
    assert found.edges == found.objects - 1
    assert 0 <= found.agreement <= 1


@pytest.mark.parametrize("base", [(4000.0, 0.0), (0.0, -3000.0)])
def test_a_program_out_of_sight_has_no_score(base: tuple[float, float]) -> None:
    away = lattice((5.0, 0.0), (0.0, 5.0), base, pose=CameraPose(0, 0))
    with pytest.raises(ProgramError, match="0 of the program's objects lie in the photo; a score needs two"):
        evaluate(small_scene(16).image(), away, CONFIG)


def test_one_object_is_too_few() -> None:
    one = Program(
        CameraPose(),
        For(
            "i",
            Affine(),
            Affine(constant=1),
            For("j", Affine(), Affine(constant=1), Draw(Affine(i=1), Affine(j=1))),
        ),
    )
    with pytest.raises(ProgramError, match="1 of the program's objects"):
        evaluate(small_scene(16).image(), one, CONFIG)


def test_the_focal_is_that_of_the_option_then_the_header_then_the_photo() -> None:
    scene = small_scene(16)
    image = scene.image()
    bare = replace(scene.program, header=None)
    told = replace(scene.program, header=Header(canvas=(SMALL.width, SMALL.height), focal_mm=35.0))
    exif = Image(image.pixels, image.valid, focal_mm=80.0)
    right = evaluate(image, bare, CONFIG)
    assert right == evaluate(exif, told, CONFIG) == evaluate(exif, bare, SearchConfig(focal_mm=35.0))
    assert evaluate(exif, bare, CONFIG).agreement < right.agreement - 0.1
    assert evaluate(exif, bare, CONFIG) == evaluate(image, told, SearchConfig(focal_mm=80.0))


def test_a_mask_takes_objects_out_of_the_loss() -> None:
    scene = small_scene(16)
    image = scene.image()
    valid = image.valid.copy()
    valid[:, : SMALL.width // 2] = False
    whole, half = (evaluate(one, scene.program, CONFIG) for one in (image, Image(image.pixels, valid)))
    assert half.edges < 0.7 * whole.edges
    other = image.pixels.copy()
    other[~valid] = np.random.default_rng(0).uniform(size=(int((~valid).sum()), 3))
    again = evaluate(Image(other, valid), scene.program, CONFIG)
    assert again.agreement == pytest.approx(half.agreement, abs=0.02)


def test_few_objects_get_less_than_many() -> None:
    def alike(count: int) -> float:
        return score_of(torch.full((count,), 0.8))

    assert [alike(count) for count in (1, 3, 6)] == [0, 0, 0]
    assert 0 < alike(8) < alike(40) < 0.8


def test_cells_against_the_pattern_count_half() -> None:
    contrast = torch.full((60,), 0.5)
    hidden, against = contrast.clone(), contrast.clone()
    hidden[:30], against[:30] = 0, -0.5
    assert score_of(hidden) == pytest.approx(score_of(contrast) / 2)
    assert score_of(against) == pytest.approx(score_of(contrast) / 4)
    assert score_of(-contrast) == 0


def test_the_evidence_makes_a_map_once() -> None:
    evidence = evidence_of(small_scene(16))
    assert evidence.features(320) is evidence.features(320)
    assert evidence.level(320, blur=2.0) is evidence.level(320, blur=2.1)
    assert evidence.level(320, blur=2.0) is not evidence.level(320, blur=4.0)
    assert max(evidence.features(640).values.shape) == SMALL.longer, "a photo is never enlarged"

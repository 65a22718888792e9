"""Ellipses against circles, cells against the lattice, pixels against areas, sprites against OpenCV."""

import math

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.grammar.ast import Affine, CameraPose, Draw, For, Polar, Program
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.paint.draw.raster import blend, paint
from p3i.paint.draw.scene import WHITE, Dots, Pixels, Scene, Strokes, dots, rainbow
from p3i.paint.draw.sprite import lay, sprite_of
from p3i.paint.draw.view import camera_view, clip_to_canvas
from p3i.place import outlines
from p3i.size import Size
from p3i.vision.image import Image

torch.set_num_threads(1)


def lattice(u: tuple[float, float], v: tuple[float, float], counts: tuple[int, int] = (4, 3)) -> Program:
    inner = Draw(Affine(u[0], v[0], -20), Affine(u[1], v[1], -10))
    rows = For("j", Affine(), Affine(constant=counts[1]), inner)
    return Program(CameraPose(), For("i", Affine(), Affine(constant=counts[0]), rows))


def rings(first: int) -> Program:
    x, y = (Polar(turn, Affine(i=8), Affine(j=30), Affine()) for turn in ("Cos", "Sin"))
    inner = For("j", Affine(), Affine(constant=12), Draw(x, y))
    return Program(CameraPose(), For("i", Affine(constant=first), Affine(constant=4), inner))


def index_of(program: Program) -> np.ndarray:
    return compile(program).index.numpy().astype(float)


@settings(deadline=None)
@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(-20, 20), st.floats(-20, 20), st.floats(0.5, 10))
def test_a_dot_is_the_ellipse_that_the_camera_sees_of_a_circle(
    rx: float, ry: float, x: float, y: float, radius: float
) -> None:
    view = camera_view(Camera(rx, ry), Size(640, 480))
    found = dots(view, np.array([[x, y]]), radius=radius, colours=np.zeros((1, 3), np.uint8), light_rim=False)
    turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
    circle, depth = view.project(np.array([x, y]) + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    if (depth <= 0.05 * view.depth_unit).any() or not len(found.centers) or found.axes.min() < 1.2:
        return
    angle = math.radians(found.angles_deg[0])
    turned = (circle - found.centers[0]) @ np.array(
        [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    )
    np.testing.assert_allclose(np.hypot(*(turned / found.axes[0]).T), 1, atol=1e-6)


def test_the_cells_of_a_lattice_are_parallelograms_around_its_points() -> None:
    program = lattice((10, 2), (3, 12))
    segments = outlines.sides(outlines.chart_of(compile(program)), index_of(program))
    assert len(segments) == 3 * 5 + 4 * 4  # 4 x 3 cells: lines between and around them
    steps = np.abs(segments[:, 1] - segments[:, 0])
    assert {tuple(step) for step in steps.round(6).tolist()} == {(10, 2), (3, 12)}
    corner = np.array([-20, -10]) - np.array([13, 14]) / 2
    np.testing.assert_allclose(segments.reshape(-1, 2).min(axis=0), corner)


def test_the_cells_of_rings_are_sectors() -> None:
    program = rings(1)
    segments = outlines.sides(outlines.chart_of(compile(program)), index_of(program))
    lengths = np.hypot(*segments.reshape(-1, 2).T)
    assert lengths.min() == pytest.approx(4) and lengths.max() == pytest.approx(28)
    middles = segments.mean(axis=1)
    arcs = np.abs(np.hypot(*segments[:, 0].T) - np.hypot(*segments[:, 1].T)) < 1e-6
    assert np.isclose(np.hypot(*middles[arcs].T) % 8, 4, atol=0.1).all(), "arcs lie between the rings"


def test_a_cell_that_folds_over_the_centre_has_no_outline() -> None:
    program = rings(0)
    segments = outlines.sides(outlines.chart_of(compile(program)), index_of(program))
    assert np.hypot(*segments.reshape(-1, 2).T).min() == pytest.approx(4)


def test_one_direction_gives_cells_as_wide_as_long() -> None:
    row = Program(CameraPose(), For("i", Affine(), Affine(constant=3), Draw(Affine(i=6), Affine(i=8))))
    chart = outlines.chart_of(compile(row))
    segments = outlines.sides(chart, index_of(row))
    np.testing.assert_allclose(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1), 10)
    assert len(segments) == 3 * 2 + 4
    assert outlines.pitch(chart) == pytest.approx(10)


def test_a_row_of_circles_is_outlined_circle_by_circle() -> None:
    x, y = (Polar(turn, Affine(constant=9), Affine(j=36), Affine()) for turn in ("Cos", "Sin"))
    moved = Polar(x.function, x.radius, x.angle, Affine(i=26))
    inner = For("j", Affine(), Affine(constant=10), Draw(moved, y))
    circles = Program(CameraPose(), For("i", Affine(), Affine(constant=3), inner))
    chart = outlines.chart_of(compile(circles))
    assert chart.directions == (1,)
    corners = outlines.sides(chart, index_of(circles)).reshape(-1, 2)
    nearest = np.abs(corners[:, None] - [(0, 0), (26, 0), (52, 0)]).max(axis=2).min(axis=1)
    assert nearest.max() < 13


def test_the_spacing_is_that_of_the_closest_neighbours_even_in_a_skew_basis() -> None:
    chart = outlines.chart_of(compile(lattice((10, 0), (9, 3))))
    assert outlines.pitch(chart) == pytest.approx(math.hypot(1, 3))
    alone = Program(CameraPose(), Draw(Affine(), Affine()))
    assert outlines.pitch(outlines.chart_of(compile(alone))) == outlines.DEFAULT_PITCH


@settings(deadline=None)
@given(st.lists(st.tuples(*[st.floats(-500, 500)] * 4), min_size=1, max_size=5))
def test_clipping_keeps_the_part_of_a_line_that_is_on_the_canvas(ends: list[tuple[float, ...]]) -> None:
    size = Size(100, 80)
    segments = np.array(ends).reshape(-1, 2, 2)
    kept = clip_to_canvas(segments, size)
    assert (kept > -20).all() and (kept < (120, 100)).all()
    for first, last in segments:
        walked = first + np.linspace(0, 1, 301)[:, None] * (last - first)
        seen = ((walked >= 0) & (walked <= (99, 79))).all(axis=1)
        for point in walked[seen]:
            along = kept[:, 1] - kept[:, 0]
            share = ((point - kept[:, 0]) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-200)
            foot = kept[:, 0] + np.clip(share, 0, 1)[:, None] * along
            assert np.linalg.norm(point - foot, axis=1).min() < 1e-6


def test_a_line_covers_as_much_as_its_width_says() -> None:
    for width in (1.0, 1.5, 3.0):
        for ends in ([[10, 40.3], [90, 40.3]], [[10, 12], [90, 71]]):
            strokes = Strokes(np.array([ends]), (0, 0, 0), width)
            pixels = paint(Scene(Size(300, 100), WHITE, (strokes,)))
            covered = (255.0 - pixels[:, :, 0]).sum() / 255
            length = float(np.linalg.norm(np.subtract(*ends)))
            assert covered == pytest.approx(length * width + width**2, rel=0.08)
            row, column = (round((ends[0][k] + ends[1][k]) / 2) for k in (1, 0))
            assert pixels[row, column, 0] < 140


def test_crossing_lines_of_one_kind_do_not_add_up() -> None:
    cross = np.array([[[10.0, 50], [90, 50]], [[50, 10], [50, 90]]])
    pixels = paint(Scene(Size(100, 100), WHITE, (Strokes(cross, (0, 0, 0), 3, 0.5),)))
    assert pixels[50, 50].tolist() == pixels[50, 30].tolist() == [128, 128, 128]


def test_a_dot_covers_the_area_of_its_ellipse_around_its_centre() -> None:
    black = np.zeros((1, 3), np.uint8)
    dot = Dots(np.array([[30.25, 20.75]]), np.array([[12.0, 5]]), np.array([30.0]), black, black, 2.0)
    darkness = 255.0 - paint(Scene(Size(64, 48), WHITE, (dot,)))[:, :, 0]
    assert darkness.sum() / 255 == pytest.approx(math.pi * 13 * 6, rel=0.01)
    rows, columns = np.mgrid[:48, :64]
    center = [(darkness * grid).sum() / darkness.sum() for grid in (columns, rows)]
    assert center == pytest.approx([30.25, 20.75], abs=0.02)
    expected = cv2.ellipse(np.zeros((48, 64), np.uint8), (30, 21), (13, 6), 30, 0, 360, 255, -1)
    assert np.abs(darkness - expected).mean() < 6


def test_blending_over_nothing_keeps_the_colour_and_the_transparency() -> None:
    canvas = np.zeros((1, 1, 4), np.uint8)
    blend(canvas, np.array([200, 100, 0]), np.array([[0.5]], np.float32))
    assert canvas[0, 0].tolist() == [200, 100, 0, 128]
    blend(canvas, np.array([0, 100, 200]), np.array([[1.0]], np.float32))
    assert canvas[0, 0].tolist() == [0, 100, 200, 255]


def test_rainbows_run_from_red_to_violet_without_repeating() -> None:
    colours = rainbow(np.arange(7, 15))
    assert colours[0].argmax() == 0 and colours[0, 1:].max() < 60
    assert colours[-1].argmax() == 2
    assert len(np.unique(colours, axis=0)) == 8
    assert rainbow(np.array([], int)).shape == (0, 3)


def checker(side: int, *, alpha: np.ndarray | None = None) -> Image:
    rows, columns = np.mgrid[:side, :side]
    light = ((rows // (side // 4) + columns // (side // 4)) % 2).astype(np.float32)
    pixels = np.stack([light, 1 - light, np.full_like(light, 0.5)], axis=2)
    image = Image(pixels, np.ones((side, side), bool))
    if alpha is not None:
        image.valid[:] = alpha >= 0.5
    return image


def test_a_sprite_lies_on_the_plane_as_opencv_warps_it() -> None:
    view = camera_view(Camera(-40, 20), Size(320, 240))
    image, units, point = checker(256), 30.0, np.array([4.0, -3])
    layer = lay(view, [sprite_of(image)], point[None], units=units)
    plane_from_sprite = np.array(
        [[units / 256, 0, point[0] - units / 2], [0, units / 256, point[1] - units / 2], [0, 0, 1]]
    )
    plane_from_sprite[:2, 2] += 0.5 * units / 256  # pixel centres at whole numbers
    matrix = view.canvas_from_plane @ plane_from_sprite
    warped = cv2.warpPerspective(image.pixels, matrix, (320, 240), flags=cv2.INTER_AREA)
    inside = cv2.erode((layer[:, :, 3] == 255).astype(np.uint8), np.ones((3, 3))) > 0
    assert inside.sum() > 1000
    wrong = np.abs(layer[:, :, :3] / 255 - warped).max(axis=2) > 0.35
    assert (wrong & inside).sum() < 0.06 * inside.sum(), "apart from the edges of the squares"
    corners, _ = view.project(point + units / 2 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]))
    area = cv2.contourArea(corners.astype(np.float32))
    assert layer[:, :, 3].sum() / 255 == pytest.approx(area, rel=0.02)


def test_sprites_are_painted_far_to_near() -> None:
    view = camera_view(Camera(-50, 0), Size(200, 200))
    red, blue = (np.zeros((16, 16, 3), np.float32) for _ in range(2))
    red[:, :, 0] = 1
    blue[:, :, 2] = 1
    sprites = [sprite_of(Image(colour, np.ones((16, 16), bool))) for colour in (red, blue)]
    near_first = np.array([[0.0, 5], [0, -5]])
    layer = lay(view, sprites, near_first, units=20)
    middle, _ = view.project(np.array([0.0, 0]))
    column, row = np.rint(middle).astype(int)
    assert layer[row, column].tolist() == [255, 0, 0, 255], "the near one, though it comes first"


def test_a_tiny_sprite_far_away_keeps_its_mean_colour() -> None:
    view = camera_view(Camera(0, 0), Size(100, 100))
    layer = lay(view, [sprite_of(checker(512))], np.array([[0.0, 0]]), units=6)
    seen = layer[layer[:, :, 3] == 255][:, :3]
    np.testing.assert_allclose(seen.mean(axis=0), [127.5, 127.5, 127.5], atol=4)
    assert seen.std(axis=0).max() < 90


def test_transparent_parts_of_a_sprite_show_what_lies_below() -> None:
    holes = np.ones((64, 64))
    holes[16:48, 16:48] = 0
    view = camera_view(Camera(0, 0), Size(101, 101))
    layer = lay(view, [sprite_of(checker(64, alpha=holes))], np.array([[0.0, 0]]), units=50)
    assert layer[50, 50, 3] == 0 and layer[50, 30, 3] == 255
    paper = Scene(Size(101, 101), WHITE, (Pixels(layer),))
    assert paint(paper)[50, 50].tolist() == [255, 255, 255]


def test_a_sprite_that_reaches_behind_the_camera_ends_at_the_canvas() -> None:
    size = Size(120, 90)
    view = camera_view(Camera(-75, 0), size)
    layer = lay(view, [sprite_of(checker(64))], np.array([[0.0, 60]]), units=120)
    horizon = Camera(-75, 0).horizon(size)
    assert horizon is not None
    assert (layer[-1, :, 3] == 255).all(), "it fills the foreground"
    above = int(-horizon[2] / horizon[1])
    assert above > 5 and (layer[: above - 1, :, 3] == 0).all()

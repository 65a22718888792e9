"""Whole pictures: what stands where, in which colour, on which canvas, and what is refused."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from strategies import programs

from p3i import loads
from p3i.api import render
from p3i.errors import FileError, P3IError, ProgramError, UsageError
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, If, Polar, Program
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera
from p3i.options.render import RenderOptions, kind_of
from p3i.paint.draw.scene import Dots, Strokes, rainbow
from p3i.records import fields_of
from p3i.size import Size
from p3i.vision.image import Image, read_image
from p3i.vision.write import write_image

torch.set_num_threads(1)

WHITE = [255, 255, 255]


def grid(count: int = 4, *, step: float = 18, camera: tuple[float, float] = (-40, 10), **header) -> Program:
    first = -step * (count - 1) / 2
    draw = Draw(Affine(i=step, constant=first), Affine(j=step, constant=first))
    loops = For("i", Affine(), Affine(constant=count), For("j", Affine(), Affine(constant=count), draw))
    return Program(CameraPose(*camera), loops, header=Header(**header) if header else None)


def photo(size: Size, colour: tuple[float, float, float] = (0.2, 0.4, 0.6)) -> Image:
    pixels = np.ones((size.height, size.width, 3), np.float32) * np.array(colour, np.float32)
    return Image(pixels, np.ones(pixels.shape[:2], bool))


def at(pixels: np.ndarray, point: np.ndarray) -> list[int]:
    column, row = np.rint(point).astype(int)
    return pixels[row, column].tolist()


def test_each_object_is_marked_where_the_camera_sees_it_in_the_colour_of_its_i() -> None:
    program, size = grid(), Size(320, 240)
    picture = render(program, size=size)
    pixels = picture.pixels()
    colours = rainbow(np.arange(4)).tolist()
    for point, (i, _) in zip(picture.centers_px, picture.index, strict=True):
        assert at(pixels, point) == colours[i]
    matrix = Camera.of(program).image_from_plane(size).numpy()
    x, y, depth = matrix @ [-27, -27, 1]
    np.testing.assert_allclose(picture.centers_px[0], [x / depth, y / depth])


def test_one_loop_is_coloured_in_the_order_of_drawing() -> None:
    ring = For(
        "j", Affine(), Affine(constant=8),
        Draw(Polar("Cos", Affine(constant=30), Affine(j=45), Affine()),
             Polar("Sin", Affine(constant=30), Affine(j=45), Affine())),
    )  # fmt: skip
    picture = render(Program(CameraPose(), ring), size=Size(200, 200))
    found = [at(picture.pixels(), point) for point in picture.centers_px]
    assert found == rainbow(np.arange(8)).tolist()
    assert len({tuple(colour) for colour in found}) == 8


def test_markers_are_larger_where_the_plane_is_nearer() -> None:
    (dots,) = (part for part in render(grid(), size=Size(400, 300)).scene.layers if isinstance(part, Dots))
    assert dots.axes[0].max() < dots.axes[-1].max(), "painted far to near"
    assert dots.centers[0, 1] < dots.centers[-1, 1]


def test_what_lies_behind_the_camera_is_not_drawn_and_said() -> None:
    program = grid(20, camera=(-60, 0))
    picture = render(program, size=Size(200, 200))
    behind = np.isnan(picture.centers_px[:, 0])
    assert 0 < behind.sum() < len(behind)
    assert f"{behind.sum()} of 400 objects lie at or behind the camera" in picture.notes[0]
    beside = Program(CameraPose(-60, 0), Draw(Affine(), Affine(constant=200)))
    assert (render(beside, size=Size(50, 50)).pixels() == 255).all()


def test_the_canvas_follows_the_option_then_the_photo_then_the_header() -> None:
    program = grid(canvas=(120, 90))
    assert render(program).size == Size(120, 90)
    assert render(program, image=photo(Size(160, 120))).size == Size(160, 120)
    assert render(program, image=photo(Size(160, 120)), size=Size(80, 60)).size == Size(80, 60)


def test_without_a_canvas_the_picture_holds_every_object_with_a_cell_around_it() -> None:
    for program in (grid(), grid(3, step=40), grid(5, step=2, camera=(30, -50))):
        picture = render(program)
        assert picture.size.longer == 1024
        low, high = picture.centers_px.min(axis=0), picture.centers_px.max(axis=0)
        assert (low > 20).all() and (high < (picture.size.width - 21, picture.size.height - 21)).all()
        (cells,) = (part.segments for part in picture.scene.layers if isinstance(part, Strokes))
        assert (cells > 0).all() and (cells < (picture.size.width, picture.size.height)).all()


def test_a_fitted_picture_is_a_window_of_the_camera_view() -> None:
    program = grid()
    fitted, whole = render(program), render(program, size=Size(1000, 1000))
    scale = np.ptp(fitted.centers_px, axis=0) / np.ptp(whole.centers_px, axis=0)
    np.testing.assert_allclose(scale[0], scale[1])
    moved = fitted.centers_px - fitted.centers_px[0]
    np.testing.assert_allclose(moved, scale * (whole.centers_px - whole.centers_px[0]), atol=1e-6)


def test_the_straight_view_shows_the_lattice_without_perspective() -> None:
    picture = render(grid(), plane=True, size=Size(300, 200))
    places = picture.centers_px.reshape(4, 4, 2)
    steps = np.concatenate([np.diff(places, axis=0).reshape(-1, 2), np.diff(places, axis=1).reshape(-1, 2)])
    np.testing.assert_allclose(np.sort(np.abs(steps), axis=1)[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(steps).max(axis=1), np.abs(steps).max())
    np.testing.assert_allclose(places.mean(axis=(0, 1)), [149.5, 99.5])


def test_a_photo_is_straightened_back_to_the_plane_it_was_drawn_from() -> None:
    program, size = grid(), Size(640, 480)
    seen = render(program, size=size, cells=False).pixels()
    seen_image = Image((seen / np.float32(255)).astype(np.float32), np.ones(seen.shape[:2], bool))
    straight = render(program, image=seen_image, plane=True, markers=False, size=Size(400, 400))
    pixels = straight.pixels()
    assert pixels.shape[2] == 4, "what the photo does not show is transparent"
    direct = render(program, plane=True, cells=False, size=Size(400, 400)).pixels()
    known = pixels[:, :, 3] == 255
    assert known.mean() > 0.5
    wrong = np.abs(pixels[:, :, :3].astype(int) - direct).max(axis=2) > 80
    assert (wrong & known).mean() < 0.01


def test_a_photo_shows_through_where_nothing_is_drawn_over_it() -> None:
    program, image = grid(), photo(Size(200, 150))
    picture = render(program, image=image)
    pixels = picture.pixels()
    assert pixels[0, 0].tolist() == [51, 102, 153]
    assert at(pixels, picture.centers_px[0]) == rainbow(np.arange(4)).tolist()[0]
    assert not any(isinstance(part, Strokes) for part in picture.scene.layers), "no cells over a photo"
    assert any(isinstance(part, Strokes) for part in render(program, image=image, cells=True).scene.layers)


def test_unknown_pixels_of_a_photo_stay_transparent() -> None:
    image = photo(Size(60, 40))
    image.valid[:20] = False
    pixels = render(grid(), image=image, markers=False).pixels()
    assert (pixels[:20, :, 3] == 0).all() and (pixels[20:, :, 3] == 255).all()


def test_a_photo_is_never_distorted() -> None:
    with pytest.raises(UsageError, match="distort"):
        render(grid(), image=photo(Size(160, 120)), size=Size(100, 100))


def test_a_canvas_of_another_shape_than_the_photo_is_noted() -> None:
    picture = render(grid(canvas=(640, 480)), image=photo(Size(100, 100)))
    assert "640 x 480" in picture.notes[0] and "100 x 100" in picture.notes[0]


def test_the_focal_is_that_of_the_option_then_the_header_then_the_photo_then_35() -> None:
    size = Size(64, 48)
    with_exif = dataclasses.replace(photo(size), focal_mm=28.0)
    headed = grid(focal_mm=50.0)
    for program, image, option, expected in [
        (headed, with_exif, 85.0, (85.0, "option")),
        (headed, with_exif, None, (50.0, "header")),
        (grid(), with_exif, None, (28.0, "exif")),
        (grid(), photo(size), None, (35.0, "default")),
    ]:
        picture = render(program, image=image, focal_mm=option)
        assert (picture.camera.focal_mm, picture.focal_source) == expected


def test_the_horizon_is_drawn_where_it_crosses_the_canvas() -> None:
    size = Size(300, 200)
    camera = Camera(-80, 5)
    line = camera.horizon(size)
    assert line is not None
    program = grid(camera=(-80, 5))
    drawn = render(program, size=size, horizon=True, markers=False, cells=False)
    (strokes,) = drawn.scene.layers
    assert isinstance(strokes, Strokes)
    distances = strokes.segments @ np.array(line[:2]) + line[2]
    np.testing.assert_allclose(distances, 0, atol=1e-6)
    assert render(grid(camera=(0, 0)), size=size, horizon=True, markers=False, cells=False).scene.layers == ()


def test_draws_that_coincide_are_one_object() -> None:
    walked_twice = For(
        "j", Affine(), Affine(constant=12),
        Draw(Polar("Cos", Affine(constant=30), Affine(j=60), Affine()),
             Polar("Sin", Affine(constant=30), Affine(j=60), Affine())),
    )  # fmt: skip
    assert len(render(Program(CameraPose(), walked_twice)).index) == 6


def test_a_program_that_draws_nothing_gives_an_empty_picture_and_says_so() -> None:
    nothing = Program(CameraPose(-30, 0), For("i", Affine(), Affine(), Draw(Affine(i=3), Affine())))
    for plane in (False, True):
        picture = render(nothing, plane=plane)
        assert (picture.pixels() == 255).all()
        assert picture.notes == ("the program draws nothing",)


def test_the_picture_named_by_draw_is_looked_up_beside_the_program(tmp_path: Path) -> None:
    red = np.zeros((8, 8, 3), np.uint8)
    red[:] = (200, 0, 0)
    write_image(tmp_path / "red.png", red)
    program = tmp_path / "row.p3p"
    program.write_text('Draw("red.png", x=0, y=0)')
    picture = render(program, size=Size(100, 100))
    assert at(picture.pixels(), np.array([50, 50])) == [200, 0, 0]
    program.write_text('Draw("blue.png", x=0, y=0)')
    with pytest.raises(FileError, match=r"the picture of Draw.*blue\.png"):
        render(program)
    green = photo(Size(8, 8), (0, 1, 0))
    assert at(render(program, sprite=green, size=Size(100, 100)).pixels(), np.array([50, 50])) == [0, 255, 0]


def named_pictures(tmp_path: Path) -> Path:
    """A program's folder, below it and beside it a red picture, and links in it that lead out and in."""
    red = np.full((8, 8, 3), (200, 0, 0), np.uint8)
    folder = tmp_path / "programs"
    (folder / "below").mkdir(parents=True)
    write_image(tmp_path / "red.png", red)
    write_image(folder / "below" / "red.png", red)
    (folder / "out.png").symlink_to(tmp_path / "red.png")
    (folder / "in.png").symlink_to(folder / "below" / "red.png")
    return folder


@pytest.mark.parametrize("name", ["{beside}", "../red.png", "below/../../red.png", "out.png", "../gone.png"])
def test_pictures_outside_the_programs_folder_are_read_only_where_that_is_allowed(
    name: str, tmp_path: Path
) -> None:
    folder = named_pictures(tmp_path)
    name = name.format(beside=tmp_path / "red.png")
    program = folder / "row.p3p"
    program.write_text(f'Draw("{name}", x=0, y=0)')
    with pytest.raises(FileError, match=r"picture of Draw.* outside the program's folder; --allow-outside"):
        render(program)
    with pytest.raises(FileError, match="outside"):
        render(loads(program.read_text()), beside=folder)
    if "gone" not in name:
        picture = render(program, size=Size(100, 100), allow_outside=True)
        assert at(picture.pixels(), np.array([50, 50])) == [200, 0, 0]


@pytest.mark.parametrize("name", ["below/red.png", "in.png", "below/../in.png", "{inside}"])
def test_pictures_below_the_programs_folder_are_read(name: str, tmp_path: Path) -> None:
    folder = named_pictures(tmp_path)
    program = folder / "row.p3p"
    program.write_text(f'Draw("{name.format(inside=folder / "below" / "red.png")}", x=0, y=0)')
    assert at(render(program, size=Size(100, 100)).pixels(), np.array([50, 50])) == [200, 0, 0]


@pytest.mark.parametrize("name", ["pipe", "below", "loop", "/dev/zero"])
def test_what_is_no_picture_file_is_refused_and_not_waited_for(name: str, tmp_path: Path) -> None:
    folder = named_pictures(tmp_path)
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to(folder / "loop")
    program = folder / "row.p3p"
    program.write_text(f'Draw("{name}", x=0, y=0)')
    with pytest.raises(FileError, match=r"the picture of Draw\(\.\.\.\)"):
        render(program, allow_outside=True)


@pytest.mark.parametrize("size", [Size(100_000, 100_000), Size(1, 200_000_000)])
def test_a_picture_beyond_the_limit_is_refused_with_the_way_to_raise_it(size: Size) -> None:
    with pytest.raises(UsageError, match=f"100,000,000 pixels; --max-px {size.width * size.height}"):
        render(grid(), size=size)
    with pytest.raises(UsageError, match="max_px"):
        render(grid(canvas=(size.width, size.height)))


def test_a_sketch_is_refused_as_a_program_error(tmp_path: Path) -> None:
    sketch = tmp_path / "open.p3p"
    sketch.write_text("SetCameraPose(rx=??, ry=0)\nDraw(x=1, y=2)\n")
    with pytest.raises(ProgramError, match="P116") as caught:
        render(sketch)
    assert caught.value.exit_code == 4


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_a_drawn_picture_carries_its_program(tmp_path: Path, kind: str) -> None:
    program = grid(canvas=(64, 48))
    text = format_program(program).replace("for j", "# rows & <columns>, \u00fc\n    for j")
    source = tmp_path / "grid.p3p"
    source.write_text(text, encoding="utf-8")
    drawn = tmp_path / f"drawn.{kind}"
    first = render(source)
    first.save(drawn)
    again = render(drawn)
    assert format_program(again.program) == text
    np.testing.assert_array_equal(again.pixels(), first.pixels())


def test_a_file_is_written_whole_or_not_at_all_and_never_over_another(tmp_path: Path) -> None:
    picture = render(grid(), size=Size(64, 48))
    target = tmp_path / "a.png"
    target.write_bytes(b"mine")
    with pytest.raises(FileError, match="--force"):
        picture.save(target)
    assert target.read_bytes() == b"mine"
    picture.save(target, force=True)
    assert read_image(target).size == Size(64, 48)
    with pytest.raises(FileError, match="no folder"):
        picture.save(tmp_path / "missing" / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_equal_calls_give_equal_bytes() -> None:
    for kind in ("png", "svg", "pdf"):
        first, second = (render(grid(), horizon=True).encode(kind) for _ in range(2))
        assert first == second


def test_kinds_are_told_by_the_suffix() -> None:
    assert kind_of("a/B.PNG") == "png"
    with pytest.raises(UsageError, match=r"\.png, \.svg, \.pdf"):
        kind_of("a.gif")
    with pytest.raises(UsageError, match="gif"):
        render(grid(), size=Size(9, 9)).encode("gif")


def test_options_are_checked_and_documented() -> None:
    with pytest.raises(UsageError, match="colour"):
        render(grid(), colour="red")
    for wrong in ({"focal_mm": 0.0}, {"sprite_units": -1.0}, {"max_px": 0}, {"focal_mm": float("nan")}):
        with pytest.raises(UsageError):
            RenderOptions(**wrong)
    assert fields_of(RenderOptions).keys() == {field.name for field in dataclasses.fields(RenderOptions)}
    for field in fields_of(RenderOptions).values():
        assert field.sentence.endswith(".")
        assert field.default == getattr(RenderOptions(), field.name)


def test_a_guarded_outline_draws_only_its_cells() -> None:
    whole = grid(4)
    assert isinstance(whole.world, For) and isinstance(whole.world.body, For)
    inner = whole.world.body
    assert isinstance(inner.body, Draw)
    guarded = dataclasses.replace(inner, body=If(Affine(1, 1, -3), inner.body))
    triangle = dataclasses.replace(whole, world=dataclasses.replace(whole.world, body=guarded))
    picture = render(triangle, size=Size(200, 200))
    assert len(picture.index) == 10
    (cells,) = (part for part in picture.scene.layers if isinstance(part, Strokes))
    assert len(cells.segments) == 10 * 4 - 12, "each shared side once"


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    programs(remarks=False),
    st.booleans(),
    st.sampled_from([None, Size(64, 48), Size(1, 1)]),
    st.sampled_from(["png", "svg", "pdf"]),
)
def test_no_program_ends_in_a_traceback(program: Program, plane: bool, size: Size | None, kind: str) -> None:
    try:
        picture = render(program, plane=plane, size=size, horizon=True, cells=True, markers=True)
        assert picture.encode(kind)
    except P3IError:
        pass

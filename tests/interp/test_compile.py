"""The compiled generator against a naive loop in plain Python, and its gradients against differences."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from p3i.grammar.ast import Affine, CameraPose, Coordinate, Draw, For, Header, If, Polar, Program
from p3i.grammar.parse_error import ParseError
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.size import Size

torch.set_num_threads(1)
# torch.func.jacfwd loads decompositions that torch itself still scripts.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit.script` is deprecated:DeprecationWarning")

numbers = st.floats(-50, 50).map(lambda value: round(value, 3)) | st.sampled_from([0.0, 1, -1, 30])


@st.composite
def affines(draw: st.DrawFn, variables: str) -> Affine:
    return Affine(
        draw(numbers) if "i" in variables else 0, draw(numbers) if "j" in variables else 0, draw(numbers)
    )


@st.composite
def coordinates(draw: st.DrawFn, variables: str, polar: bool | None = None) -> Coordinate:
    if polar is False or (polar is None and draw(st.booleans())):
        return draw(affines(variables))
    parts = [draw(affines(variables)) for _ in range(3)]
    return Polar(draw(st.sampled_from(["Cos", "Sin"])), *parts)


@st.composite
def programs(draw: st.DrawFn) -> Program:
    """Programs of all shapes: no loop, one, two, a ring whose bounds read an unbound i; up to two guards."""
    loops = draw(st.sampled_from(["", "i", "j", "ij", "ring"]))
    variables = "ij" if loops == "ring" else loops
    polar = True if loops == "ring" else None
    body = Draw(draw(coordinates(variables, polar)), draw(coordinates(variables, polar)))
    for _ in range(draw(st.integers(0, 2))):
        body = If(draw(affines(variables)), body)
    small = st.integers(-3, 6)
    if "j" in loops or loops == "ring":
        slope = draw(st.floats(-2, 2)) if "i" in variables else 0.0
        start, stop = sorted((draw(st.floats(-4, 6)), draw(st.floats(-4, 6))))
        body = For("j", Affine(constant=start), Affine(i=slope, constant=stop), body)
    if "i" in loops and loops != "ring":
        body = For("i", Affine(constant=draw(small)), Affine(constant=draw(small)), body)
    return Program(CameraPose(draw(st.floats(-60, 60)), draw(st.floats(-60, 60))), body)


def naive(program: Program) -> list[tuple[float, float, int, int]]:
    """The meaning of a program, spelled out once more, with nothing of p3i.interp."""
    drawn = []

    def value(affine: Affine, i: float, j: float) -> float:
        return affine.i * i + affine.j * j + affine.constant

    def coordinate(form: Coordinate, i: float, j: float) -> float:
        if isinstance(form, Affine):
            return value(form, i, j)
        angle = value(form.angle, i, j) * math.pi / 180
        turn = math.cos(angle) if form.function == "Cos" else math.sin(angle)
        return value(form.radius, i, j) * turn + value(form.offset, i, j)

    def walk(statement, i: int, j: int) -> None:
        if isinstance(statement, Draw):
            drawn.append((coordinate(statement.x, i, j), coordinate(statement.y, i, j), i, j))
        elif isinstance(statement, If):
            if value(statement.guard, i, j) >= -1e-9:
                walk(statement.body, i, j)
        else:
            k = math.ceil(value(statement.start, i, j) - 1e-9)
            while k < math.ceil(value(statement.stop, i, j) - 1e-9):
                walk(statement.body, *((k, j) if statement.variable == "i" else (i, k)))
                k += 1

    world = program.world
    ring = isinstance(world, For) and world.variable == "j"
    inner = world
    while not isinstance(inner, Draw):
        inner = inner.body
    both_polar = isinstance(inner.x, Polar) and isinstance(inner.y, Polar)
    walk(world, 1 if ring and both_polar else 0, 0)
    return drawn


TRIANGLE = Program(
    CameraPose(-42, -15),
    For("i", Affine(), Affine(constant=4),
        For("j", Affine(), Affine(constant=4),
            If(Affine(1, 1, -3), Draw(Affine(18.7, 9.7, -57), Affine(0, 19.7, -31))))),
)  # fmt: skip
"""The first figure of the paper."""

RINGS = Program(
    CameraPose(20, 10),
    For("i", Affine(constant=1), Affine(constant=4),
        For("j", Affine(), Affine(constant=12),
            Draw(Polar("Cos", Affine(8, 0, 2), Affine(5, 30, 0), Affine()),
                 Polar("Sin", Affine(8, 0, 2), Affine(5, 30, 0), Affine())))),
)  # fmt: skip


@settings(deadline=None)
@given(programs())
def test_the_points_equal_those_of_a_naive_loop(program: Program) -> None:
    expected = np.array(naive(program), dtype=float).reshape(-1, 4)
    pattern = compile(program)
    assert pattern.index.tolist() == expected[:, 2:].tolist()
    np.testing.assert_allclose(pattern.centers().numpy(), expected[:, :2], rtol=1e-11, atol=1e-9)


@settings(deadline=None)
@given(programs())
def test_the_edges_join_each_point_to_its_successors_once(program: Program) -> None:
    pattern = compile(program)
    live = [tuple(index) for index in pattern.index.tolist()]
    joined = [tuple(sorted((live[a], live[b]))) for a, b in pattern.edges.tolist()]
    expected = {
        tuple(sorted(((i, j), (i + di, j + dj))))
        for i, j in live for di, dj in ((1, 0), (0, 1)) if (i + di, j + dj) in live
    }  # fmt: skip
    assert len(joined) == len(expected)
    assert set(joined) == expected


@settings(deadline=None)
@given(programs())
def test_theta_holds_the_camera_and_every_number_of_the_draw(program: Program) -> None:
    pattern = compile(program)
    assert pattern.paths[:2] == ("camera.rx", "camera.ry")
    assert all(path.startswith(("camera.", "draw.")) for path in pattern.paths)
    assert pattern.at(pattern.theta) == program
    moved = pattern.at(pattern.theta + 0.5)
    assert compile(moved).theta.tolist() == pytest.approx((pattern.theta + 0.5).tolist())


@settings(deadline=None)
@given(programs(), st.lists(st.floats(-1, 1), min_size=20, max_size=20))
def test_moving_theta_equals_compiling_the_moved_program(program: Program, steps: list[float]) -> None:
    pattern = compile(program)
    theta = pattern.theta + torch.tensor(steps, dtype=torch.float64)[: len(pattern.paths)]
    again = compile(pattern.at(theta))
    np.testing.assert_allclose(pattern.centers(theta).numpy(), again.centers().numpy(), atol=1e-9)
    size = Size(640, 480)
    there, here = again.image_from_plane(size=size), pattern.image_from_plane(theta, size=size)
    np.testing.assert_allclose(here.numpy(), there.numpy(), atol=1e-9)


@pytest.mark.parametrize("program", [TRIANGLE, RINGS], ids=["triangle", "rings"])
def test_a_batch_of_thetas_gives_what_each_gives_alone(program: Program) -> None:
    pattern = compile(program)
    generator = torch.Generator().manual_seed(0)
    theta = pattern.theta + torch.randn(2, 3, len(pattern.paths), generator=generator, dtype=torch.float64)
    batch = pattern.centers(theta)
    assert batch.shape == (2, 3, len(pattern.index), 2)
    np.testing.assert_allclose(batch[1, 2].numpy(), pattern.centers(theta[1, 2]).numpy(), atol=1e-12)
    pixels, in_front = pattern.centers_px(theta, size=Size(64, 48))
    assert pixels.shape == batch.shape and in_front.shape == batch.shape[:-1]
    mapped = torch.func.vmap(pattern.centers)(theta[1])
    np.testing.assert_allclose(mapped.numpy(), batch[1].numpy(), atol=1e-12)


@pytest.mark.parametrize("program", [TRIANGLE, RINGS], ids=["triangle", "rings"])
def test_gradients_equal_finite_differences(program: Program) -> None:
    pattern = compile(program)

    def pixels(theta: torch.Tensor) -> torch.Tensor:
        return pattern.centers_px(theta, size=Size(64, 48))[0]

    theta = pattern.theta.clone().requires_grad_()
    assert torch.autograd.gradcheck(pattern.centers, (theta,))
    assert torch.autograd.gradcheck(pixels, (theta,))
    jacobian = torch.func.jacfwd(pixels)(pattern.theta)
    assert jacobian.shape == (len(pattern.index), 2, len(pattern.paths))
    step = 1e-5
    for k in range(len(pattern.paths)):
        shift = torch.zeros_like(pattern.theta)
        shift[k] = step
        slope = (pixels(pattern.theta + shift) - pixels(pattern.theta - shift)) / (2 * step)
        np.testing.assert_allclose(jacobian[..., k].numpy(), slope.numpy(), rtol=1e-5, atol=1e-5)
    batched = torch.func.vmap(torch.func.jacfwd(pixels))(pattern.theta.expand(3, -1))
    np.testing.assert_allclose(batched[2].numpy(), jacobian.numpy(), atol=1e-9)


def test_an_unbound_i_reads_as_1_under_a_ring() -> None:
    ring = For(
        "j", Affine(), Affine(i=6),
        Draw(Polar("Cos", Affine(i=20), Affine(j=60), Affine()),
             Polar("Sin", Affine(i=20), Affine(j=60), Affine())),
    )  # fmt: skip
    pattern = compile(Program(CameraPose(), ring))
    assert pattern.index.tolist() == [[1, j] for j in range(6)]
    np.testing.assert_allclose(pattern.centers().norm(dim=1).numpy(), 20)


def test_a_radius_of_zero_still_has_a_gradient() -> None:
    spot = Draw(Polar("Cos", Affine(), Affine(constant=60), Affine()), Affine())
    pattern = compile(Program(CameraPose(), spot))
    slope = torch.func.jacfwd(pattern.centers)(pattern.theta)
    assert pattern.centers().tolist() == [[0, 0]]
    assert float(slope[0, 0, pattern.paths.index("draw.x.radius.1")]) == pytest.approx(0.5)
    assert float(slope[0, 0, pattern.paths.index("draw.x.angle.1")]) == 0


def test_points_between_the_draws_can_be_asked_for() -> None:
    pattern = compile(TRIANGLE)
    between = pattern.points_at(torch.tensor([[0.5, 2.5]]))
    np.testing.assert_allclose(between.numpy(), [[18.7 * 0.5 + 9.7 * 2.5 - 57, 19.7 * 2.5 - 31]])


def test_a_program_that_draws_nothing_has_no_points_and_no_edges() -> None:
    nothing = For("i", Affine(), Affine(), Draw(Affine(i=1), Affine()))
    pattern = compile(Program(CameraPose(), nothing))
    assert pattern.index.shape == (0, 2) and pattern.edges.shape == (0, 2)
    assert pattern.centers(pattern.theta.expand(4, -1)).shape == (4, 0, 2)


def test_the_header_gives_the_focal_unless_the_caller_does() -> None:
    program = Program(TRIANGLE.camera, TRIANGLE.world, header=Header(focal_mm=50))
    size = Size(64, 48)
    pattern = compile(program)
    for focal_mm in (None, 50):
        found = pattern.image_from_plane(size=size, focal_mm=focal_mm)
        np.testing.assert_array_equal(found.numpy(), Camera(-42, -15, 50).image_from_plane(size).numpy())


def test_a_bomb_is_refused_by_name() -> None:
    bomb = For("i", Affine(), Affine(constant=10**9), Draw(Affine(i=1), Affine()))
    with pytest.raises(ParseError, match="1,000,000"):
        compile(Program(CameraPose(), bomb))

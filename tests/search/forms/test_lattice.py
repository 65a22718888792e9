"""Lattices as programs: one basis for equal lattices, and the cells that a picture shows."""

import itertools

import numpy as np
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from truth import PATTERN, SMALL, blank_level

from p3i.grammar.ast import Program
from p3i.interp.camera import image_from_plane, project
from p3i.search.forms.lattice import Lattice, cell_px, cells_in_view, map_from_index, reduce_basis

lengths = st.floats(1, 60)
turns = st.floats(0, 360)


@st.composite
def bases(draw: st.DrawFn) -> np.ndarray:
    """Two steps that are neither parallel nor of wildly different length."""
    turn, across = np.radians(draw(turns)), np.radians(draw(st.floats(10, 170)))
    first, second = draw(lengths), draw(lengths)
    return np.array(
        [
            [first * np.cos(turn), first * np.sin(turn)],
            [second * np.cos(turn + across), second * np.sin(turn + across)],
        ]
    )


@st.composite
def changes(draw: st.DrawFn) -> np.ndarray:
    """A whole matrix of determinant 1 or -1."""
    matrix = np.eye(2)
    for _ in range(draw(st.integers(0, 4))):
        times = draw(st.integers(-3, 3))
        step = draw(st.sampled_from([[[1, times], [0, 1]], [[1, 0], [times, 1]], [[0, 1], [1, 0]]]))
        matrix = matrix @ np.array(step, float)
    return matrix


def far_from_a_tie(basis: np.ndarray) -> bool:
    """Whether one basis of the lattice is shortest, and one of its steps the more horizontal."""
    u, v = reduce_basis(basis)
    length_u, length_v = np.linalg.norm(u), np.linalg.norm(v)
    short = min(length_u, length_v)
    return (
        abs(length_u - length_v) > 1e-3 * short
        and abs(abs(u @ v) / short**2 - 0.5) > 1e-3
        and abs(abs(u[0]) / length_u - abs(v[0]) / length_v) > 1e-3
    )


@settings(max_examples=50, deadline=None)
@given(bases())
def test_the_reduced_basis_spans_the_same_lattice(basis: np.ndarray) -> None:
    ratio = reduce_basis(basis) @ np.linalg.inv(basis)
    np.testing.assert_allclose(ratio, np.round(ratio), atol=1e-6)
    assert round(abs(np.linalg.det(ratio))) == 1


@settings(max_examples=50, deadline=None)
@given(bases())
def test_no_step_of_the_lattice_is_shorter_than_the_reduced_ones(basis: np.ndarray) -> None:
    u, v = reduce_basis(basis)
    short, long = sorted((np.linalg.norm(u), np.linalg.norm(v)))
    assert abs(u @ v) <= 0.5 * short**2 * (1 + 1e-9)
    for a, b in itertools.product(range(-2, 3), repeat=2):
        length = np.linalg.norm(a * u + b * v)
        assert (a, b) == (0, 0) or length >= short * (1 - 1e-9)
        # Only multiples of the shortest step are shorter than the second.
        shortest = u if np.linalg.norm(u) <= np.linalg.norm(v) else v
        parallel = abs(np.linalg.det([a * u + b * v, shortest])) < 1e-6 * short * long
        assert parallel or length >= long * (1 - 1e-9)


@settings(max_examples=50, deadline=None)
@given(bases())
def test_u_is_the_more_horizontal_and_points_right_and_v_turns_down_from_it(basis: np.ndarray) -> None:
    u, v = reduce_basis(basis)
    assert abs(u[0]) / np.linalg.norm(u) >= abs(v[0]) / np.linalg.norm(v) - 1e-12
    assert u[0] >= 0
    assert np.linalg.det([u, v]) > 0


@settings(max_examples=50, deadline=None)
@given(bases())
def test_reducing_twice_changes_nothing(basis: np.ndarray) -> None:
    once = reduce_basis(basis)
    assert far_from_a_tie(basis) is False or np.array_equal(reduce_basis(once), once)


@settings(max_examples=50, deadline=None)
@given(bases(), changes())
def test_equal_lattices_get_the_same_basis(basis: np.ndarray, change: np.ndarray) -> None:
    assume(far_from_a_tie(basis))
    np.testing.assert_allclose(reduce_basis(change @ basis), reduce_basis(basis), rtol=1e-6, atol=1e-6)


poses = st.tuples(st.floats(-55, 55), st.floats(-40, 40))


@st.composite
def lattices(draw: st.DrawFn) -> Lattice:
    rx_deg, ry_deg = draw(poses)
    basis = reduce_basis(draw(bases()))
    origin = np.array([draw(st.floats(-30, 30)), draw(st.floats(-30, 30))])
    return Lattice(rx_deg, ry_deg, basis, origin)


@settings(max_examples=50, deadline=None)
@given(lattices())
def test_a_lattice_comes_back_from_its_numbers(lattice: Lattice) -> None:
    again = Lattice.of(PATTERN, lattice.theta(PATTERN))
    assert (again.rx_deg, again.ry_deg) == (lattice.rx_deg, lattice.ry_deg)
    assert np.array_equal(again.basis, lattice.basis) and np.array_equal(again.origin, lattice.origin)
    assert isinstance(PATTERN.at(lattice.theta(PATTERN)), Program)


@settings(max_examples=50, deadline=None)
@given(lattices(), st.integers(-5, 5), st.integers(-5, 5))
def test_moving_the_origin_by_whole_steps_only_renumbers(lattice: Lattice, i: int, j: int) -> None:
    moved = lattice.moved_to(np.array([i, j]))
    here = PATTERN.points_at(torch.tensor([[i + 2, j - 1]]), lattice.theta(PATTERN))
    there = PATTERN.points_at(torch.tensor([[2, -1]]), moved.theta(PATTERN))
    np.testing.assert_allclose(here, there, atol=1e-9)


def naive_cells(lattice: Lattice, *, least_px: float, reach: int = 60) -> dict[tuple[int, int], float]:
    """The cells whose four corners lie in the picture, and their area in map pixels, one by one."""
    level, theta = blank_level(), lattice.theta(PATTERN)
    matrix = level.map_from_photo @ image_from_plane(
        lattice.rx_deg, lattice.ry_deg, size=SMALL, focal_mm=level.focal_mm
    )
    index = torch.cartesian_prod(*[torch.arange(-reach, reach + 1, dtype=torch.float64)] * 2)
    inside, outline = torch.ones(len(index), dtype=torch.bool), []
    for corner in ([-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]):
        points, front = project(matrix, PATTERN.points_at(index + torch.tensor(corner), theta))
        limits = torch.tensor([level.size.width - 0.5, level.size.height - 0.5])
        inside &= front & (points >= -0.5).all(1) & (points <= limits).all(1)
        outline.append(points)
    found = {}
    for place in inside.nonzero()[:, 0].tolist():
        polygon = [tuple(points[place].tolist()) for points in outline]
        twice = sum(
            a[0] * b[1] - a[1] * b[0] for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True)
        )
        if abs(twice) / 2 > least_px**2:
            found[(int(index[place, 0]), int(index[place, 1]))] = abs(twice) / 2
    return found


@settings(max_examples=40, deadline=None)
@given(lattices(), st.sampled_from([4.0, 8.0]))
def test_the_cells_in_view_are_those_whose_corners_are(lattice: Lattice, least_px: float) -> None:
    assume(np.linalg.norm(lattice.basis, axis=1).min() > 6)
    expected = naive_cells(lattice, least_px=least_px)
    # How small cells are is looked up on a grid over the picture: at the limit one may be missed.
    sure = {cell for cell, area in expected.items() if area > 1.1 * least_px**2}
    found = cells_in_view(
        blank_level(), PATTERN, lattice.theta(PATTERN), least_px=least_px, most=10_000, cut=False
    )
    assert sure <= {(int(i), int(j)) for i, j in found.tolist()} <= expected.keys()


def test_where_few_cells_are_whole_those_that_half_show_are_taken_too() -> None:
    lattice = Lattice(0.0, 0.0, np.array([[30.0, 0.0], [0.0, 30.0]]), np.zeros(2))
    theta = lattice.theta(PATTERN)
    whole = cells_in_view(blank_level(), PATTERN, theta, cut=False).tolist()
    # 100 x 75 units show: 1.17 cells to each side of the middle one across, 0.75 up and down.
    assert whole == [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]
    every = cells_in_view(blank_level(), PATTERN, theta).tolist()
    assert every == [[float(i), float(j)] for i in (-1, 0, 1) for j in (-1, 0, 1)]


def test_cells_that_the_frame_cuts_are_taken_where_they_are_asked_for() -> None:
    lattice = Lattice(0.0, 0.0, np.array([[10.0, 0.0], [0.0, 10.0]]), np.zeros(2))
    theta = lattice.theta(PATTERN)
    for cut, across in ((None, 4), (False, 4), (True, 5)):  # 100 units: half of the fifth cell shows
        cells = cells_in_view(blank_level(), PATTERN, theta, cut=cut)
        assert cells[:, 0].abs().max() == across


def test_of_too_many_cells_those_around_a_cell_stay() -> None:
    lattice = Lattice(-45.0, 10.0, np.array([[4.0, 0.5], [-0.5, 4.0]]), np.zeros(2))
    around = torch.tensor([3.0, -8.0], dtype=torch.float64)
    found = cells_in_view(blank_level(), PATTERN, lattice.theta(PATTERN), most=40, around=around)
    assert len(found) == 40
    assert float((found - around).norm(dim=1).max()) < 5


def test_of_too_many_cells_the_largest_stay_in_order() -> None:
    lattice = Lattice(-45.0, 10.0, np.array([[4.0, 0.5], [-0.5, 4.0]]), np.zeros(2))
    areas = naive_cells(lattice, least_px=4.0)
    found = [
        tuple(cell)
        for cell in cells_in_view(blank_level(), PATTERN, lattice.theta(PATTERN), most=40).tolist()
    ]
    assert len(areas) > 80 and len(found) == 40
    assert found == sorted(found)
    assert min(areas[i, j] for i, j in found) >= sorted(areas.values())[-40] * (1 - 1e-9)


@settings(max_examples=50, deadline=None)
@given(lattices())
def test_the_homography_of_the_index_goes_where_the_program_draws(lattice: Lattice) -> None:
    level, theta = blank_level(), lattice.theta(PATTERN)
    index = torch.tensor([[0.0, 0.0], [1.5, -0.5]], dtype=torch.float64)
    points, front = project(level.map_from_plane(PATTERN, theta), PATTERN.points_at(index, theta))
    moved = np.c_[index.numpy(), np.ones(2)] @ map_from_index(level, PATTERN, theta).T
    assume(bool(front.all()))
    np.testing.assert_allclose(moved[:, :2] / moved[:, 2:], points, rtol=1e-6, atol=1e-6)


def test_the_side_of_a_cell_is_in_photo_pixels_whatever_the_map() -> None:
    lattice = Lattice(0.0, 0.0, np.array([[6.0, 0.0], [0.0, 8.0]]), np.zeros(2))
    for map_scale in (0.5, 1.0):
        side = cell_px(blank_level(map_scale=map_scale), PATTERN, lattice.theta(PATTERN))
        np.testing.assert_allclose(side, np.sqrt(48) * SMALL.unit_px, rtol=1e-6)

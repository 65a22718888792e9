"""The rows that a person would choose, and that whatever is chosen the same objects are drawn."""

import cv2
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from p3i.interp.unroll import points
from p3i.search.extent.outline import Cells
from p3i.search.extent.rows import bases_with_rows, in_rows
from p3i.search.forms.lattice import Lattice, reduce_basis
from p3i.search.forms.layout import Layout
from p3i.search.look.edges import edge_directions

QUICK = (Phase.explicit, Phase.reuse, Phase.generate)
NO_LINES = np.zeros(180)
SURE = 40.0
"""Nats of a cell that is beyond doubt, so that outlines are exact."""


def lines_along(*angles_deg: int) -> np.ndarray:
    return np.bincount(angles_deg, minlength=180) / len(angles_deg)


def lattice_of(basis: list[list[float]]) -> Lattice:
    return Lattice(0.0, 0.0, reduce_basis(np.array(basis)), np.zeros(2))


def cells_where(lattice: Lattice, holds, *, reach: int = 10, seen=lambda x, y: True) -> Cells:
    """Cells that are surely there, or surely not, by where their middle lies; 0 where they are not seen."""
    odds = np.zeros((2 * reach + 1, 2 * reach + 1))
    for j in range(-reach, reach + 1):
        for i in range(-reach, reach + 1):
            x, y = lattice.origin + np.array([i, j]) @ lattice.basis
            odds[j + reach, i + reach] = (SURE if holds(x, y) else -SURE) if seen(x, y) else 0.0
    return Cells(odds, odds != 0, odds > 0, (-reach, -reach))


def draws(layout: Layout, cells: Cells, lattice: Lattice) -> bool:
    """Whether a layout draws the cells that surely hold an object, and no others."""
    j, i = np.nonzero(cells.bits > 0)
    at = (np.stack([i, j], 1) + cells.first) @ lattice.basis
    drawn = np.array([place[:2] for place in points(layout.program())])
    apart = np.linalg.norm(drawn[:, None] - at[None], axis=2)
    return len(drawn) == len(at) and bool((apart.min(0) < 0.01).all())


def box(width: float, height: float):
    return lambda x, y: abs(x) <= width / 2 and abs(y) <= height / 2


@st.composite
def bases(draw: st.DrawFn) -> np.ndarray:
    turn, across = (np.radians(draw(st.floats(*span))) for span in ((0, 360), (35, 145)))
    first, second = draw(st.floats(4, 20)), draw(st.floats(4, 20))
    return reduce_basis(
        np.array(
            [
                [first * np.cos(turn), first * np.sin(turn)],
                [second * np.cos(turn + across), second * np.sin(turn + across)],
            ]
        )
    )


@settings(max_examples=50, deadline=None)
@given(bases())
def test_every_basis_that_is_looked_at_is_one_of_the_lattice_and_its_own_comes_first(basis) -> None:
    found = bases_with_rows(basis)
    assert found[0].tolist() == [[1, 0], [0, 1]]
    assert all(abs(round(np.linalg.det(change))) == 1 for change in found)
    assert all(np.linalg.det(change @ basis) > 0 for change in found[1:])


@settings(max_examples=8, deadline=None, phases=QUICK)
@given(bases(), st.integers(0, 7), st.integers(2, 3), st.integers(2, 3), st.integers(0, 179))
def test_whatever_rows_are_chosen_the_same_objects_are_drawn(basis, which, across, down, line) -> None:
    """The objects fill ranges of one basis or another, all in view."""
    lattice = Lattice(0.0, 0.0, basis, np.zeros(2))
    changes = bases_with_rows(basis)
    back = np.linalg.inv(changes[which % len(changes)])

    def holds(x: float, y: float) -> bool:
        i, j = np.round(np.array([x, y]) @ np.linalg.inv(basis) @ back)
        return 0 <= i < across and 0 <= j < down

    cells = cells_where(lattice, holds)
    found = in_rows(cells, lattice, edges=lines_along(line), unit_px=6.4)
    assert found is not None
    assert draws(found[0], cells, lattice)


@settings(max_examples=5, deadline=None, phases=QUICK)
@given(bases(), st.integers(0, 179))
def test_rows_once_chosen_are_chosen_again(basis, line) -> None:
    lattice = Lattice(0.0, 0.0, basis, np.zeros(2))
    cells = cells_where(lattice, box(60, 40), seen=box(60, 40))
    first = in_rows(cells, lattice, edges=lines_along(line), unit_px=6.4)
    assert first is not None
    chosen = first[0].lattice
    again = in_rows(
        cells_where(chosen, box(60, 40), seen=box(60, 40)), chosen, edges=lines_along(line), unit_px=6.4
    )
    assert again is not None
    np.testing.assert_allclose(again[0].lattice.basis, chosen.basis)


def test_rows_of_bricks_are_rows_though_the_diagonals_are_shorter() -> None:
    lattice = lattice_of([[9, 0.1], [4.6, 3.2]])
    assert np.linalg.norm(lattice.basis, axis=1).max() < 6
    found = in_rows(
        cells_where(lattice, box(80, 60), seen=box(80, 60)),
        lattice,
        edges=lines_along(0, 0, 1, 90),
        unit_px=6.4,
    )
    assert found is not None
    np.testing.assert_allclose(np.abs(found[0].lattice.basis), [[9, 0.1], [4.5, 3.2]], atol=0.2)
    assert found[1] == ""


def test_rows_of_bricks_four_times_as_wide_as_high_are_rows() -> None:
    lattice = lattice_of([[16, 0.3], [8.3, 4.2]])
    found = in_rows(
        cells_where(lattice, box(80, 60), seen=box(80, 60)),
        lattice,
        edges=lines_along(1, 1, 1, 90),
        unit_px=6.4,
    )
    assert found is not None
    assert abs(found[0].lattice.basis[0, 0]) == 16


def test_the_fields_of_a_chessboard_are_told_along_its_sides() -> None:
    lattice = lattice_of([[5, -5.1], [5, 5]])
    found = in_rows(cells_where(lattice, box(72, 72)), lattice, edges=lines_along(0, 90), unit_px=6.4)
    assert found is not None
    layout = found[0]
    assert min(abs(layout.lattice.basis[:, 0]).min(), abs(layout.lattice.basis[:, 1]).min()) < 0.2
    assert draws(layout, cells_where(lattice, box(72, 72)), lattice)
    assert len(layout.guards) == 2


def test_asymmetric_circles_are_staggered_rows_since_these_say_the_outline() -> None:
    lattice = lattice_of([[5, -5.1], [5, 5]])
    cells = cells_where(lattice, lambda x, y: -1 < x < 29 and -1 < y < 29)
    found = in_rows(cells, lattice, edges=NO_LINES, unit_px=6.4)
    assert found is not None
    assert draws(found[0], cells, lattice)
    assert len(found[0].guards) <= 2


def test_a_keyboard_stays_in_its_rows() -> None:
    lattice = lattice_of([[9, 0.2], [2.2, 9]])
    found = in_rows(cells_where(lattice, box(90, 36)), lattice, edges=lines_along(1, 91), unit_px=6.4)
    assert found is not None
    np.testing.assert_array_equal(found[0].lattice.basis, lattice.basis)


@pytest.mark.parametrize("turn_deg", [0, 17, 38])
def test_a_lattice_without_a_reason_keeps_its_shortest_steps(turn_deg: float) -> None:
    turn = np.radians(turn_deg)
    lattice = lattice_of([[9 * np.cos(turn), 9 * np.sin(turn)], [-8 * np.sin(turn), 8 * np.cos(turn)]])
    cells = cells_where(lattice, box(100, 70), seen=box(100, 70))
    found = in_rows(cells, lattice, edges=NO_LINES, unit_px=6.4)
    assert found is not None
    np.testing.assert_array_equal(found[0].lattice.basis, lattice.basis)


def test_of_a_honeycombs_rows_the_level_ones_are_taken_and_the_others_told() -> None:
    lattice = lattice_of([[5.4, 9.37], [-5.4, 9.37]])
    turned = lattice.with_basis(lattice.basis @ np.array([[1, 0.02], [-0.02, 1]]))
    seen = box(100, 70)
    found = in_rows(cells_where(turned, seen, seen=seen), turned, edges=NO_LINES, unit_px=6.4)
    assert found is not None
    assert abs(found[0].lattice.basis[0, 1]) < 0.03 * abs(found[0].lattice.basis[0, 0])


@pytest.mark.parametrize("turn_deg", [0, 25, 80])
def test_lines_are_told_in_degrees_of_the_plane(turn_deg: int) -> None:
    """Stripes on a plane that leans back: on the photo they run otherwise."""
    x, y = np.meshgrid(np.arange(160.0), np.arange(120.0))
    matrix = np.array([[1.0, 0.2, 80], [0.05, 0.8, 60], [0.0004, 0.002, 1]])
    at = np.linalg.inv(matrix) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    across = np.radians(turn_deg + 90)
    waves = np.cos((at[0] * np.cos(across) + at[1] * np.sin(across)) / at[2] / 2.5).reshape(x.shape)
    pixels = np.repeat((0.5 + 0.3 * waves)[..., None], 3, axis=2).astype(np.float32)
    pixels = cv2.GaussianBlur(pixels, (0, 0), 0.5)
    edges = edge_directions(pixels, matrix, np.ones(x.shape, bool))
    near = (turn_deg + np.arange(-3, 4)) % 180
    assert edges[near].sum() > 0.9
    assert edges.sum() == pytest.approx(1)

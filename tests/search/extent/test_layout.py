"""From a fit to a program: the text draws the layout's cells, and Table 1 holds where it is asked for."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import PATTERN, evidence_of, index_in, lattice_of, small_scene, true_theta

from p3i.evaluation.lattice_scenes import lattice_scene
from p3i.grammar.departures import departures
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera, project
from p3i.interp.unroll import points
from p3i.search.extent.layout import filling_layout, found_layout, layout_fit, refitted, strict_layout
from p3i.search.forms.lattice import Lattice
from p3i.search.forms.layout import Layout

whole = st.integers(-6, 6)
guards = st.tuples(st.integers(-3, 3), st.integers(-3, 3), whole).filter(lambda guard: guard[:2] != (0, 0))


def rounded(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 3))


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    basis = np.array(
        [[draw(rounded(3, 20)), draw(rounded(-2, 2))], [draw(rounded(-2, 2)), draw(rounded(3, 20))]]
    )
    origin = np.array([draw(rounded(-40, 40)), draw(rounded(-40, 40))])
    lattice = Lattice(draw(rounded(-60, 60)), draw(rounded(-60, 60)), basis, origin)
    i0, j0 = draw(whole), draw(whole)
    return Layout(
        lattice,
        (i0, i0 + draw(st.integers(1, 8))),
        (j0, j0 + draw(st.integers(1, 8))),
        tuple(draw(st.lists(guards, max_size=3))),
    )


def cells_of(layout: Layout) -> list[tuple[int, int]]:
    """The cells of a layout by its definition."""
    return [
        (i, j)
        for i in range(*layout.i_range)
        for j in range(*layout.j_range)
        if all(a * i + b * j >= c for a, b, c in layout.guards)
    ]


@settings(max_examples=80, deadline=None)
@given(layouts())
def test_the_program_draws_the_cells_of_the_layout_in_order_and_no_others(layout: Layout) -> None:
    expected = [layout.lattice.origin + np.array(cell) @ layout.lattice.basis for cell in cells_of(layout)]
    drawn = [(x, y) for x, y, _, _ in points(layout.program())]
    assert len(drawn) == len(expected)
    if drawn:
        np.testing.assert_allclose(drawn, expected, atol=2e-3)  # ten-thousandths of a unit, some steps far


@settings(max_examples=80, deadline=None)
@given(layouts())
def test_the_program_of_a_layout_reads_back_from_its_text(layout: Layout) -> None:
    program = layout.program()
    assert parse(format_program(program)) == program
    assert (program.camera.rx_deg, program.camera.ry_deg) == (layout.lattice.rx_deg, layout.lattice.ry_deg)


@settings(max_examples=80, deadline=None)
@given(layouts())
def test_a_strict_layout_is_a_program_of_table_1_close_by(layout: Layout) -> None:
    strict, moved = strict_layout(layout)
    program = strict.program(from_zero=False)
    assert departures(program) == ()
    # Table 1 to the letter: the text reads back under the strict grammar.
    assert parse(format_program(program, layout="table1"), strict=True) == program
    assert np.array_equal(strict.lattice.origin, np.zeros(2))
    # The nearest point of the lattice fell on the origin, so it moved by no more than half a cell.
    longest = np.linalg.norm(layout.lattice.basis, axis=1).sum() / 2
    assert 0 <= moved <= longest + 1e-9
    if not layout.guards:
        expected = np.array(
            [layout.lattice.origin + np.array(c) @ layout.lattice.basis for c in cells_of(layout)]
        )
        drawn = np.array([(x, y) for x, y, _, _ in points(program)])
        assert drawn.shape == expected.shape
        np.testing.assert_allclose(np.linalg.norm(drawn - expected, axis=1), moved, atol=2e-3)


@settings(max_examples=60, deadline=None)
@given(layouts())
def test_a_strict_layout_loses_no_object(layout: Layout) -> None:
    strict, _ = strict_layout(layout)
    assert len(cells_of(strict)) >= len(cells_of(layout))


def true_layout(seed: int) -> Layout:
    scene = small_scene(seed)
    index = index_in(scene).int()
    low, high = index.min(0).values.tolist(), index.max(0).values.tolist()
    lattice = Lattice.of(PATTERN, true_theta(scene))
    return Layout(lattice, (low[0], high[0] + 1), (low[1], high[1] + 1))


def test_a_filling_layout_covers_the_picture() -> None:
    scene = small_scene(14)
    middle = Layout(true_layout(14).lattice, (0, 1), (0, 1))
    filling = filling_layout(evidence_of(scene), middle)
    assert filling.guards == ()
    size = scene.size
    index = torch.cartesian_prod(*[torch.arange(-15, 16, dtype=torch.float64)] * 2)
    plane = PATTERN.points_at(index, middle.lattice.theta(PATTERN))
    pixels, front = project(scene.camera.image_from_plane(size), plane)
    seen = front & ((pixels >= 0) & (pixels <= torch.tensor([size.width - 1, size.height - 1]))).all(1)
    assert int(seen.sum()) > 40
    assert {(i, j) for i, j in index[seen].int().tolist()} <= set(cells_of(filling))
    # No row or column more than those that some object in the picture needs.
    low, high = index[seen].min(0).values.tolist(), index[seen].max(0).values.tolist()
    assert (filling.i_range, filling.j_range) == ((low[0], high[0] + 1), (low[1], high[1] + 1))


@pytest.mark.parametrize("seed", [14, 18])
def test_the_layout_of_the_truth_is_the_truth(seed: int) -> None:
    """Phase and extent from the photo, given camera, basis and ground, with the origin between objects."""
    scene = small_scene(seed)
    ground = torch.from_numpy(scene.index).double()
    off = lattice_of(scene.program).moved_to(np.array([0.3, -0.2]))
    found = found_layout(evidence_of(scene), off, ground)
    assert found is not None
    layout, _ = found
    drawn = np.array([(x, y) for x, y, _, _ in points(layout.program())])
    seen, _ = project(scene.camera.image_from_plane(scene.size), torch.from_numpy(drawn))
    apart = np.linalg.norm(scene.centers_px[:, None] - seen.numpy()[None], axis=2)
    step = np.linalg.norm(scene.centers_px[:, None] - scene.centers_px[None], axis=2)
    step = np.where(step > 0, step, np.inf).min(1)
    assert np.median(apart.min(1) / step) < 0.1
    inside = ((seen >= 0) & (seen <= torch.tensor([scene.size.width - 1, scene.size.height - 1]))).all(1)
    assert abs(int(inside.sum()) - len(scene.index)) <= 0.1 * len(scene.index)


def test_the_true_layout_explains_the_photo_and_a_shifted_basis_does_not() -> None:
    scene, layout = small_scene(14), true_layout(14)
    true_fit = layout_fit(evidence_of(scene), layout)
    wrong = layout.lattice.with_basis(layout.lattice.basis * 1.3)
    wrong_fit = layout_fit(evidence_of(scene), Layout(wrong, layout.i_range, layout.j_range))
    assert true_fit is not None and float(true_fit.contrast.mean()) > 0.5
    assert wrong_fit is None or wrong_fit.covered < 0.1 * true_fit.covered


def test_fewer_than_four_objects_are_no_pattern() -> None:
    layout = Layout(true_layout(14).lattice, (0, 3), (0, 1))
    assert layout_fit(evidence_of(small_scene(14)), layout) is None


def test_the_last_fit_moves_a_layout_back_onto_its_objects() -> None:
    scene, layout = small_scene(14), true_layout(14)
    off = Lattice(
        layout.lattice.rx_deg + 1.0, layout.lattice.ry_deg - 0.5, layout.lattice.basis, layout.lattice.origin
    )
    found = refitted(evidence_of(scene), Layout(off, layout.i_range, layout.j_range, ((1, 1, -99),)))
    assert abs(found.lattice.rx_deg - layout.lattice.rx_deg) < 0.5
    assert abs(found.lattice.ry_deg - layout.lattice.ry_deg) < 0.5
    assert (found.i_range, found.j_range, found.guards) == (layout.i_range, layout.j_range, ((1, 1, -99),))


@pytest.mark.parametrize("seed", [40, 44])
def test_objects_that_the_frame_cuts_tell_the_pose_too(seed: int) -> None:
    """Objects stray; those at the frame lie farthest apart. Without them these poses are 1.1 degrees off."""
    scene = lattice_scene(seed)
    index = torch.from_numpy(scene.index)
    low, high = index.min(0).values.tolist(), (index.max(0).values + 1).tolist()
    layout = Layout(lattice_of(scene.program), (low[0], high[0]), (low[1], high[1]))
    found = refitted(evidence_of(scene), layout).lattice
    cosine = np.dot(scene.camera.normal, Camera(found.rx_deg, found.ry_deg).normal)
    assert np.degrees(np.arccos(cosine)) < 0.6

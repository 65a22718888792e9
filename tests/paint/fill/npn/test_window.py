"""What the network sees of a hole is what the stack finds for it, at another scale."""

import numpy as np
import pytest
from painted import Scene, scene

from p3i.paint.fill.npn import window as window_module
from p3i.paint.fill.npn.window import Window, gather, window_of
from p3i.paint.fill.sources import MOST_TRIED, Ground, hole_of, sources
from p3i.vision.sheet import project


@pytest.fixture(scope="module")
def painted() -> Scene:
    return scene()


def seen(painted: Scene, *, working_px: int) -> Window:
    return window_of(painted.corrupted, painted.placed, painted.hole, working_px=working_px)


def test_at_the_photos_own_scale_the_sources_are_those_of_the_stack(
    painted: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window_module, "_MOST_TRIED", MOST_TRIED)
    window = seen(painted, working_px=48)
    photo = painted.corrupted
    points = np.argwhere(painted.hole)[:, ::-1].astype(float)
    one = hole_of(points, photo.pixels, photo.valid, painted.placed)
    wanted = sources(one, Ground.of(photo.pixels, photo.valid), painted.placed)
    stack = gather(window, window.hole, window.views[0], most=len(wanted))
    assert stack is not None
    for found, other in zip(stack.found, wanted, strict=True):
        here, there = window.on_photo(found), other
        np.testing.assert_allclose(here.where(points)[0], there.where(points)[0], atol=1e-6)
        np.testing.assert_allclose(here.gain, there.gain, atol=1e-6)


def test_through_its_own_view_a_hole_has_the_photo_round_it(painted: Scene) -> None:
    window = seen(painted, working_px=48)
    stack = gather(window, window.hole, window.views[0], most=10)
    assert stack is not None
    assert stack.hole.sum() == painted.hole.sum()
    rows, columns = np.nonzero(painted.hole)
    margin = np.argwhere(stack.hole).min(0)
    top, left = rows.min() - margin[0], columns.min() - margin[1]
    height, width = stack.hole.shape
    there = painted.photo.pixels[top : top + height, left : left + width]
    np.testing.assert_allclose(stack.target[stack.context], there[stack.context], atol=1e-6)


def test_sources_found_on_the_smaller_photo_lie_on_the_same_ground_of_the_photo(painted: Scene) -> None:
    window = seen(painted, working_px=9)
    assert window.from_photo[0, 0] < 0.6
    stack = gather(window, window.hole, window.views[0], most=10)
    assert stack is not None
    centers = painted.placed.centers_px()[0]
    points = np.argwhere(painted.hole)[:, ::-1].astype(float)
    own = centers[np.argmin(np.hypot(*(centers - points.mean(0)).T))]
    others = centers[np.hypot(*(centers - own).T) > 1]
    off = []
    for source in stack.found:
        on_photo = window.on_photo(source)
        there = source.where(project(window.from_photo, points)[0])[0]
        np.testing.assert_allclose(project(window.from_photo, on_photo.where(points)[0])[0], there, atol=1e-6)
        off.append(np.hypot(*(others - on_photo.where(own[None])[0]).T).min())
    assert np.median(off) < 1.0  # pixels, of about 20 between objects


def test_nothing_of_what_is_hidden_is_evidence_on_the_smaller_photo(painted: Scene) -> None:
    window = seen(painted, working_px=9)
    hidden = np.argwhere(painted.hole)[:, ::-1].astype(float)
    at, _ = project(window.from_photo, hidden)
    assert not window.ground.known(at).any()
    columns, rows = np.rint(at).astype(int).T
    assert not window.known[rows, columns].any()


def test_views_show_each_other_cell_in_the_holes_own_perspective(painted: Scene) -> None:
    window = seen(painted, working_px=48)
    middle = np.argwhere(window.hole).mean(0)[::-1][None]
    first = project(window.views[0], middle)[0][0]
    centers = painted.placed.centers_px()[0]
    from_object = first - centers[np.argmin(np.hypot(*(centers - first).T))]
    places = np.array([project(view, middle)[0][0] for view in window.views])
    apart = np.hypot(*(places[:, None] - centers - from_object).transpose(2, 0, 1)).min(1)
    assert len(places) == painted.placed.in_sight().sum()
    assert apart.max() < 1.0

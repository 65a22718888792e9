"""Patches of cells, cut in batches: the same place of the pattern in each, as the photo has it."""

import dataclasses

import numpy as np
import pytest
import torch
from painted import Scene, cells, scene

from p3i.paint.fill.npn import stacks
from p3i.paint.fill.npn.cells import Cells, cells_of, finer, laid
from p3i.paint.fill.npn.lessons import lessons, teachers
from p3i.paint.fill.npn.paint import tasks_of
from p3i.paint.fill.npn.stacks import pool_of, stacks_of
from p3i.place.moves import nearest
from p3i.size import Size
from p3i.vision.image import Image, resized_from_photo
from p3i.vision.sheet import project


@pytest.fixture(scope="module")
def photo() -> Scene:
    return scene()


@pytest.fixture(scope="module")
def seen(photo: Scene) -> Cells:
    return cells(photo)


def middle(seen: Cells, view: np.ndarray) -> np.ndarray:
    """The middle of a patch's own cell, on the photo."""
    rows, columns = np.nonzero(seen.cell)
    at = np.array([[(columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2]])
    return project(np.linalg.inv(seen.from_photo) @ view, at)[0][0]


def test_views_lay_the_patch_on_each_object(photo: Scene, seen: Cells) -> None:
    centers = photo.placed.centers_px()[0]
    for view, center in zip(seen.views.numpy(), centers, strict=True):
        assert np.hypot(*(middle(seen, view) - center)) < 1.5  # of about 20 pixels between objects


def test_a_patch_holds_its_objects_own_ground(photo: Scene, seen: Cells) -> None:
    """The part of the plane that is nearest to the object (Voronoi), and of no other."""
    to_plane = np.linalg.inv(photo.placed.image_from_plane) @ np.linalg.inv(seen.from_photo)
    for number in (11, 17, 23):  # cells with others all round
        at, _ = laid(seen.views[number], seen.patch)
        plane, _ = project(to_plane, at.numpy().reshape(-1, 2).astype(float))
        own = (nearest(photo.placed, plane) == number).reshape(seen.cell.shape)
        assert (own != seen.cell).mean() < 0.03


def test_reading_in_a_batch_is_reading_pixel_by_pixel(seen: Cells) -> None:
    patches, known = seen.read(seen.views[[3, 17]])
    points, _ = laid(seen.views[17], seen.patch)
    pixels = seen.pixels.numpy()
    height, width = pixels.shape[1:]
    for row, column in ((5, 7), (20, 20), (30, 12)):
        x, y = points[row, column].tolist()
        if not (0 <= x < width - 1 and 0 <= y < height - 1):
            assert known[1, 0, row, column] == 0
            continue
        left, top = int(x), int(y)
        fx, fy = x - left, y - top
        part = pixels[:, top : top + 2, left : left + 2]
        wanted = part @ np.array([1 - fx, fx]) @ np.array([1 - fy, fy])
        np.testing.assert_allclose(patches[1, :, row, column].numpy(), wanted, atol=1e-4)


def test_nothing_that_is_hidden_is_known_in_any_patch(photo: Scene) -> None:
    white = np.where(photo.hole[:, :, None], np.float32(9), photo.photo.pixels)
    marked = cells(Scene(Image(white, photo.photo.valid), photo.placed, photo.hole))
    patches, known = marked.read(marked.views)
    assert float(patches.max()) > 2
    assert float((patches * known).max()) <= 1


def test_the_hole_is_split_by_the_programs_centres(photo: Scene, seen: Cells) -> None:
    hole = np.zeros_like(photo.hole)
    hole[40:90, 60:120] = True
    tasks = tasks_of(cells(photo, hidden=False), photo.placed, hole)
    points = np.concatenate([task.points for task in tasks])
    assert len(points) == hole.sum() == len(np.unique(points, axis=0))
    plane_from_image = np.linalg.inv(photo.placed.image_from_plane)
    own = [nearest(photo.placed, project(plane_from_image, task.points)[0]) == task.number for task in tasks]
    assert len(tasks) >= 6
    assert np.concatenate(own).mean() > 0.9  # but for slivers


def test_finer_patches_show_the_same_ground(photo: Scene) -> None:
    large = np.kron(photo.photo.pixels, np.ones((3, 3, 1), np.float32))
    image = Image(large, np.ones(large.shape[:2], bool))
    placed = dataclasses.replace(
        photo.placed,
        size=Size(480, 360),
        image_from_plane=resized_from_photo(3) @ photo.placed.image_from_plane,
    )
    none = np.zeros(large.shape[:2], bool)
    coarse = cells_of(image, placed, none, none, device=torch.device("cpu"))
    fine = finer(coarse, image, none, none)
    assert fine.patch.width > 2 * coarse.patch.width
    at = np.array([[6.0, 9.0], [20.0, 14.0]])
    there = project(np.linalg.inv(fine.to_coarse.numpy()), at)[0]
    for number in (0, 17):
        one = project(np.linalg.inv(coarse.from_photo) @ coarse.views[number].numpy(), at)[0]
        other = project(np.linalg.inv(fine.from_photo) @ fine.views[number].numpy(), there)[0]
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_sources_are_laid_exactly_where_the_program_is_a_little_off(photo: Scene) -> None:
    """Each view a pixel off: the shift is found, and what is left of the difference falls."""
    seen = cells(photo)
    off = torch.eye(3, dtype=torch.float64).repeat(len(seen.views), 1, 1)
    off[:, :2, 2] = torch.from_numpy(np.random.default_rng(2).uniform(-1, 1, (len(off), 2)))
    astray = dataclasses.replace(seen, views=seen.views @ off)
    pool = pool_of(astray, torch.arange(1))
    place = teachers(astray, pool)[:6]
    numbers = pool.numbers[place]
    holes = torch.zeros(len(place), 1, *seen.cell.shape)
    holes[..., 14:18, 14:18] = 1
    batch, found, able = stacks_of(astray, pool, numbers, holes)
    assert able.all()
    at = torch.tensor([15.0, 15.0], dtype=torch.float64)

    def on_photo(views: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
        shown = views @ torch.cat([points, torch.ones(1, dtype=points.dtype)])
        return shown[..., :2] / shown[..., 2:]

    before, after = [], []
    for row, number in enumerate(numbers.tolist()):
        # Where the target's own place is to be seen on each object.
        wanted = on_photo(seen.views, at + off[number, :2, 2])
        for kept in range(found.views.shape[1]):
            if batch.weights[row, kept] > 0:
                away = (wanted - on_photo(found.views[row, kept], at)).norm(dim=1)
                after.append(float(away.min()))
                source = int(away.argmin())
                before.append(float((wanted - on_photo(astray.views[source], at)).norm(dim=1).min()))
    assert np.median(before) > 0.6
    assert np.median(after) < 0.5 * np.median(before)


def test_a_lesson_never_shows_the_ground_that_it_hides(photo: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = cells(photo)
    pool = pool_of(seen, torch.arange(1))
    outlines = torch.zeros(0, 1, seen.patch.height, seen.patch.width)

    def shown() -> float:
        """How many known source pixels lie on the hidden ground, on average."""
        total = 0.0
        for batch in lessons(seen, pool, teachers(seen, pool), outlines, count=16, seed=3):
            total += float(batch.known.sum())
        return total

    careful = shown()
    monkeypatch.setattr(stacks, "_own_ground", lambda cells, views, numbers, holes: torch.zeros(1))
    assert careful < shown()

"""Photos drawn here, with a lattice whose objects are known to the pixel."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

PLANE = 1200  # side of the drawn plane, in its own units
DRAWERS: dict[str, Callable] = {}


def drawer(function):
    DRAWERS[function.__name__] = function
    return function


@drawer
def disc(plane, x, y, r):
    cv2.circle(plane, (round(x * 16), round(y * 16)), round(r * 16), (40, 50, 120), -1, cv2.LINE_AA, 4)


@drawer
def light_disc(plane, x, y, r):
    cv2.circle(plane, (round(x * 16), round(y * 16)), round(r * 16), (250, 240, 200), -1, cv2.LINE_AA, 4)


@drawer
def square(plane, x, y, r):
    cv2.rectangle(plane, (round(x - r), round(y - r)), (round(x + r), round(y + r)), (30, 90, 60), -1)


@drawer
def letter(plane, x, y, r):
    (width, height), _ = cv2.getTextSize("R", cv2.FONT_HERSHEY_SIMPLEX, r / 12, 6)
    at = (round(x - width / 2), round(y + height / 2))
    cv2.putText(plane, "R", at, cv2.FONT_HERSHEY_SIMPLEX, r / 12, (150, 30, 30), 6, cv2.LINE_AA)


@drawer
def crossing(plane, x, y, r):
    cv2.line(plane, (round(x - 2 * r), round(y)), (round(x + 2 * r), round(y)), (40, 40, 40), 5)
    cv2.line(plane, (round(x), round(y - 2 * r)), (round(x), round(y + 2 * r)), (40, 40, 40), 5)


@dataclass(frozen=True)
class Scene:
    pixels: np.ndarray
    valid: np.ndarray
    image_from_plane: np.ndarray
    basis: np.ndarray
    origin: np.ndarray  # the middle of object (0, 0)
    cells: frozenset[tuple[int, int]]


@pytest.fixture(scope="session")
def draw_scene():
    def draw(
        cells,
        *,
        kind="disc",
        basis=((100.0, 0.0), (0.0, 100.0)),
        origin=(200.0, 200.0),
        radius=25.0,
        ground=(205, 200, 190),
        corners=((90, 60), (560, 20), (620, 470), (20, 430)),
        size=(640, 480),
        noise=0.02,
        seed=0,
    ) -> Scene:
        """A plane with `kind` drawn at the given cells, its four corners seen at `corners` of the photo."""
        rng = np.random.default_rng(seed)
        u, v = np.array(basis, float)
        plane = np.full((PLANE, PLANE, 3), ground, np.uint8)
        for i, j in cells:
            x, y = np.array(origin) + i * u + j * v
            DRAWERS[kind](plane, x, y, radius)
        outline = np.array([[0, 0], [PLANE - 1, 0], [PLANE - 1, PLANE - 1], [0, PLANE - 1]], np.float32)
        matrix = cv2.getPerspectiveTransform(outline, np.array(corners, np.float32))
        clutter = cv2.resize(
            rng.integers(60, 190, (24, 32, 3), dtype=np.uint8), size, interpolation=cv2.INTER_CUBIC
        )
        sharp = (2 * size[0], 2 * size[1])
        twice = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]]) @ matrix
        seen = cv2.warpPerspective(plane, twice, sharp, flags=cv2.INTER_AREA)
        where = cv2.warpPerspective(np.full((PLANE, PLANE), 255, np.uint8), twice, sharp) > 127
        photo = np.where(where[..., None], seen, cv2.resize(clutter, sharp))
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
        photo = np.clip(photo + rng.normal(0, noise, photo.shape), 0, 1).astype(np.float32)
        valid = np.ones(photo.shape[:2], bool)
        return Scene(photo, valid, matrix, np.array([u, v]), np.array(origin, float), frozenset(cells))

    return draw

"""Ruled sheets, crosswords, letter boards, small in the photo: one field is the cell, whatever it holds.

Chequered floors and woven mats, whose neighbours differ by rule, keep the cell that holds one of each.
"""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from truth import lattice_error, lattice_of, pose_error_deg

from p3i.grammar.ast import Program
from p3i.interp.camera import image_from_plane
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.forms.lattice import Lattice
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image

SIZE = Size(560, 420)
TABLE, PAPER, INK = (0.62, 0.54, 0.42), (0.9, 0.9, 0.88), (0.15, 0.15, 0.17)
LINE = 0.08
"""The width of a ruled line, in fields."""

Colours = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""The colours [M, 3] of the fields (column, row), each [M]."""


def tilted(step: float, *, tilt_deg: float, turn_deg: float = 4.0, fields: int = 15) -> Lattice:
    """Fields of `step` program units with the middle of all of them in the middle of the photo."""
    turn = np.radians(turn_deg)
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * step
    return Lattice(-tilt_deg, tilt_deg / 3, along, -np.ones(2) * (fields - 1) / 2 @ along)


def photo_of(lattice: Lattice, colour_at: Callable[[np.ndarray], np.ndarray], *, scale: int = 2) -> Image:
    """The plane whose colours [M, 3] at cell coordinates [M, 2] are given, (0, 0) the middle of a field."""
    x, y = np.meshgrid(np.arange(SIZE.width * scale), np.arange(SIZE.height * scale))
    seen = np.stack([(x.ravel() + 0.5) / scale - 0.5, (y.ravel() + 0.5) / scale - 0.5, np.ones(x.size)])
    matrix = image_from_plane(lattice.rx_deg, lattice.ry_deg, size=SIZE, focal_mm=35.0).numpy()
    plane = np.linalg.inv(matrix) @ seen
    at = ((plane[:2] / plane[2]).T - lattice.origin) @ np.linalg.inv(lattice.basis)
    pixels = colour_at(at).reshape(*x.shape, 3).astype(np.float32)
    pixels = cv2.resize(pixels, (SIZE.width, SIZE.height), interpolation=cv2.INTER_AREA)
    pixels += np.random.default_rng(0).normal(0, 0.015, pixels.shape)
    return Image(pixels.clip(0, 1).astype(np.float32), np.ones(pixels.shape[:2], bool))


def board(lattice: Lattice, fields: int, colours: Colours) -> Image:
    """A ruled board of `fields` by `fields`, with a margin of paper of one field, on a table."""

    def colour_at(at: np.ndarray) -> np.ndarray:
        from_edge = np.abs(at - (fields - 1) / 2) - fields / 2
        paper, ruled = from_edge.max(1) < 1, from_edge.max(1) < LINE / 2
        field = np.round(at).clip(0, fields - 1).astype(int)
        line = (np.abs(at - np.round(at)) > (1 - LINE) / 2).any(1)
        painted = np.where(paper[:, None], PAPER, TABLE)
        painted[ruled] = colours(field[ruled, 0], field[ruled, 1])
        painted[ruled & (line | (from_edge.max(1) > -LINE / 2))] = INK
        return painted

    return photo_of(lattice, colour_at)


def plain(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    return np.broadcast_to(PAPER, (len(column), 3))


def crossword(fields: int, seed: int) -> Colours:
    """Every second field of every second row is black, and some others in pairs about the middle."""
    chance = np.random.default_rng(seed)
    black = np.zeros((fields, fields), bool)
    black[1::2, 1::2] = True
    for row, column in chance.integers(0, fields, (12, 2)):
        black[row, column] = black[fields - 1 - row, fields - 1 - column] = True
    return lambda column, row: np.where(black[row, column][:, None], INK, PAPER)


def letter_board(fields: int, seed: int) -> Colours:
    """Green, with a quarter of the fields in other colours, alike in all four corners."""
    chance = np.random.default_rng(seed)
    half = fields // 2 + 1
    kind = np.where(chance.uniform(size=(half, half)) < 0.25, chance.integers(1, 5, (half, half)), 0)
    inks = np.array(
        [(0.16, 0.55, 0.28), (0.35, 0.63, 0.8), (0.9, 0.67, 0.67), (0.82, 0.24, 0.24), (0.55, 0.75, 0.9)]
    )
    return lambda column, row: inks[
        kind[np.minimum(row, fields - 1 - row), np.minimum(column, fields - 1 - column)]
    ]


def answer(image: Image) -> Program:
    result = synthesize(image, SearchConfig())
    assert result.program is not None and result.structure == "lattice"
    return result.program


def assert_fields_are_cells(program: Program, truth: Lattice, fields: int) -> None:
    found = lattice_of(program)
    assert lattice_error(found.basis, truth.basis) < 0.03
    assert pose_error_deg(found, truth) < 1
    assert len(compile(program).index) in {fields**2, (fields + 1) ** 2}  # the fields, or the crossings


@pytest.mark.parametrize("tilt_deg", [0, 8])
def test_of_a_small_ruled_sheet_every_crossing_is_an_object(tilt_deg: float) -> None:
    truth, fields = tilted(2.6, tilt_deg=tilt_deg), 15
    assert_fields_are_cells(answer(board(truth, fields, plain)), truth, fields)


def test_black_fields_of_a_crossword_do_not_double_its_step() -> None:
    truth = tilted(3.4, tilt_deg=12, fields=13)
    found = lattice_of(answer(board(truth, 13, crossword(13, 1))))
    assert lattice_error(found.basis, truth.basis) < 0.03


def test_coloured_fields_of_a_board_do_not_double_its_step() -> None:
    truth = tilted(2.4, tilt_deg=10, fields=15)
    found = lattice_of(answer(board(truth, 15, letter_board(15, 0))))
    assert lattice_error(found.basis, truth.basis) < 0.03


def test_the_cell_of_a_chequered_floor_holds_both_colours() -> None:
    truth = tilted(3.2, tilt_deg=20)

    def colour_at(at: np.ndarray) -> np.ndarray:
        return np.where((np.round(at).sum(1) % 2 == 0)[:, None], 0.3, np.array([[0.8, 0.78, 0.7]]))

    found = lattice_of(answer(photo_of(truth, colour_at)))
    assert lattice_error(found.basis, np.array([[1, 1], [1, -1]]) @ truth.basis) < 0.03


def test_the_cell_of_a_woven_mat_holds_a_strand_of_each_direction() -> None:
    truth = tilted(4.0, tilt_deg=20)

    def colour_at(at: np.ndarray) -> np.ndarray:
        inside = at - np.round(at)
        across = np.where(np.round(at).sum(1) % 2 == 0, inside[:, 0], inside[:, 1])
        along = np.where(np.round(at).sum(1) % 2 == 0, inside[:, 1], inside[:, 0])
        light = np.sqrt(np.clip(1 - (2.1 * across) ** 2, 0.05, 1)) * (1 - 0.8 * along**2)
        return light[:, None] * np.array([[0.85, 0.7, 0.45]])

    found = lattice_of(answer(photo_of(truth, colour_at)))
    assert lattice_error(found.basis, np.array([[1, 1], [1, -1]]) @ truth.basis) < 0.03

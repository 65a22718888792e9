"""Cells of several kinds in turn: found where they are, nowhere else, and filled as the kind they are."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from marked import LATTICE, RING, drawn

from p3i import loads
from p3i.paint.fill.kinds import kinds_of, turns_of
from p3i.paint.fill.pieces import drawn_on, pieces_of
from p3i.paint.fill.stack import fill_by_stack
from p3i.paint.fill.survey import survey_of
from p3i.place.moves import nearest
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image
from p3i.vision.sheet import project

GRID = np.stack(np.meshgrid(np.arange(-5, 6), np.arange(-4, 5), indexing="ij"), -1).reshape(-1, 2)


def coloured(kinds: np.ndarray, *, seed: int, apart: float) -> tuple[np.ndarray, np.ndarray]:
    """Cells of a pattern and a colour for each kind, with noise; a fifth of all places is not shown."""
    random = np.random.default_rng(seed)
    common, colours = (
        random.uniform(0.2, 0.6, (30, 3)),
        random.uniform(0, apart, (int(kinds.max()) + 1, 1, 3)),
    )
    lit = common + colours[kinds] + random.normal(0, 0.02, (len(kinds), 30, 3))
    return lit.astype(np.float32), random.random((len(kinds), 30)) > 0.2


@settings(deadline=None, max_examples=25)
@given(a=st.integers(1, 2), b=st.integers(0, 2), c=st.integers(1, 3), seed=st.integers(0, 99))
def test_cells_in_turn_are_told_apart(a: int, b: int, c: int, seed: int) -> None:
    """For any period: the cells of a kind, and no others, have one number."""
    truth = (GRID[:, 0] % a) * c + (GRID[:, 1] - b * (GRID[:, 0] // a)) % c
    lit, shown = coloured(truth, seed=seed, apart=1.0)
    found = kinds_of(GRID, lit, shown, np.arange(len(GRID)))
    assert len(np.unique(np.stack([truth, found]), axis=1).T) == a * c == len(np.unique(found))


def test_cells_of_one_kind_are_not_told_apart() -> None:
    """By chance in fewer than one photo in ten; half of the cells tell."""
    truth, asked = np.zeros(len(GRID), int), np.arange(0, len(GRID), 2)
    told = [kinds_of(GRID, *coloured(truth, seed=seed, apart=0.0), asked).max() for seed in range(20)]
    assert np.count_nonzero(told) <= 2


def test_on_a_ring_the_period_divides_the_count() -> None:
    index = np.stack([np.zeros(15, int), np.arange(15)], 1)
    lit, shown = coloured(index[:, 1] % 2, seed=0, apart=1.0)
    assert kinds_of(index, lit, shown, np.arange(15)).max() == 1
    assert not kinds_of(index, lit, shown, np.arange(15), turns=[(0, 15)]).any()


def test_a_ring_closes_after_its_objects_and_a_lattice_never() -> None:
    photo = Image(np.zeros((400, 480, 3), np.float32), np.ones((400, 480), bool))
    assert turns_of(placed(loads(RING), photo)) == [(12, 0)]
    assert turns_of(placed(loads(LATTICE), photo)) == []


def tinted(text: str, kinds: Callable[[np.ndarray], np.ndarray]) -> tuple[Image, Placed]:
    """The picture of a program whose cells are of two colours, by their indices [K, 2]."""
    photo = drawn(text)
    laid = placed(loads(text), photo)
    height, width = photo.valid.shape
    points = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2).astype(float)
    number = nearest(laid, project(np.linalg.inv(laid.image_from_plane), points)[0])
    other = kinds(laid.index[number]).reshape(height, width, 1)
    tint = np.where(other, np.float32([0.4, 0.6, 1.0]), np.float32([1.0, 0.7, 0.5]))
    return dataclasses.replace(photo, pixels=photo.pixels * tint), laid


def test_rows_that_differ_above_and_below_are_not_in_turn() -> None:
    """The cells near tell which: no period does better."""
    photo, laid = tinted(LATTICE, lambda index: index[:, 1] >= 0)
    survey = survey_of(photo.pixels, photo.valid, laid)
    assert survey is not None and not survey.kinds.any()


@pytest.mark.parametrize("text", [LATTICE, RING])
def test_deep_in_a_hole_a_cell_is_of_its_kind(text: str) -> None:
    """Light and dark in turn, as on a chequered floor and a dartboard, nearly half hidden."""
    photo, laid = tinted(text, lambda index: index.sum(1) % 2 > 0)
    hole = np.zeros(photo.valid.shape, bool)
    hole[:, : int(0.45 * hole.shape[1])] = True
    hidden = np.where(hole[:, :, None], np.float32(0), photo.pixels)
    result, bare = fill_by_stack(hidden, photo.valid, hole, laid)
    inside = hole & ~bare & (drawn_on(laid) > 0)
    off = np.abs(result - photo.pixels).mean(2) * 255
    assert (off[inside] < 20).mean() > 0.93


def test_what_lies_beyond_the_pattern_is_a_piece_of_its_own() -> None:
    """Even of a small hole: in the pattern it is one, beyond it there are others."""
    photo = drawn(LATTICE)
    laid = placed(loads(LATTICE), photo)
    pattern = drawn_on(laid)
    rim = np.flatnonzero(pattern[200] == 0)
    beyond = int(rim[rim < 240].max())
    hole = np.zeros(photo.valid.shape, bool)
    hole[185:215, beyond - 20 : beyond + 20] = True
    pieces, labels = pieces_of(hole, pattern, laid)
    assert sorted({piece.beyond for piece in pieces}) == [False, True]
    for piece in pieces:
        assert ((pattern[hole & (labels == piece.number)] == 0) == piece.beyond).all()
    assert sum(not piece.beyond for piece in pieces) == 1

"""The extents of a sketch: none is left out for how much it draws, none is listed where they are too many."""

import time
import tracemalloc

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import p3i
from p3i.errors import SketchError
from p3i.evaluation.program_scenes import program_scene
from p3i.grammar.leaves import leaves
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.unroll import live_indices
from p3i.search import synthesize as synthesize_module
from p3i.search.forms.filling import Filling, fillings, unknowns_of
from p3i.search.forms.settings import best_setting, check_settings, drawn_by, widened
from p3i.search.forms.sketches import by_hand
from p3i.search.result import StopReason
from p3i.size import Size

BOARD = (
    "SetCameraPose(rx={rx}, ry=8)\nfor i in range(0, {n}):\n    for j in range(0, {n}):\n"
    "        Draw(x={step}*i - 42, y=6*j - 31)\n"
)
GUARDED = (
    "for i in range(??, ??):\n    for j in range(??, ??):\n        if ??*i + ??*j >= ??:\n"
    "            if ??*i + ??*j >= ??:\n                Draw(x=7*i, y=7*j + ??)\n"
)


def sketch(text: str) -> Sketch:
    made = parse_sketch(text)
    assert isinstance(made, Sketch), made
    return made


def filling_of(text: str) -> Filling:
    made = sketch(text)
    return next(fillings(made, unknowns_of(made), most_indices=64, most_settings=8))


@pytest.mark.parametrize("least", [8, 9, 11])
def test_a_sketch_is_searched_however_many_objects_its_smallest_setting_draws(
    monkeypatch: pytest.MonkeyPatch, least: int
) -> None:
    monkeypatch.setattr(synthesize_module, "sketches", lambda config: [by_hand("the sketch", config.sketch)])
    truth = p3i.loads(BOARD.format(rx=-30, n=11, step=8))
    image = program_scene(truth, 2, look="flower", size=Size(400, 300)).image()
    holes = sketch(BOARD.format(rx="??(-35, -25)", n=f"??({least}, 13)", step="??(7.5, 8.5)"))
    result = p3i.synth(image, sketch=holes)
    assert result.program is not None, result.reason
    found = leaves(result.program)
    assert (found["for_i.stop.1"], found["for_j.stop.1"]) == (11, 11)


def test_a_setting_that_draws_much_is_looked_at_by_a_part_of_its_objects_from_everywhere() -> None:
    index = filling_of(BOARD.format(rx="??", n="??(20, 30)", step="??")).pattern.index
    assert len(index) == 64
    # Of each quarter of the board about a quarter, and no column left out.
    for part in (index[:, 0] < 10, index[:, 1] < 10, (index[:, 0] % 2 == 0)):
        assert 24 <= int(part.sum()) <= 40
    assert len(index[:, 0].unique()) > 16 and len(index[:, 1].unique()) > 16


numbers = st.integers(-3, 6)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[numbers] * 4), st.tuples(*[st.integers(-2, 2)] * 6))
def test_what_a_setting_draws_is_what_its_program_draws(
    ends: tuple[int, ...], guards: tuple[int, ...]
) -> None:
    """Against the walk through the loops in plain Python."""
    filling = filling_of(GUARDED)
    at = dict(zip([u.name for u in filling.extents], range(len(filling.extents)), strict=True))
    assert len(at) == 10
    chosen = (*ends, *guards)
    program = filling.program(torch.zeros(len(filling.moving)), chosen)
    everywhere = torch.cartesian_prod(torch.arange(-5, 9), torch.arange(-5, 9))
    drawn = everywhere[drawn_by(filling, [chosen], everywhere)[0]]
    assert [tuple(pair) for pair in drawn.tolist()] == sorted(live_indices(program))


def wanted_by(wide: Filling, inside: torch.Tensor) -> torch.Tensor:
    return torch.where(inside, 1.0, -1.0).double()


def test_of_settings_that_nobody_could_list_the_best_is_found_at_once() -> None:
    """Two loops with free ends and two guards: some 10^9. A board without two of its corners is there."""
    filling = filling_of(GUARDED)
    tracemalloc.start()
    begun = time.process_time()
    wide = widened(filling)
    i, j = wide.pattern.index.T
    there = (i >= -3) & (i < 9) & (j >= 0) & (j < 12) & (i + j >= 1) & (i - j >= -8)
    gain, setting = best_setting(wide, wanted_by(wide, there), filling.settings[0])
    assert time.process_time() - begun < 5
    assert tracemalloc.get_traced_memory()[1] < 200e6
    tracemalloc.stop()
    drawn = drawn_by(wide, [setting], wide.pattern.index)[0]
    assert gain == float(wanted_by(wide, there)[drawn].sum())
    assert gain > 0.9 * int(there.sum())


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6))
def test_of_few_settings_none_is_better_than_the_one_that_is_found(seed: int) -> None:
    filling = filling_of(
        "for j in range(??(-3, 0), ??(2, 9)):\n    if ??*j >= ??(-2, 2):\n        Draw(x=??*j, y=0)\n"
    )
    wide = widened(filling)
    gains = torch.from_numpy(np.random.default_rng(seed).normal(size=len(wide.pattern.index)))
    gain, setting = best_setting(wide, gains, filling.settings[0])
    for other in np.ndindex(4, 8, 3, 5):
        values = tuple(int(u.values()[k]) for u, k in zip(filling.extents, other, strict=True))
        drawn = set(live_indices(filling.program(torch.zeros(len(filling.moving)), values)))
        mine = sum(
            float(g)
            for pair, g in zip(wide.pattern.index.tolist(), gains, strict=True)
            if tuple(pair) in drawn
        )
        assert mine <= gain + 1e-9
    assert len(setting) == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("for j in range(0, ??(4, 99999)):\n    Draw(x=??*j, y=3)\n", "for_j.stop.1.* 99,996 whole numbers"),
        (
            "for i in range(0, ?m(3, 99)):\n    for j in range(0, ?n(3, 99)):\n"
            "        Draw(x=9*Cos(360/?n*j + 360/?m*i), y=9*Sin(360/?n*j + 360/?m*i))\n",
            "9,409 ways",
        ),
    ],
)
def test_truly_too_many_are_refused_by_name_with_the_limit_and_how_to_raise_it(
    monkeypatch: pytest.MonkeyPatch, text: str, words: str
) -> None:
    with pytest.raises(SketchError, match=f"{words}.*the limit is .*P3I_MAX_SETTINGS"):
        check_settings(sketch(text), place="the sketch")
    monkeypatch.setenv("P3I_MAX_SETTINGS", "100000")
    check_settings(sketch(text), place="the sketch")


def test_a_sketch_with_two_free_guards_is_searched_in_the_time_that_it_is_given() -> None:
    image = program_scene(p3i.loads(BOARD.format(rx=-30, n=9, step=9)), 2, size=Size(240, 180)).image()
    begun = time.process_time()
    result = p3i.synth(image, sketch=sketch("SetCameraPose(rx=-30, ry=8)\n" + GUARDED), time_s=0.1)
    assert time.process_time() - begun < 20
    assert result.stop is StopReason.TIME_UP

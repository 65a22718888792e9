"""Which place of the cell is the object: the default, what else is offered, and how it is asked for."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
import torch
from drawn import DrawnRing
from truth import lattice_of

from p3i.grammar.ast import Affine as A
from p3i.grammar.ast import CameraPose, Draw, For, Program
from p3i.grammar.leaves import leaves
from p3i.grammar.parser import parse
from p3i.interp.compile import compile
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.extent.layout import found_layout
from p3i.search.forms.lattice import Lattice
from p3i.search.forms.layout import Layout
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.readings import offers, on_asked_circle, reading_notes
from p3i.search.result import Reading, StopReason, SynthesisResult
from p3i.search.synthesize import synthesize
from p3i.size import Size
from p3i.vision.image import Image

FOCAL_MM = 35.0
WIDE, HIGH = 540, 405
STEP = 70.5
"""Pixels from well to well."""


def picture(grey: np.ndarray) -> Image:
    """A photo of a painted grey picture [2H, 2W], at half its size and with noise."""
    small = cv2.resize(grey, (WIDE, HIGH), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    small = small[..., None] + np.random.default_rng(3).normal(0, 0.015, (HIGH, WIDE, 3))
    return Image(small.clip(0, 1).astype(np.float32), np.ones((HIGH, WIDE), bool))


@cache
def wells() -> Image:
    """A plate of 6 x 4 round wells, each cluttered inside, with glints where two of a row touch."""
    chance = np.random.default_rng(3)
    canvas = np.full((2 * HIGH, 2 * WIDE), 70, np.uint8)
    cv2.rectangle(canvas, (150, 120), (1005, 705), 165, -1)
    for i in range(6):
        for j in range(4):
            x, y = well = round(225 + 2 * STEP * i), round(195 + 2 * STEP * j)
            cv2.circle(canvas, well, 69, 205, 5, cv2.LINE_AA)
            cv2.circle(canvas, well, 65, 90, 3, cv2.LINE_AA)
            cv2.circle(canvas, well, 54, 185, -1, cv2.LINE_AA)
            cv2.ellipse(canvas, well, (54, 54), 0, 200, 340, 110, 3, cv2.LINE_AA)
            for _ in range(chance.integers(1, 5)):
                a, b = (np.array(well) + chance.normal(0, 20, 2) for _ in range(2))
                cv2.line(
                    canvas,
                    a.astype(int).tolist(),
                    (0.7 * a + 0.3 * b).astype(int).tolist(),
                    60,
                    2,
                    cv2.LINE_AA,
                )
    for i in range(5):
        for j in range(4):
            x, y = round(225 + 2 * STEP * (i + 0.5)), round(195 + 2 * STEP * j)
            cv2.line(canvas, (x, y - 21), (x, y + 21), 250, 13, cv2.LINE_AA)
    return picture(canvas)


def sheet(*, chequered: bool) -> Image:
    """A sheet of 12 x 8 fields of 36 pixels, ruled or chequered; its corner is at (54, 58.5)."""
    x, y = np.meshgrid(np.arange(2 * WIDE) / 2 - 54, np.arange(2 * HIGH) / 2 - 58.5)
    inside = (x >= -1) & (y >= -1) & (x <= 12 * 36 + 1) & (y <= 8 * 36 + 1)
    if chequered:
        painted = np.where((x // 36 + y // 36) % 2 == 0, 60, 215)
    else:
        painted = np.where(
            (np.abs(x - 36 * np.round(x / 36)) < 1) | (np.abs(y - 36 * np.round(y / 36)) < 1), 50, 225
        )
    return picture(np.where(inside, painted, 130).astype(np.uint8))


def layout_of(image: Image, steps: tuple[tuple[float, float], ...], asked: str | None = None) -> Layout:
    """The layout of a lattice that is seen straight on, whose steps in pixels are known."""
    unit = image.size.unit_px
    basis = np.array(steps) / unit
    evidence = Evidence(image, SearchConfig(object=asked), FOCAL_MM)
    ground = torch.cartesian_prod(torch.arange(-2, 3), torch.arange(-1, 2)).double()
    found = found_layout(evidence, Lattice(0.0, 0.0, basis, np.zeros(2)), ground)
    assert found is not None
    return found[0]


def first_px(layout: Layout, size: Size) -> np.ndarray:
    """Where the layout's (0, 0) lies on a photo that is seen straight on."""
    return layout.lattice.origin * size.unit_px + [(size.width - 1) / 2, (size.height - 1) / 2]


RULED = ((36.0, 0.0), (0.0, 36.0))
CHEQUERED = ((36.0, -36.0), (36.0, 36.0))


def test_whole_wells_are_the_objects_and_not_the_glints_between_them() -> None:
    result = synthesize(wells(), SearchConfig(structure="lattice", focal_mm=FOCAL_MM))
    assert len(result.centers) == 24
    places = np.array([(x, y) for x, y, _, _ in result.centers])
    middles = np.array([(112.25 + STEP * i, 97.25 + STEP * j) for i in range(6) for j in range(4)])
    apart = np.linalg.norm(places[:, None] - middles[None], axis=2)
    assert apart.min(1).max() < 0.1 * STEP
    assert result.reading is not None and result.reading.probability > 0.5


@pytest.mark.parametrize(("name", "middle"), [("crossing", 0.0), ("field", 0.5)])
def test_a_ruled_sheet_offers_its_crossings_and_its_fields(name: str, middle: float) -> None:
    image = sheet(chequered=False)
    layout = layout_of(image, RULED, name)
    drawn = [one for one in layout.readings if one.drawn]
    assert [one.name for one in drawn] == [name]
    away = (first_px(layout, image.size) - [54, 58.5]) / 36 - middle
    assert np.abs(away - np.round(away)).max() < 0.1


@pytest.mark.parametrize(("name", "odd"), [("dark", 0), ("light", 1)])
def test_the_two_colours_of_a_chequered_floor_are_two_readings(name: str, odd: int) -> None:
    image = sheet(chequered=True)
    layout = layout_of(image, CHEQUERED, name)
    assert {"dark", "light"} <= {one.name for one in layout.readings}
    field = (first_px(layout, image.size) - [54, 58.5]) / 36 - 0.5
    assert np.abs(field - np.round(field)).max() < 0.1
    assert np.round(field).sum() % 2 == odd


def test_the_probabilities_of_the_readings_are_those_of_one_choice() -> None:
    readings = layout_of(sheet(chequered=True), CHEQUERED).readings
    assert sum(one.probability for one in readings) == pytest.approx(1)
    assert [one.probability for one in readings] == sorted(
        (one.probability for one in readings), reverse=True
    )
    assert readings[0].drawn


def test_a_number_asks_for_the_place_of_this_rank_whatever_is_drawn() -> None:
    image = sheet(chequered=True)
    ranked = [one.name for one in layout_of(image, CHEQUERED).readings]
    second = layout_of(image, CHEQUERED, "2")
    assert [one.name for one in second.readings] == ranked
    assert [one.drawn for one in second.readings[:2]] == [False, True]


def answered(config: SearchConfig) -> SynthesisResult:
    return synthesize(sheet(chequered=True), config)


def test_what_the_cell_does_not_offer_is_refused_with_what_it_does() -> None:
    result = answered(SearchConfig(structure="lattice", object="crossing"))
    assert result.program is None and result.stop is StopReason.NO_SUCH_OBJECT
    assert "no such place (it offers " in result.reason
    assert "dark" in result.reason and "light" in result.reason


def test_the_other_colour_is_a_candidate_of_the_same_lattice() -> None:
    result = answered(SearchConfig(structure="lattice", top=2))
    first, second = result.candidates
    assert not first.same_lattice and second.same_lattice
    assert first.reading is not None and second.reading is not None
    assert {first.reading.name, second.reading.name} == {"dark", "light"}
    assert second.title.startswith(f"the same lattice, objects on the {second.reading.name} places (")
    ours, theirs = lattice_of(first.program), lattice_of(second.program)
    steps = (theirs.origin - ours.origin) @ np.linalg.inv(ours.basis)
    # Half a step on, along one side of the cell or both, whichever its rows are.
    assert np.abs(2 * steps - np.round(2 * steps)).max() < 0.1 < np.abs(steps - np.round(steps)).max()
    assert result.program == first.program


PROGRAM = Program(
    CameraPose(), For("i", A(), A(constant=2), For("j", A(), A(constant=2), Draw(A(9), A(0, 9))))
)


def answer(*readings: Reading, structure: str = "lattice") -> Answer:
    return Answer(PROGRAM, structure, 0.5, 100.0, readings=readings)  # pyright: ignore[reportArgumentType]


CROSSING, FIELD = Reading("crossing", 0.61, (0.0, 0.0)), Reading("field", 0.3, (0.5, 0.5))
FAR = Reading("3", 0.04, (0.5, 0.0))


def test_an_unsure_choice_is_told_with_the_option_for_the_others() -> None:
    (note,) = reading_notes(answer(CROSSING, FIELD, FAR), SearchConfig())
    assert note == (
        "what of the cell is its object is not sure: drawn on the crossings (0.61); "
        "--object field draws on the fields (0.30)"
    )


@pytest.mark.parametrize("readings", [(Reading("dark", 0.9, (0.0, 0.0)), FAR), ()])
def test_a_sure_choice_and_none_at_all_need_no_note(readings: tuple[Reading, ...]) -> None:
    assert reading_notes(answer(*readings), SearchConfig()) == ()


def test_a_ring_of_one_circle_says_that_there_is_no_choice() -> None:
    config = SearchConfig(object="2")
    ring = answer(structure="circular")
    assert offers(ring, config)
    (note,) = reading_notes(ring, config)
    assert note == "--object chooses among places, and this ring offers one only"


def test_the_other_circle_of_a_dial_is_told_listed_and_drawn_where_asked_for() -> None:
    outer, inner = (DrawnRing(radius=radius, size=size, noise=0.0) for radius, size in ((24, 4), (18, 3)))
    ground, marks = outer.image(), inner.image()
    drawn = np.abs(marks.pixels - marks.pixels[0, 0]).max(2, keepdims=True) > 0.02
    dial = replace(ground, pixels=np.where(drawn, marks.pixels, ground.pixels))
    result = synthesize(dial, SearchConfig(structure="circular", top=2))
    here, there = result.readings
    assert here.drawn and there.radius == pytest.approx(24 / 18, abs=0.2)
    assert any(
        f"--object 2 draws on the circle of {there.radius:.2f} times its radius" in one
        for one in result.notes
    )
    first, second = (leaves(one.program)["draw.x.radius.1"] for one in result.candidates)
    assert first == pytest.approx(18, abs=1) and second == pytest.approx(first * there.radius, rel=1e-3)
    assert result.candidates[1].title.startswith("the same ring, objects on place 2 of the cell (")
    asked = synthesize(dial, SearchConfig(structure="circular", object="2"))
    assert asked.program is not None and asked.reading is not None and asked.reading.name == "2"
    assert leaves(asked.program)["draw.x.radius.1"] == pytest.approx(second, rel=0.02)
    refused = synthesize(dial, SearchConfig(structure="circular", object="3"))
    assert refused.stop is StopReason.NO_SUCH_OBJECT and "it offers 1, 2" in refused.reason


def test_an_answer_offers_what_it_draws_by_name_and_by_rank() -> None:
    told = answer(CROSSING, FIELD)
    assert offers(told, SearchConfig())
    assert offers(told, SearchConfig(object="crossing")) and offers(told, SearchConfig(object="1"))
    assert not offers(told, SearchConfig(object="dark")) and not offers(told, SearchConfig(object="7"))


def test_the_readings_of_a_program_are_told_from_what_it_draws() -> None:
    layout = layout_of(sheet(chequered=True), CHEQUERED, "2")
    first = layout.readings[0]
    at = layout.lattice.origin + np.array(first.steps) @ layout.lattice.basis
    likeliest = layout_of(sheet(chequered=True), CHEQUERED).lattice.origin
    steps = (at - likeliest) @ np.linalg.inv(layout.lattice.basis)
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    assert len(compile(layout.program()).index) > 20


def test_through_a_lens_the_circle_that_was_asked_for_is_drawn_too() -> None:
    ring = parse(
        "SetCameraPose(rx=0, ry=0)\nfor j in range(0, 9):\n"
        "    Draw(x=20*Cos(40*j + 10) + 0, y=20*Sin(40*j + 10) + 0)\n"
    )
    here, there = Reading("1", 0.6, (0.0, 0.0)), Reading("2", 0.4, (0.0, 0.5), 1.5)
    told = Answer(ring, "circular", 0.5, 100.0, readings=(here, there), lens_k1=0.05, notes=("kept",))
    config = SearchConfig(structure="circular", object="2")
    look = Session(Evidence(sheet(chequered=False), config, FOCAL_MM), config)
    moved = on_asked_circle(look, told)
    assert leaves(moved.program)["draw.x.radius.1"] == pytest.approx(30)
    assert offers(moved, config) and moved.notes == ("kept",)
    assert (
        on_asked_circle(Session(Evidence(sheet(chequered=False), config, FOCAL_MM), config), moved) is moved
    )

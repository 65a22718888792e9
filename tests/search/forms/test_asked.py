"""What is searched when a person asks for something."""

import pytest
from truth import pose_error_deg, small_scene

import p3i
from p3i.errors import SketchError
from p3i.evaluation.program_scenes import program_scene
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.forms import asked
from p3i.search.propose import holes
from p3i.search.result import NEEDED, StopReason
from p3i.search.synthesize import synthesize
from p3i.size import Size

ROW = "SetCameraPose(rx=-30, ry=5)\nfor j in range(0, 8):\n    Draw(x=9*j - 30, y=2*j)\n"


def sketch(text: str) -> Sketch:
    found = parse_sketch(text)
    assert isinstance(found, Sketch), found
    return found


def test_without_a_wish_an_answer_needs_what_it_always_needs() -> None:
    assert not asked.asks_for_itself(SearchConfig()) and not asked.asks_for_itself(
        SearchConfig(exhaustive_s=3)
    )
    assert asked.why_not(SearchConfig()) is StopReason.NO_PATTERN
    assert asked.needed_for(SearchConfig()) == NEEDED


def test_a_sketch_a_start_and_a_recipe_say_what_to_look_for() -> None:
    holes = sketch(ROW.replace("rx=-30", "rx=??"))
    for config in (SearchConfig(sketch=holes), SearchConfig(start=p3i.loads(ROW))):
        assert asked.asks_for_itself(config)
        assert asked.why_not(config) is StopReason.NO_FIT
        assert asked.needed_for(config) == NEEDED
    assert asked.needed_for(SearchConfig(recipe="paper")) == 0


def test_the_focal_in_the_header_of_a_sketch_counts() -> None:
    text = "# /// p3p\n# version = 1\n# focal = 50.0\n# ///\n" + ROW.replace("rx=-30", "rx=~-30")
    image = program_scene(p3i.loads(ROW), 0, size=Size(240, 180)).image()
    assert p3i.synth(image, sketch=sketch(text)).focal_mm == 50
    assert p3i.synth(image, sketch=sketch(text)).focal_source == "header"
    assert p3i.synth(image, sketch=sketch(text), focal_mm=28).focal_mm == 28


def test_a_sketch_of_what_others_draw_starts_from_their_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight holes without bounds: no grid finds them, and none is looked through here."""
    monkeypatch.setattr(holes, "_from_grid", lambda *_, **__: [])
    scene = small_scene(14)
    free = sketch(
        "SetCameraPose(rx=??, ry=??)\nfor i in range(0, ??):\n    for j in range(0, ??):\n"
        "        Draw(x=??*i + ??*j + ??, y=??*i + ??*j + ??)\n"
    )
    result = synthesize(scene.image(), SearchConfig(sketch=free))
    assert result.program is not None and result.structure == "lattice"
    assert pose_error_deg(result.program, scene.program) < 1.5
    row = sketch("SetCameraPose(rx=??, ry=??)\nfor j in range(0, ??):\n    Draw(x=??*j + ??, y=??*j + ??)\n")
    assert synthesize(scene.image(), SearchConfig(sketch=row)).program is None


def test_an_answer_with_a_focal_of_its_own_keeps_its_vanishing_line_under_the_assumed_one() -> None:
    ring = p3i.loads(
        "SetCameraPose(rx=30, ry=10)\nfor j in range(0, 8):\n    Draw(x=9*Cos(45*j), y=9*Sin(45*j))\n"
    )
    one = holes._refocused(Answer(ring, "circular", 0.5, 0.5, focal_mm=60.0), 35.0)
    size = Size(400, 300)
    own = Camera.of(ring, focal_mm=60.0).horizon(size)
    now = Camera.of(one.program, focal_mm=35.0).horizon(size)
    assert one.focal_mm is None and own is not None and now == pytest.approx(own)
    assert holes._refocused(one, 50.0) is one


def test_a_start_that_was_found_through_a_lens_is_refused_and_not_bent_in_silence() -> None:
    text = "# /// p3p\n# version = 1\n# lens_k1 = -0.1\n# ///\n" + ROW
    with pytest.raises(SketchError, match="has a lens"):
        asked.check_asked(SearchConfig(start=p3i.loads(text)), Size(400, 300))


@pytest.mark.parametrize(
    "changes",
    [
        {"9*j": "1e300*j"},
        {"2*j": "-2e9*j"},
        {"rx=-30": "rx=3e307"},
        {"x=9*j - 30": "x=20*Cos(1e300*j)"},
        {"9*j": "??(9, 1e300)*j"},
        {"- 30": "+ ~1e300"},
    ],
    ids=str,
)
def test_numbers_that_no_picture_shows_are_refused_before_a_search(changes: dict[str, str]) -> None:
    text = ROW
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    holes = "??" in text or "~" in text
    config = SearchConfig(sketch=sketch(text)) if holes else SearchConfig(start=p3i.loads(text))
    image = program_scene(p3i.loads(ROW), 0, size=Size(80, 60)).image()
    with pytest.raises(SketchError, match="goes beyond 1,000,000"):
        p3i.synth(image, config)

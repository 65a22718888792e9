"""`p3i trace`: what a search tried, as pictures; and what is said of traces that are none."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pil
from truth import small_scene

import p3i
from p3i.cli.main import run
from p3i.grammar.printer import format_program
from p3i.paint.draw.film import MOST_FRAMES, evenly, film_of
from p3i.paint.draw.steps import read_steps
from p3i.search.config import SearchConfig
from p3i.search.synthesize import synthesize
from p3i.vision.write import write_image

PHOTO = {"step": "photo", "image": "a.png", "width": 80, "height": 60, "focal": 35.0, "version": 1}
LATTICE = "for i in range(0, 3):\n    for j in range(0, 3):\n        Draw(x=20*i - 20, y=20*j - 20)\n"
RING = "for j in range(0, 8):\n    Draw(x=30*Cos(45*j), y=30*Sin(45*j))\n"


def step(name: str, text: str, score: float | None = None) -> dict[str, object]:
    return {"image": "a.png", "step": name, "program": "SetCameraPose(rx=-20, ry=5)\n" + text, "score": score}


@pytest.fixture
def trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Writes records as t.jsonl into the working folder, beside the photo a.png."""
    monkeypatch.chdir(tmp_path)
    write_image("a.png", np.full((60, 80, 3), 128, np.uint8))

    def write(*records: object) -> str:
        lines = [record if isinstance(record, str) else json.dumps(record) for record in records]
        Path("t.jsonl").write_text("\n".join(lines) + "\n")
        return "t.jsonl"

    return write


def test_a_trace_becomes_a_gif_with_a_frame_a_step_the_answer_longest(trace) -> None:
    name = trace(PHOTO, step("proposal", LATTICE), step("fit", RING, 0.2), step("answer", RING, 0.4))
    assert run(["trace", name, "-o", "t.gif"]) == 0
    with Pil.open("t.gif") as film:
        assert film.n_frames == 3
        durations = []
        for frame in range(3):
            film.seek(frame)
            durations.append(film.info["duration"])
        assert film.size == (80, 60 + 22)
    assert durations[2] > 4 * max(durations[:2])


def test_every_kind_of_program_is_drawn_where_it_draws(trace) -> None:
    """The dots of a frame lie where `p3i expand` says, for lattices and rings alike."""
    for text in (LATTICE, RING):
        film = film_of(Path(trace(PHOTO, step("answer", text))))
        program = p3i.loads("SetCameraPose(rx=-20, ry=5)\n" + text)
        camera = p3i.Camera.of(program, focal_mm=35.0)
        plane = np.array([point[:2] for point in p3i.expand(program)])
        matrix = camera.image_from_plane(p3i.read_image("a.png").size).numpy()
        seen = np.c_[plane, np.ones(len(plane))] @ matrix.T
        pixels = np.rint(seen[:, :2] / seen[:, 2:]).astype(int)
        inside = (pixels >= 0).all(1) & (pixels < (80, 60)).all(1)
        green = film.frames[0][0][pixels[inside][:, 1], pixels[inside][:, 0]].astype(int)
        assert inside.sum() >= 5
        assert (green[:, 1] > green[:, 0] + 40).all()


def test_a_contact_sheet_is_written_by_suffix(trace) -> None:
    assert run(["trace", trace(PHOTO, step("answer", LATTICE)), "-o", "t.png"]) == 0
    assert p3i.read_image("t.png").size.width >= 80


def test_the_search_writes_a_trace_that_can_be_drawn(tmp_path: Path) -> None:
    scene, records = small_scene(2), []
    result = synthesize(scene.image(), SearchConfig(), trace=records.append)
    (search,) = read_steps([json.dumps(record) for record in records], name="t")
    assert result.program is not None
    assert records[0]["step"] == "photo" and search.size == scene.size
    assert search.ended and search.steps[-1].program == result.program
    kinds = [one.name for one in search.steps]
    assert {"proposal", "fit", "candidate"} <= set(kinds)
    assert kinds.index("sketch") < kinds.index("proposal")
    assert all(one.program is not None for one in search.steps if one.name != "sketch")
    assert records[-1]["program"] == format_program(result.program)


def test_without_its_photo_the_ground_is_blank_and_that_is_said(trace, capsys) -> None:
    name = trace({**PHOTO, "image": "gone.png"}, step("answer", LATTICE))
    assert run(["trace", name, "-o", "t.gif"]) == 0
    assert "gone.png is not here" in capsys.readouterr().err
    assert run(["trace", name, "-o", "t.gif", "--force", "--image", "a.png"]) == 0
    assert capsys.readouterr().err == ""


def test_a_trace_without_an_answer_is_drawn_and_called_cut_short(trace, capsys) -> None:
    assert run(["trace", trace(PHOTO, step("proposal", LATTICE)), "-o", "t.gif"]) == 0
    assert "cut short" in capsys.readouterr().err


def test_a_refusal_is_drawn_with_its_reason(trace) -> None:
    refusal = {"step": "answer", "program": None, "score": 0.1, "reason": "no regular pattern"}
    assert len(film_of(Path(trace(PHOTO, step("fit", LATTICE), refusal))).frames) == 2


@pytest.mark.parametrize(
    ("lines", "line", "says"),
    [
        (["{"], 1, "no JSON"),
        (["[1]"], 1, '"step"'),
        ([{"step": "fit", "program": "Draw(x=0, y=0)"}], 1, "begins with the record of a photo"),
        ([{**PHOTO, "version": 2}], 1, "version 2"),
        ([{**PHOTO, "width": "wide"}], 1, "'width' should be a number"),
        ([{**PHOTO, "width": 0}], 1, "no photo has"),
        ([PHOTO, {"step": "fit", "program": "Draw(x=i*i, y=0)"}], 2, "cannot be read"),
        ([PHOTO, {"step": "fit", "program": 7}], 2, "cannot be read"),
        ([PHOTO, {"step": "fit", "score": "high"}], 2, "'score' should be a number"),
        ([PHOTO, {"step": "fit", "focal": -1}], 2, "focal length"),
    ],
)
def test_what_is_no_trace_is_refused_with_its_line(lines, line: int, says: str, trace, capsys) -> None:
    assert run(["trace", trace(*lines), "-o", "t.gif"]) == 3
    message = capsys.readouterr().err
    assert message.startswith(f"error: t.jsonl:{line}: ") and says in message
    assert not Path("t.gif").exists()


def test_an_empty_trace_and_none_at_all_are_refused(trace, capsys) -> None:
    assert run(["trace", trace(), "-o", "t.gif"]) == 3
    assert run(["trace", "none.jsonl", "-o", "t.gif"]) == 3
    Path("t.jsonl").write_bytes(b"\xff\xfe\x00")
    assert run(["trace", "t.jsonl", "-o", "t.gif"]) == 3
    assert capsys.readouterr().err.count("error: ") == 3


def test_of_several_searches_image_picks_one(trace, capsys) -> None:
    other = {**PHOTO, "image": "b.png"}
    name = trace(PHOTO, step("answer", LATTICE), other, step("fit", RING), step("answer", RING))
    assert run(["trace", name, "-o", "t.gif"]) == 2
    assert "--image says which" in capsys.readouterr().err
    assert len(film_of(Path(name), image="a.png").frames) == 1


def test_a_photo_of_another_size_is_refused(trace, capsys) -> None:
    name = trace({**PHOTO, "width": 81}, step("answer", LATTICE))
    assert run(["trace", name, "-o", "t.gif"]) == 3
    assert "80 x 60" in capsys.readouterr().err


@pytest.mark.parametrize("output", [[], ["-o", "t.jpg"], ["-o", "-"]])
def test_the_suffix_says_what_is_drawn(output: list[str], trace, capsys) -> None:
    assert run(["trace", trace(PHOTO, step("answer", LATTICE)), *output]) == 2
    assert ".gif or .png" in capsys.readouterr().err


def test_of_many_steps_so_many_are_shown_the_first_and_the_last_too(trace) -> None:
    name = trace(PHOTO, *[step("fit", LATTICE)] * 100, step("answer", LATTICE))
    assert len(film_of(Path(name)).frames) == MOST_FRAMES
    for count in (1, 59, 60, 61, 500):
        chosen = evenly(count, MOST_FRAMES)
        assert chosen[0] == 0 and chosen[-1] == count - 1 and len(set(chosen)) == len(chosen)

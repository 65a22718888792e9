"""The shell of `p3i synth`, around a search that is told what to answer by the colour of the photo."""

import contextlib
import dataclasses
import json
import os
import shlex
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import p3i
from p3i.cli.main import run
from p3i.grammar.ast import Affine, CameraPose, Draw, For, Program
from p3i.search.config import SearchConfig
from p3i.search.result import FOCAL_REASONS, Candidate, Reading, StopReason, SynthesisResult

# What the search is to do with a photo of this grey level.
FINDS, FINDS_NOTHING, HAS_A_BUG, IS_INTERRUPTED, IS_LATE, FINDS_A_RING = 200, 0, 40, 80, 120, 160
HAS_TWO_READINGS = 240
UNSURE = "what of the cell is its object is not sure: drawn on the crossings (0.70)"
READINGS = (Reading("crossing", 0.7, (0.0, 0.0)), Reading("field", 0.25, (0.5, 0.5)))


def lattice(step: float, start: float = -30) -> Program:
    inner = Draw(x=Affine(step, 0, start), y=Affine(0, step, start))
    rows = For("j", Affine(), Affine(constant=4), inner)
    return Program(CameraPose(-31.2, 8.4), For("i", Affine(), Affine(constant=5), rows))


def ring() -> Program:
    """A program that Table 1 of the paper cannot spell."""
    draw = "Draw(x=20*Cos(30*i) + 1, y=20*Sin(30*i) + 2)"
    return p3i.loads(f"SetCameraPose(rx=0, ry=0)\nfor i in range(0, 12):\n    {draw}\n")


class Search:
    """The stand-in for p3i.search.synthesize, which remembers what it was asked."""

    def __init__(self) -> None:
        self.configs: list[SearchConfig] = []
        self.images: list = []
        self.meanwhile: Callable[..., object] = lambda image: None
        """What happens elsewhere while the search is at it."""

    def synthesize(self, image, config, *, progress=None, trace=None) -> SynthesisResult:
        self.configs.append(config)
        self.images.append(image)
        if progress is not None:
            progress("proposing", 0.5)
        if trace is not None:
            trace({"stage": "proposal", "score": np.float32(0.5), "theta": np.zeros(2)})
        level = round(float(image.pixels[0, 0, 0]) * 255)
        if level == HAS_A_BUG:
            raise ZeroDivisionError("division by zero")
        if level == FINDS_NOTHING:
            return SynthesisResult(program=None, stop=StopReason.NO_PATTERN, agreement=0.12, needed=0.35)
        self.meanwhile(image)
        stop = {IS_INTERRUPTED: StopReason.INTERRUPTED, IS_LATE: StopReason.TIME_UP}.get(level)
        if level == FINDS_A_RING:
            return SynthesisResult(program=ring(), stop=StopReason.FOUND, structure="circular", score=0.7)
        start = 0 if config.strict else -30  # a coordinate of Table 1 has no constant
        found = [
            Candidate(program=lattice(s, start), score=s / 100, structure="lattice") for s in (12.0, 6.0, 3.0)
        ]
        unsure = level == HAS_TWO_READINGS
        if unsure:
            found = [
                dataclasses.replace(one, reading=reading, same_lattice=k > 0)
                for k, (one, reading) in enumerate(zip(found, READINGS, strict=False))
            ]
        return SynthesisResult(
            program=found[0].program,
            stop=stop or StopReason.FOUND,
            readings=READINGS if unsure else (),
            notes=(UNSURE,) if unsure else (),
            structure="lattice",
            score=0.87654321,
            margin=0.21,
            needed=0.35,
            candidates=tuple(found[: config.top]),
            centers=((10.123456, 20.0, 0, 0), (30.5, 20.25, 1, 0)),
            focal_mm=config.focal_mm or 35.0,
            focal_source="option" if config.focal_mm else "default",
            focal_reason=FOCAL_REASONS["option" if config.focal_mm else "default"],
            features=config.features_used,
            seed=config.seed,
        )


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Search:
    stand_in = Search()
    module = types.ModuleType("p3i.search.synthesize")
    module.synthesize = stand_in.synthesize  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "p3i.search.synthesize", module)
    # The photos are of one grey level: no object of what is answered is there.
    monkeypatch.setattr("p3i.place.presence.absent_of", lambda *_, **__: (0, 20))
    return stand_in


@pytest.fixture
def photo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, search: Search) -> Callable[..., str]:
    """Makes a photo of one grey level in the working folder, and returns its name."""
    monkeypatch.chdir(tmp_path)

    def make(name: str, level: int = FINDS) -> str:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(name, np.full((48, 64, 3), level, np.uint8))
        return name

    return make


def test_the_program_of_a_photo_is_printed_with_its_header(photo, capsys) -> None:
    assert run(["synth", photo("a.png")]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out == Path(__file__).with_name("golden").joinpath("synth.p3p").read_text()


def test_the_printed_program_is_read_back_by_p3i(photo, capsys) -> None:
    run(["synth", photo("a.png")])
    program = p3i.loads(capsys.readouterr().out)
    assert program == p3i.loads(p3i.format(program))
    assert program.header is not None and program.header.canvas == (64, 48)


def test_jsonl_has_the_documented_keys_in_order(photo, capsys) -> None:
    assert run(["synth", "--format", "jsonl", photo("a.png")]) == 0
    record = json.loads(capsys.readouterr().out)
    assert list(record) == [
        "image", "width", "height", "program", "structure", "object", "object_confidence", "camera",
        "centers", "region", "score", "agreement", "bits", "margin", "margin_bits", "false_alarms",
        "absent", "seconds", "features", "seed",
    ]  # fmt: skip
    assert (record["image"], record["width"], record["height"]) == ("a.png", 64, 48)
    assert record["camera"] == {
        "rx": -31.2,
        "ry": 8.4,
        "focal": 35.0,
        "focal_from": "default",
        "focal_reason": "assumed, since nothing tells",
    }
    assert record["centers"] == [[10.12, 20.0, 0, 0], [30.5, 20.25, 1, 0]]
    assert record["program"].startswith("# /// p3p\n")


def test_a_photo_without_a_pattern_is_5_with_a_reason(photo, capsys) -> None:
    assert run(["synth", photo("cat.png", FINDS_NOTHING)]) == 5
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "error: cat.png: no regular pattern (best 0.12, needs 0.35)\n"


def test_a_photo_without_a_pattern_is_a_line_of_jsonl(photo, capsys) -> None:
    assert run(["synth", "--format", "jsonl", photo("cat.png", FINDS_NOTHING)]) == 5
    record = json.loads(capsys.readouterr().out)
    assert list(record) == ["image", "program", "error", "code", "seconds"]
    assert record["program"] is None and record["code"] == 5
    assert record["error"] == "no regular pattern (best 0.12, needs 0.35)"


def test_a_batch_goes_on_after_each_kind_of_failure(photo, capsys) -> None:
    names = [photo("a.png"), photo("b.png", FINDS_NOTHING), "missing.png", photo("c.png", HAS_A_BUG)]
    names.append(photo("d.png"))
    assert run(["synth", "--format", "jsonl", *names]) == 6
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [record["image"] for record in records] == names
    assert [record.get("code", 0) for record in records] == [0, 5, 3, 70, 0]


def test_a_batch_without_any_pattern_is_5(photo, capsys) -> None:
    photo("b.png", FINDS_NOTHING)
    photo("c.png", FINDS_NOTHING)
    assert run(["synth", "--format", "jsonl", "*.png"]) == 5


def test_a_bug_in_a_single_photo_is_70(photo, capsys) -> None:
    assert run(["synth", photo("a.png", HAS_A_BUG)]) == 70
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_errors_as_json_name_their_photo(photo, capsys) -> None:
    assert run(["synth", "--error-format", "json", photo("cat.png", FINDS_NOTHING)]) == 5
    assert json.loads(capsys.readouterr().err) == {
        "image": "cat.png",
        "error": "no regular pattern (best 0.12, needs 0.35)",
        "code": 5,
    }


def test_a_program_that_cannot_be_printed_costs_no_other_photo(photo, capsys) -> None:
    names = [photo("a.png"), photo("b.png", FINDS_A_RING), photo("c.png")]
    assert run(["synth", "--strict", *names, "-o", "out/"]) == 6
    assert sorted(path.name for path in Path("out").iterdir()) == ["a.p3p", "c.p3p"]
    said = capsys.readouterr().err
    assert said.startswith("error: b.png: ") and said.count("\n") == 1
    assert run(["synth", "--strict", "b.png"]) == 4


def test_an_answer_that_cannot_be_recorded_costs_no_other_photo(photo, capsys, monkeypatch) -> None:
    from p3i.search.result import SynthesisResult

    honest = SynthesisResult.record

    def recorded(result: SynthesisResult, **rest):
        if result.structure == "circular":
            raise ArithmeticError("a number nobody foresaw")
        return honest(result, **rest)

    monkeypatch.setattr(SynthesisResult, "record", recorded)
    names = [photo("a.png"), photo("b.png", FINDS_A_RING), photo("c.png")]
    assert run(["synth", *names, "-o", "out.jsonl"]) == 6
    records = [json.loads(line) for line in Path("out.jsonl").read_text().splitlines()]
    assert [one["program"] is None for one in records] == [False, True, False]
    assert records[1]["code"] == 70 and "a number nobody foresaw" in records[1]["error"]


def test_a_file_that_cannot_be_written_costs_no_other_photo(photo, search, capsys) -> None:
    search.meanwhile = lambda image: Path("out/b.p3p").mkdir(exist_ok=True)
    names = [photo("a.png"), photo("b.png"), photo("c.png")]
    assert run(["synth", *names, "-o", "out/"]) == 6
    assert sorted(path.name for path in Path("out").glob("*.p3p") if path.is_file()) == ["a.p3p", "c.p3p"]
    assert "error: " in capsys.readouterr().err


def test_an_interrupt_while_an_answer_is_written_keeps_those_before_it(photo, monkeypatch) -> None:
    from p3i.cli import report

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(report, "line", interrupted)
    names = [photo("a.png"), photo("b.png", FINDS_NOTHING), photo("c.png")]
    assert run(["synth", *names, "-o", "out.jsonl"]) == 130
    assert len(Path("out.jsonl").read_text().splitlines()) == 2


def test_an_interrupt_prints_the_best_so_far_and_stops_the_batch(photo, search, capsys) -> None:
    names = [photo("a.png"), photo("b.png", IS_INTERRUPTED), photo("c.png")]
    assert run(["synth", "--format", "jsonl", *names]) == 130
    captured = capsys.readouterr()
    assert [json.loads(line)["image"] for line in captured.out.splitlines()] == ["a.png", "b.png"]
    assert "interrupted" in captured.err and "best program so far" in captured.err


def test_an_interrupt_that_escapes_the_search_is_130_too(photo, search, monkeypatch, capsys) -> None:
    def interrupted(*_: object, **__: object) -> SynthesisResult:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["p3i.search.synthesize"], "synthesize", interrupted)
    assert run(["synth", photo("a.png"), "-o", "a.p3p"]) == 130
    assert not Path("a.p3p").exists()


def test_an_interrupted_jsonl_file_keeps_the_lines_that_were_known(photo, capsys) -> None:
    assert run(["synth", photo("a.png"), photo("b.png", IS_INTERRUPTED), "-o", "out.jsonl"]) == 130
    assert len(Path("out.jsonl").read_text().splitlines()) == 2


def test_the_end_of_the_time_is_an_answer_with_a_note(photo, capsys) -> None:
    assert run(["synth", "--time", "1", photo("a.png", IS_LATE)]) == 0
    assert "the time was up" in capsys.readouterr().err


def test_o_writes_a_file_with_the_photo_relative_to_it(photo, capsys) -> None:
    Path("out").mkdir()
    assert run(["synth", photo("in/a.png"), "-o", "out/b.p3p"]) == 0
    assert capsys.readouterr().out == ""
    assert 'image = "../in/a.png"' in Path("out/b.p3p").read_text()


def test_o_folder_holds_a_program_a_photo(photo) -> None:
    photo("in/a.png")
    photo("in/b.png", FINDS_NOTHING)
    photo("in/c.png")
    photo("in/c.jpg")
    Path("in/notes.txt").write_text("no photo")
    assert run(["synth", "in", "-o", "out/"]) == 6
    assert sorted(path.name for path in Path("out").iterdir()) == ["a.p3p", "c.jpg.p3p", "c.png.p3p"]


def test_nothing_is_overwritten_without_force(photo, search, capsys) -> None:
    Path("a.p3p").write_text("mine")
    assert run(["synth", photo("a.png"), "-o", "a.p3p"]) == 3
    assert "--force" in capsys.readouterr().err
    assert Path("a.p3p").read_text() == "mine"
    assert search.configs == []  # refused before the search, not after it
    assert run(["synth", "a.png", "-o", "a.p3p", "--force"]) == 0
    assert Path("a.p3p").read_text() != "mine"


@pytest.mark.parametrize("level", [FINDS_NOTHING, HAS_A_BUG])
def test_a_failure_leaves_no_file_behind(level: int, photo) -> None:
    assert run(["synth", photo("a.png", level), "-o", "a.p3p"]) != 0
    assert sorted(path.name for path in Path().iterdir()) == ["a.png"]


def test_an_output_that_cannot_be_written_is_3_before_the_search(photo, search, capsys) -> None:
    assert run(["synth", photo("a.png"), "-o", "nowhere/a.p3p"]) == 3
    assert "no folder nowhere" in capsys.readouterr().err
    assert search.configs == []


def test_the_progress_bar_stays_on_stderr_and_vanishes(photo) -> None:
    pty = pytest.importorskip("pty")
    script = (
        "import sys, types\n"
        "from p3i.search.result import StopReason, SynthesisResult\n"
        "def synthesize(image, config, *, progress, trace=None):\n"
        "    progress('proposing poses', 0.5)\n"
        "    return SynthesisResult(program=None, stop=StopReason.NO_PATTERN)\n"
        "module = types.ModuleType('p3i.search.synthesize')\n"
        "module.synthesize = synthesize\n"
        "sys.modules['p3i.search.synthesize'] = module\n"
        "from p3i.cli.main import run\n"
        "sys.exit(run(['synth', 'a.png', '--format', 'jsonl']))\n"
    )
    photo("a.png")
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    done = subprocess.run(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=theirs, timeout=60, env=environment
    )
    os.close(theirs)
    shown = ""
    with contextlib.suppress(OSError):  # Linux says so when all is read
        while part := os.read(ours, 4096):
            shown += part.decode(errors="replace")
    os.close(ours)
    assert json.loads(done.stdout)["code"] == 5
    assert "a.png: proposing poses" in shown
    assert shown.rstrip().endswith("no regular pattern")


def test_top_prints_programs_one_after_another_each_under_its_score(photo, capsys) -> None:
    assert run(["synth", "--top", "2", photo("a.png")]) == 0
    first, second = capsys.readouterr().out.split("# candidate 2 of 2: lattice, score 0.06\n")
    assert first.startswith("# candidate 1 of 2: lattice, score 0.12\n# /// p3p\n")
    assert p3i.loads(first).world == lattice(12.0).world
    assert p3i.loads(second).world == lattice(6.0).world
    assert run(["synth", "--top", "2", "a.png", "-o", "b.p3p"]) == 0
    assert p3i.load("b.2.p3p").world == lattice(6.0).world


def test_top_tells_the_other_places_of_the_cell_as_the_same_lattice(photo, search, capsys, golden) -> None:
    assert run(["synth", "--top", "2", photo("a.png", HAS_TWO_READINGS)]) == 0
    captured = capsys.readouterr()
    golden(Path(__file__).with_name("golden") / "synth-readings.p3p", captured.out)
    assert captured.err == f"note: a.png: {UNSURE}\n"
    assert run(["synth", "--top", "2", "--format", "jsonl", "a.png"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["object"], record["object_confidence"]) == ("crossing", 0.7)
    told = [(one["object"], one["object_confidence"], one["same_lattice"]) for one in record["candidates"]]
    assert told == [("crossing", 0.7, False), ("field", 0.25, True)]


def test_top_lists_candidates(photo, capsys) -> None:
    assert run(["synth", "--format", "jsonl", "--top", "2", photo("a.png")]) == 0
    candidates = json.loads(capsys.readouterr().out)["candidates"]
    assert [candidate["score"] for candidate in candidates] == [0.12, 0.06]
    assert run(["synth", "--top", "2", "a.png", "-o", "out/"]) == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["a.2.p3p", "a.p3p"]


def test_trace_writes_the_steps_of_each_photo(photo) -> None:
    assert run(["synth", "--format", "jsonl", photo("a.png"), photo("b.png"), "--trace", "t.jsonl"]) == 0
    steps = [json.loads(line) for line in Path("t.jsonl").read_text().splitlines()]
    assert [step["image"] for step in steps] == ["a.png", "b.png"]
    assert steps[0]["theta"] == [0.0, 0.0]


def test_every_option_of_the_search_arrives_there(photo, search) -> None:
    photo("a.png")
    search_words = "--structure lattice --extent image --focal 28 --features rgb --strict --time 3.5"
    assert run(["synth", photo("b.png"), "--object", "field"]) == 0
    assert search.configs.pop() == SearchConfig(object="field")
    words = shlex.split(f"{search_words} --top 2 --seed 7 --threads 2 --format jsonl")
    assert run(["synth", "a.png", *words]) == 0
    assert search.configs == [
        SearchConfig(
            structure="lattice",
            extent="image",
            focal_mm=28.0,
            features="rgb",
            strict=True,
            time_s=3.5,
            top=2,
            seed=7,
            threads=2,
        )
    ]


def test_mask_and_roi_make_pixels_unknown(photo, search) -> None:
    mask = np.zeros((48, 64), np.uint8)
    mask[:, :10] = 255
    cv2.imwrite(photo("mask.png"), mask)
    assert run(["synth", photo("a.png"), "--mask", "mask.png", "--roi", "5,6,20,30"]) == 0
    valid = search.images[0].valid
    expected = np.zeros((48, 64), bool)
    expected[6:36, 10:25] = True
    assert np.array_equal(valid, expected)


def test_a_polygon_is_a_region_of_interest(photo, search) -> None:
    assert run(["synth", photo("a.png"), "--roi", "0,0 63,0 0,47"]) == 0
    valid = search.images[0].valid
    assert valid[1, 1] and not valid[46, 62]
    assert 0.45 < valid.mean() < 0.55


@pytest.mark.parametrize(
    "words",
    [
        ["--roi", "1,2,3"],
        ["--roi", "a,b,c,d"],
        ["--roi", "0,0,nan,5"],
        ["--roi", "1000,1000,5,5"],
        ["--structure", "spiral"],
        ["--features", "sift"],
        ["--features", "alexnet"],
        ["--focal", "0"],
        ["--time", "-1"],
        ["--time", "nan"],
        ["--top", "0"],
        ["--threads", "0"],
        ["--seed", "-1"],
        ["--max-px", "0"],
        ["--format", "jsonl", "-o", "."],
        ["b.png"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_2_with_one_line(words: list[str], photo, capsys) -> None:
    photo("a.png")
    photo("b.png")
    assert run(["synth", "a.png", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1


@pytest.mark.parametrize("structure", ["auto", "lattice", "circular", "hybrid"])
def test_every_structure_can_be_asked_for(structure: str, photo, search) -> None:
    assert run(["synth", photo("a.png"), "--structure", structure]) == 0
    assert search.configs[0].structure == structure


def test_verbose_names_the_focal_and_where_it_came_from(photo, capsys) -> None:
    assert run(["synth", "-v", photo("a.png")]) == 0
    assert "focal 35 mm, assumed, since nothing tells" in capsys.readouterr().err
    assert run(["synth", "-v", "--focal", "28", "a.png"]) == 0
    assert "focal 28 mm, given by the caller" in capsys.readouterr().err


def test_equal_calls_print_equal_json_apart_from_the_seconds(photo, capsys) -> None:
    photo("a.png")
    printed = []
    for _ in range(2):
        run(["synth", "--format", "jsonl", "a.png"])
        printed.append({**json.loads(capsys.readouterr().out), "seconds": None})
    assert printed[0] == printed[1]


def test_an_empty_folder_and_an_empty_glob_are_3(photo, capsys) -> None:
    Path("empty").mkdir()
    assert run(["synth", "empty"]) == 3
    assert "holds no file of a known kind" in capsys.readouterr().err
    assert run(["synth", "*.jpg"]) == 3
    assert "no file matches *.jpg" in capsys.readouterr().err


def test_a_photo_comes_through_standard_input(photo, monkeypatch, capsys) -> None:
    with open(photo("a.png"), encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        assert run(["synth", "-"]) == 0
    printed = capsys.readouterr().out
    assert "SetCameraPose" in printed and "image" not in printed


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
def test_a_name_that_is_no_text_is_printed_all_the_same(photo, capsys) -> None:
    name = os.fsdecode(b"\xff\xe9.png")
    Path(photo("a.png")).rename(name)
    assert run(["synth", "--format", "jsonl", name]) == 0
    assert json.loads(capsys.readouterr().out)["image"] == name
    assert run(["synth", name]) == 0
    assert run(["synth", "-v", name, "-o", "out/"]) == 0


FINDS_TWO = 210


@pytest.fixture
def two(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    """A search that finds two patterns on photos of one grey level: the second where the first is masked."""
    plain = search.synthesize

    def synthesize(image, config, *, progress=None, trace=None) -> SynthesisResult:
        again = bool((~image.valid).any())
        level = round(float(image.pixels[0, 0, 0]) * 255)
        if again and (level != FINDS_TWO or not image.valid[0, 63]):
            return SynthesisResult(program=None, stop=StopReason.NO_PATTERN, score=0.12, needed=0.35)
        result = plain(image, config, progress=progress, trace=trace)
        if not again:
            return result
        corner = p3i.loads("SetCameraPose(rx=0, ry=0)\nfor i in range(0, 2):\n    Draw(x=3*i + 45, y=-34)\n")
        centers = ((60.0, 3.0, 0, 0), (62.0, 3.0, 1, 0))
        return dataclasses.replace(result, program=corner, centers=centers, score=0.5)

    monkeypatch.setattr(sys.modules["p3i.search.synthesize"], "synthesize", synthesize)


def test_all_prints_a_program_for_each_pattern(photo, two, capsys) -> None:
    assert run(["synth", photo("a.png", FINDS_TWO), "--all"]) == 0
    out = capsys.readouterr().out
    first, second = out.split("\n# pattern 2 of 2: lattice, score 0.50\n")
    assert first.startswith("# pattern 1 of 2: lattice, score 0.88\n")
    assert p3i.loads(second).header is not None
    assert "x=3*i" in second and "x=3*i" not in first


def test_all_of_a_photo_with_one_pattern_is_as_without(photo, two, capsys) -> None:
    assert run(["synth", photo("a.png"), "--all"]) == 0
    assert capsys.readouterr().out == Path(__file__).with_name("golden").joinpath("synth.p3p").read_text()


def test_all_is_a_line_of_jsonl_for_each_pattern(photo, two, capsys) -> None:
    names = [photo("a.png", FINDS_TWO), photo("b.png", FINDS_NOTHING), photo("c.png")]
    assert run(["synth", *names, "--all", "--format", "jsonl", "-q"]) == 6
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    told = [(one["image"], one.get("pattern"), one.get("patterns")) for one in lines]
    assert told == [("a.png", 1, 2), ("a.png", 2, 2), ("b.png", None, None), ("c.png", 1, 1)]


def test_all_writes_a_file_for_each_pattern_and_overwrites_none(photo, two, capsys) -> None:
    Path("out").mkdir()
    Path("out/a-2.p3p").write_text("mine")
    words = ["synth", photo("a.png", FINDS_TWO), "--all", "-o", "out/"]
    assert run(words) == 3
    assert "a-2.p3p" in capsys.readouterr().err
    assert not Path("out/a.p3p").exists() and Path("out/a-2.p3p").read_text() == "mine"
    assert run([*words, "--force"]) == 0
    assert "x=3*i" in Path("out/a-2.p3p").read_text() and Path("out/a.p3p").exists()


def test_photos_named_like_a_further_pattern_of_another_are_refused(photo, two, capsys) -> None:
    names = [photo("a.png"), photo("a-2.png")]
    assert run(["synth", *names, "--all", "-o", "out/"]) == 2
    assert "a-2.p3p" in capsys.readouterr().err
    assert run(["synth", *names, "-o", "out/"]) == 0


def test_all_and_several_candidates_contradict_each_other(photo, two, capsys) -> None:
    assert run(["synth", photo("a.png"), "--all", "--top", "3"]) == 2
    assert "--top" in capsys.readouterr().err
